import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.evaluation.truth import Stretch, confusion_seconds, judge_hits


def stretch(start, end, label="squat", document="a"):
    return Stretch(document, label, start, end)


def test_the_best_hit_on_a_label_is_right_and_further_ones_are_wrong():
    judged = judge_hits([stretch(0, 1), stretch(1, 2), stretch(5, 6)], [stretch(0, 3)])
    assert judged.relevant.tolist() == [True, False, False]
    assert judged.fresh.tolist() == [True, False, False]
    assert judged.labels == 1


def test_where_labels_cover_repetitions_further_hits_are_right():
    judged = judge_hits(
        [stretch(0, 1), stretch(1, 2), stretch(5, 6)], [stretch(0, 3)], repeated=True
    )
    assert judged.relevant.tolist() == [True, True, False]
    assert judged.fresh.tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("hit", "right"),
    [
        (stretch(0.0, 2.0), True),
        (stretch(0.9, 3.0), True),
        (stretch(1.0, 3.0), False),  # exactly half of both
        (stretch(-4.0, 9.0), True),  # a long hit around the label
        (stretch(0.0, 2.0, document="b"), False),
    ],
)
def test_a_hit_must_share_more_than_half_of_the_shorter(hit, right):
    assert judge_hits([hit], [stretch(0, 2)]).relevant.tolist() == [right]


def test_a_label_of_a_whole_document_has_any_hit_in_it():
    judged = judge_hits([stretch(7, 9)], [stretch(0, math.inf)])
    assert judged.fresh.tolist() == [True]


def test_a_hit_takes_the_free_label_that_it_shares_most_with():
    labels = [stretch(0, 2), stretch(2, 5)]
    judged = judge_hits([stretch(1.1, 5), stretch(2, 5), stretch(0, 2)], labels)
    assert judged.fresh.tolist() == [True, False, True]


def test_no_hits_and_no_labels_are_fine():
    judged = judge_hits([], [])
    assert (len(judged.relevant), judged.labels) == (0, 0)


def test_seconds_of_confusion():
    truth = [stretch(0, 4, "squat"), stretch(6, 8, "jump")]
    found = [stretch(1, 5, "squat"), stretch(6, 7, "squat")]
    spent = confusion_seconds(found, truth, {"a": 10.0})
    assert spent == pytest.approx(
        {
            ("squat", "squat"): 3.0,
            ("squat", ""): 1.0,
            ("", "squat"): 1.0,
            ("jump", "squat"): 1.0,
            ("jump", ""): 1.0,
            ("", ""): 3.0,
        }
    )


def test_overlapping_annotations_count_for_the_right_one_else_in_equal_shares():
    found = [stretch(0, 2, "squat"), stretch(0, 4, "jump"), stretch(2, 4, "kick")]
    spent = confusion_seconds(found, [stretch(0, 4, "squat")], {})
    assert spent == pytest.approx(
        {("squat", "squat"): 2.0, ("squat", "jump"): 1.0, ("squat", "kick"): 1.0}
    )


def test_a_label_without_an_end_lasts_as_long_as_its_document():
    truth = [stretch(0, math.inf)]
    assert confusion_seconds([stretch(0, 3)], truth, {"a": 5.0}) == pytest.approx(
        {("squat", "squat"): 3.0, ("squat", ""): 2.0}
    )
    assert confusion_seconds([stretch(0, 3)], truth, {}) == {("squat", "squat"): 3.0}


spans = st.lists(
    st.tuples(st.integers(0, 40), st.integers(1, 20), st.sampled_from("xyz")), max_size=6
)


@given(spans, spans)
def test_exact_seconds_agree_with_a_walk_over_frames(found, truth):
    # Times are whole frames, so that a walk frame by frame is exact.
    found = [stretch(s / 10, (s + n) / 10, label) for s, n, label in found]
    cursor, labels = 0, []
    for s, n, label in truth:  # labels do not overlap
        labels.append(stretch((cursor + s) / 10, (cursor + s + n) / 10, label))
        cursor += s + n
    length = 30.0
    spent = confusion_seconds(found, labels, {"a": length})
    walked = {}
    for frame in range(int(length * 10) if found or labels else 0):
        t = frame / 10 + 0.05
        said = sorted({f.label for f in found if f.start <= t < f.end}) or [""]
        true = next((x.label for x in labels if x.start <= t < x.end), "")
        for one in [true] if true in said else said:
            walked[true, one] = walked.get((true, one), 0.0) + 0.1 / (
                1 if true in said else len(said)
            )
    assert spent == pytest.approx(walked)


def test_time_is_neither_lost_nor_made():
    random = np.random.default_rng(3)
    edges = np.sort(random.random(12) * 20)
    truth = [stretch(a, b, "xyz"[n % 3]) for n, (a, b) in enumerate(itertools.pairwise(edges))]
    found = [stretch(t, t + 2, "xyz"[n % 3]) for n, t in enumerate(random.random(8) * 18)]
    assert sum(confusion_seconds(found, truth, {"a": 20.0}).values()) == pytest.approx(20.0)
