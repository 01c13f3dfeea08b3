import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.alignment.coarse import full_region, match_segments, widened_region
from mocapidx.errors import ParameterError
from mocapidx.segments.runs import find_runs
from tests.naive_warping import in_widened_segments


def words(*values):
    return np.array(values, dtype=np.uint64)


def stretched(sequence, lengths):
    return np.repeat(words(*sequence), lengths)


WALK = (3, 2, 3, 1, 3, 2, 3, 1, 3, 2)  # the paper's walk: right foot bit 0, left foot bit 1


def test_a_slow_walk_is_matched_with_a_fast_one_segment_by_segment():
    fast, slow = stretched(WALK, 2), stretched(WALK, [7, 5, 6, 5, 9, 5, 6, 5, 6, 8])
    match = match_segments(fast, slow, 3)
    assert match.mask == 3
    assert match.words.tolist() == list(WALK)
    assert match.bounds.tolist() == list(range(0, 21, 2))
    assert match.other_bounds.tolist() == [0, 7, 12, 18, 23, 32, 37, 43, 48, 54, 62]


def test_a_feature_that_disagrees_is_dropped_and_the_others_align():
    one, other = stretched((0, 1, 5, 4), 3), stretched((0, 1, 4), 4)
    with_noise = other | words(*[2 * (t % 2) for t in range(12)])
    match = match_segments(one, with_noise, 7)
    assert match.mask == 5 & match.mask
    assert match.words.tolist() == find_runs(one & np.uint64(match.mask))[0].tolist()


def test_only_selected_features_count():
    one, other = stretched((0, 1, 3), 4), stretched((0, 1, 3), 5)
    assert match_segments(one, other, 2).bounds.tolist() == [0, 8, 12]


@pytest.mark.parametrize(
    ("one", "other"),
    [((0, 1), (1, 0)), ((0, 1), (0, 1, 0)), ((0,), (0,)), ((0, 1), (0,))],
)
def test_without_a_common_course_there_is_no_coarse_alignment(one, other):
    assert match_segments(stretched(one, 3), stretched(other, 4), 1) is None


sequences = st.lists(st.integers(0, 15), min_size=1, max_size=40)


@given(sequences, sequences, st.integers(1, 15))
def test_both_motions_go_through_the_matched_segments(one, other, mask):
    one, other = words(*one), words(*other)
    match = match_segments(one, other, mask)
    if match is None:
        return
    assert match.mask
    assert match.mask & ~mask == 0
    for frames, bounds in ((one, match.bounds), (other, match.other_bounds)):
        values, expected = find_runs(frames & np.uint64(match.mask))
        assert values.tolist() == match.words.tolist()
        assert bounds.tolist() == expected.tolist()


@given(sequences, st.lists(st.integers(1, 4), min_size=40, max_size=40))
def test_a_motion_and_its_slower_self_agree_in_every_feature_that_changes(one, lengths):
    one = words(*one)
    slow = np.repeat(one, lengths[: len(one)])
    changing = int(np.bitwise_or.reduce(one ^ one[0]))
    match = match_segments(one, slow, 15)
    if not changing:
        assert match is None
    else:
        assert match.mask == changing


bounds_of = st.lists(st.integers(1, 6), min_size=1, max_size=8)


@given(st.data(), st.integers(0, 7))
def test_the_region_is_what_lies_near_a_matched_segment(data, margin):
    lengths = data.draw(bounds_of)
    others = data.draw(st.lists(st.integers(1, 6), min_size=len(lengths), max_size=len(lengths)))
    sequence = [n % 2 for n in range(len(lengths))]
    match = match_segments(stretched(sequence, lengths), stretched(sequence, others), 1)
    if match is None:
        return
    region = widened_region(match, np.full(len(match.words), margin))
    allowed = in_widened_segments(match.bounds, match.other_bounds, margin)
    for k, (low, high) in enumerate(zip(region.lows, region.highs, strict=True)):
        expected = [column for column in range(region.columns) if allowed(k, column)]
        assert list(range(low, high)) == expected
    assert region.lows[0] == 0
    assert region.highs[-1] == region.columns
    assert region.cells == sum(region.highs - region.lows)


def test_segments_may_have_margins_of_their_own():
    match = match_segments(stretched((0, 1, 0), 4), stretched((0, 1, 0), 4), 1)
    region = widened_region(match, np.array([0, 3, 0]))
    assert region.lows.tolist() == [0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 8]
    assert region.highs.tolist() == [4, 11, 11, 11, 11, 11, 11, 11, 12, 12, 12, 12]


def test_wrong_margins_are_refused():
    match = match_segments(stretched((0, 1), 4), stretched((0, 1), 4), 1)
    for margins in (np.array([1]), np.array([1, -1])):
        with pytest.raises(ParameterError, match="margin"):
            widened_region(match, margins)


def test_the_full_region_is_everything():
    region = full_region(3, 4)
    assert (region.cells, region.share) == (12, 1.0)
