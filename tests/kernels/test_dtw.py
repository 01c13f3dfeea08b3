import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.alignment import dtw

KERNEL = pytest.importorskip("mocapidx.kernels._dtw", reason="the kernels weren't built")
LEVELS = KERNEL.levels()


@pytest.fixture(params=["avx512", "avx2", "ssse3", "portable"], scope="module")
def level(request):
    """One set of instructions."""
    if request.param not in LEVELS:
        pytest.skip(f"this processor has no {request.param}")
    return request.param


def aligned(kernel, level, reference, others):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dtw, "LEVEL", level)
        patch.setattr(dtw, "compiled", lambda name: kernel)
        return list(dtw.align(reference, others))


def assert_aligned_alike(level, reference, others):
    ours = aligned(KERNEL, level, reference, others)
    theirs = aligned(None, None, reference, others)
    assert len(ours) == len(theirs) == len(others)
    for (cost, *path), (other_cost, *other_path) in zip(ours, theirs, strict=True):
        assert cost == other_cost
        np.testing.assert_array_equal(path, other_path)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    rows=st.integers(1, 40),
    lengths=st.lists(st.integers(1, 70), max_size=5),
    features=st.sampled_from((1, 3, 39, 64)),
    values=st.sampled_from((2, 3, 11, 1000)),
)
def test_every_level_finds_the_paths_of_numpy(level, seed, rows, lengths, features, values):
    rng = np.random.default_rng(seed)
    made = (rng.integers(0, values, (n, features)) / (values - 1) for n in (rows, *lengths))
    constant = rng.random(features) < 0.3
    reference, *others = (np.where(constant, 0.25, matrix) for matrix in made)
    assert_aligned_alike(level, reference, others)


def test_the_largest_distances_stay_exact(level):
    zeros, ones = np.zeros((3, 64)), np.ones((dtw.LONGEST_SEQUENCE, 64))
    assert_aligned_alike(level, zeros, [ones, zeros])
    assert aligned(KERNEL, level, zeros, [ones])[0][0] == 64 * dtw.LONGEST_SEQUENCE


def test_the_longest_sequences_have_room(level):
    rng = np.random.default_rng(5)
    reference, other = (rng.random(dtw.LONGEST_SEQUENCE)[:, None] < 0.5).astype(float), np.eye(2)
    assert_aligned_alike(level, reference, [other[:, :1]] * 3)


def arguments(**changes):
    """What aligning sequences of two and three frames with one of four needs."""
    right = {
        "reference": np.zeros((4, 5), np.int32),
        "others": np.zeros((5, 5), np.int32),
        "features": 5,
        "bounds": np.array([0, 2, 5]),
        "totals": np.zeros(2, np.int64),
        "lengths": np.zeros(2, np.int64),
        "in_reference": np.zeros(11, np.int64),
        "in_other": np.zeros(11, np.int64),
        "level": None,
    }
    return tuple((right | changes).values())


def test_right_arguments_are_taken():
    assert KERNEL.align(*arguments()) is None
    none = np.zeros(0, np.int64)
    empty = {"others": np.zeros((0, 5), np.int32), "bounds": np.zeros(1, np.int64)}
    KERNEL.align(*arguments(**empty, totals=none, lengths=none))


@pytest.mark.parametrize(
    "changes",
    [
        {"reference": np.zeros((0, 5), np.int32)},
        {"reference": np.zeros((4, 5), np.int64)},
        {"reference": np.zeros((4, 5), np.float32)},
        {"reference": np.zeros((4, 10), np.int32)[:, ::2]},
        {"reference": np.full((4, 5), -1, np.int32)},
        {"reference": np.full((4, 5), (1 << 24) + 1, np.int32)},
        {"reference": np.zeros((4097, 5), np.int32)},
        {"reference": np.zeros(21, np.int32)},
        {"others": np.zeros((5, 4), np.int32)},
        {"others": np.zeros((6, 5), np.int32)},
        {"others": np.full((5, 5), np.iinfo(np.int32).min, np.int32)},
        {"features": 0},
        {"features": -5},
        {"features": 65},
        {"features": 4},
        {"bounds": np.array([0, 2, 2])},
        {"bounds": np.array([0, 6, 5])},
        {"bounds": np.array([1, 2, 5])},
        {"bounds": np.array([0, -2, 5])},
        {"bounds": np.array([0, 5])},
        {"bounds": np.zeros(0, np.int64)},
        {"bounds": np.array([0, 2, 5], np.int32)},
        {"totals": np.zeros(1, np.int64)},
        {"lengths": np.zeros(3, np.int64)},
        {"lengths": np.zeros(2)},
        {"in_reference": np.zeros(10, np.int64)},
        {"in_other": np.zeros(10, np.int64)},
        {"level": "avx1024"},
    ],
    ids=str,
)
def test_wrong_arguments_are_refused(changes):
    with pytest.raises((TypeError, ValueError, BufferError)):
        KERNEL.align(*arguments(**changes))


def test_a_sequence_that_is_too_long_is_refused():
    others = np.zeros((4097, 1), np.int32)
    one, bounds = np.zeros(1, np.int64), np.array([0, 4097])
    long = {"reference": others[:4], "others": others, "features": 1, "bounds": bounds}
    room = np.zeros(4100, np.int64)
    with pytest.raises(ValueError, match="so many features"):
        KERNEL.align(*arguments(**long, totals=one, lengths=one, in_reference=room, in_other=room))
