import numpy as np
import pytest

from mocapidx.evaluation.metrics import (
    ClassTime,
    Counted,
    average_precision,
    class_times,
    counted_below,
    recall_in_top,
    separation_quotient,
)
from mocapidx.evaluation.truth import Judged


def judged(fresh, labels, relevant=None):
    fresh = np.array(fresh, dtype=bool)
    return Judged(fresh if relevant is None else np.array(relevant, dtype=bool), fresh, labels)


COSTS = np.array([0.01, 0.02, 0.03, 0.06, 0.09])
HITS = judged([1, 0, 1, 1, 0], 4)


@pytest.mark.parametrize(
    ("tau", "hits", "relevant"), [(0.01, 0, 0), (0.02, 1, 1), (0.06, 3, 2), (0.1, 5, 3)]
)
def test_hits_count_that_cost_less_than_tau(tau, hits, relevant):
    assert counted_below(COSTS, HITS, tau) == Counted(hits, relevant, relevant, 4)


def test_precision_recall_and_f1():
    counted = counted_below(COSTS, HITS)
    assert counted.precision == pytest.approx(3 / 5)
    assert counted.recall == pytest.approx(3 / 4)
    assert counted.f1 == pytest.approx(2 / 3)


def test_further_hits_on_a_label_are_right_but_find_nothing():
    counted = counted_below(COSTS, judged([1, 0, 0, 1, 0], 2, relevant=[1, 1, 1, 1, 0]))
    assert counted.precision == pytest.approx(4 / 5)
    assert counted.recall == 1.0


def test_what_has_no_basis_is_none():
    assert Counted(0, 0, 0, 3).precision is None
    assert Counted(0, 0, 0, 3).f1 == 0.0
    assert Counted(2, 0, 0, 0).recall is None
    assert Counted(2, 0, 0, 0).f1 is None
    assert average_precision(judged([0, 0], 0)) is None
    assert recall_in_top(judged([0], 0), 5) is None


def test_counts_of_classes_add_up():
    assert Counted(3, 2, 2, 4) + Counted(1, 1, 1, 1) == Counted(4, 3, 3, 5)


def test_average_precision_is_the_textbook_one():
    # Right at ranks 1, 3 and 4 of 4 labels: (1/1 + 2/3 + 3/4 + 0) / 4.
    assert average_precision(HITS) == pytest.approx((1 + 2 / 3 + 3 / 4) / 4)
    assert average_precision(judged([], 3)) == 0.0


def test_recall_in_the_best():
    assert [recall_in_top(HITS, top) for top in (1, 2, 3, 10)] == [0.25, 0.25, 0.5, 0.75]


def test_separation_quotient():
    assert separation_quotient(0.3, COSTS, HITS) == pytest.approx(0.3 / 0.03)
    assert separation_quotient(0.3, np.zeros(2), judged([1, 1], 2)) == np.inf
    assert separation_quotient(0.3, COSTS, judged([0] * 5, 2)) is None


def test_only_the_ten_best_count_for_the_separation_quotient():
    costs = np.arange(1.0, 13.0)
    hits = judged([1] + [0] * 9 + [1, 1], 3)
    assert separation_quotient(24.0, costs, hits) == pytest.approx(24.0)


def test_times_of_classes():
    spent = {("x", "x"): 3.0, ("x", "y"): 1.0, ("x", ""): 2.0, ("", "x"): 1.0, ("y", "y"): 4.0}
    times = class_times(spent, ["x", "y", ""])
    assert times == {"x": ClassTime(6.0, 4.0, 3.0), "y": ClassTime(4.0, 5.0, 4.0)}
    assert times["x"].precision == pytest.approx(0.75)
    assert times["x"].recall == pytest.approx(0.5)
    assert times["x"].f1 == pytest.approx(0.6)
    assert ClassTime(0.0, 0.0, 0.0).f1 is None
