import numpy as np
import pytest

from mocapidx.queries.rank import length_costs, ranking_order


def test_equal_lengths_cost_nothing_wherever_they_are():
    bounds = np.array([[0, 3, 10], [100, 103, 110]])
    assert length_costs(bounds, np.array([3, 7])).tolist() == [0.0, 0.0]


def test_twice_as_long_costs_as_much_as_half_as_long():
    longer = length_costs(np.array([[0, 19]]), np.array([9]))
    shorter = length_costs(np.array([[0, 9]]), np.array([19]))
    assert longer == pytest.approx(shorter)
    assert longer == pytest.approx(np.log(2))


def test_a_nearer_tempo_is_better_in_any_step():
    lengths = np.array([10, 20, 10])
    near, far = np.array([[0, 11, 30, 41]]), np.array([[0, 14, 30, 48]])
    assert length_costs(near, lengths) < length_costs(far, lengths)


def test_no_hits_have_no_costs():
    assert length_costs(np.zeros((0, 3), np.int64), np.array([1, 2])).shape == (0,)


def test_order_is_by_cost_then_document_then_start():
    order = ranking_order(
        np.array([0.5, 0.5, 0.5, 0.1, 0.5]),
        ["b", "a", "a", "c", "a"],
        np.array([0, 7, 2, 9, 2]),
        np.array([1, 8, 9, 10, 3]),
    )
    assert order.tolist() == [3, 4, 2, 1, 0]
