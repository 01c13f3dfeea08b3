import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.alignment import weighted
from mocapidx.alignment.weighted import LARGEST_WEIGHT, match_rows

KERNEL = pytest.importorskip("mocapidx.kernels._weighted", reason="the kernels weren't built")
LEVELS = KERNEL.levels()


@pytest.fixture(params=["avx512", "avx2", "ssse3", "portable"], scope="module")
def level(request):
    """One set of instructions."""
    if request.param not in LEVELS:
        pytest.skip(f"this processor has no {request.param}")
    return request.param


def matched(kernel, level, *case, block=weighted.BLOCK):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(weighted, "LEVEL", level)
        patch.setattr(weighted, "BLOCK", block)
        patch.setattr(weighted, "compiled", lambda name: kernel)
        return match_rows(*case)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    rows=st.integers(1, 30),
    frames=st.integers(0, 300),
    features=st.sampled_from((1, 7, 8, 9, 39, 64)),
    largest=st.sampled_from((0, 1, 5, LARGEST_WEIGHT)),
    block=st.sampled_from((10, 64, weighted.BLOCK)),
)
def test_every_level_has_the_bits_of_numpy(level, seed, rows, frames, features, largest, block):
    rng = np.random.default_rng(seed)
    ones = rng.random((rows, features)) < 0.5
    weights = rng.integers(0, largest, (rows, features), endpoint=True).astype(np.float64)
    some = rng.integers(0, (1 << features) - 1, 20, dtype=np.uint64, endpoint=True)
    breaks = np.flatnonzero(rng.random(frames) < 0.03)
    case = ones, weights, some[rng.integers(0, 20, frames)], breaks
    ours = matched(KERNEL, level, *case, block=block)
    for one, other in zip(ours, matched(None, None, *case), strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_longest_and_heaviest_pattern_stays_exact(level):
    ones = np.zeros((weighted.LONGEST_PATTERN, 64), dtype=bool)
    weights = np.full(ones.shape, float(LARGEST_WEIGHT))
    words = np.full(weighted.LONGEST_PATTERN, np.iinfo(np.uint64).max)
    costs, starts = matched(KERNEL, level, ones, weights, words)
    assert costs[-1] == weights.sum()
    assert starts[-1] == 0


def test_arrays_laid_out_otherwise_are_taken(level):
    rng = np.random.default_rng(1)
    ones, weights = rng.random((6, 4)) < 0.5, rng.integers(0, 9, (6, 4)).astype(np.float32)
    words = np.arange(30, dtype=np.uint64)[::3]
    case = ones.T, weights.T, words
    ours = matched(KERNEL, level, *case)
    np.testing.assert_array_equal(ours, matched(None, None, *case))


def arguments(**changes):
    """What two rows of nine features, three different words and seven frames need."""
    right = {
        "ones": np.zeros((2, 9), np.bool_),
        "weights": np.zeros((2, 9)),
        "features": 9,
        "octets": np.zeros((2, 3), np.int64),
        "words": 3,
        "places": np.zeros(7, np.int64),
        "breaks": np.array([3, 4]),
        "costs": np.zeros(7),
        "level": None,
    }
    return tuple((right | changes).values())


def test_right_arguments_are_taken():
    assert KERNEL.last_row(*arguments()) is None
    none = np.zeros(0, np.int64)
    empty = {"octets": none, "words": 0, "places": none, "breaks": none, "costs": np.zeros(0)}
    KERNEL.last_row(*arguments(**empty))


@pytest.mark.parametrize(
    "changes",
    [
        {"ones": np.zeros((2, 9), np.uint8)},
        {"ones": np.zeros((0, 9), np.bool_)},
        {"ones": np.zeros((2, 18), np.bool_)[:, ::2]},
        {"weights": np.zeros((2, 9), np.float32)},
        {"weights": np.zeros((2, 8))},
        {"features": 0},
        {"features": -9},
        {"features": 6},
        {"features": 72},
        {"octets": np.zeros((2, 4), np.int64)},
        {"octets": np.zeros((3, 3), np.int64)},
        {"octets": np.full((2, 3), 256)},
        {"octets": np.full((2, 3), -1)},
        {"words": 0},
        {"words": -3},
        {"words": 2},
        {"places": np.full(7, 3)},
        {"places": np.full(7, -1)},
        {"places": np.zeros(8, np.int64)},
        {"breaks": np.array([7])},
        {"breaks": np.array([-1])},
        {"costs": np.zeros(6)},
        {"costs": np.zeros(7, np.float32)},
        {"level": "avx1024"},
    ],
    ids=str,
)
def test_wrong_arguments_are_refused(changes):
    with pytest.raises((TypeError, ValueError, BufferError)):
        KERNEL.last_row(*arguments(**changes))


def test_more_frames_than_starts_have_numbers_are_refused():
    frames = np.zeros(weighted.SPAN + 1, np.int64)
    with pytest.raises(ValueError, match="fit each other"):
        KERNEL.last_row(*arguments(places=frames, costs=frames.astype(np.float64)))
