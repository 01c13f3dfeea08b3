import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.alignment import subsequence
from mocapidx.alignment.subsequence import many_subsequence_costs, subsequence_starts

KERNEL = pytest.importorskip("mocapidx.kernels._matching", reason="the kernels weren't built")
LEVELS = KERNEL.levels()
ALL_LEVELS = ("avx512", "avx2", "ssse3", "portable")


@pytest.fixture(params=ALL_LEVELS, scope="module")
def level(request):
    """One set of instructions."""
    if request.param not in LEVELS:
        pytest.skip(f"this processor has no {request.param}")
    return request.param


def bits_of(costs):
    return costs.view(np.uint32)


def in_c(level, templates, words, breaks, weighted=True):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(subsequence, "LEVEL", level)
        patch.setattr(subsequence, "compiled", lambda name: KERNEL)
        return many_subsequence_costs(templates, words, breaks, STEPS[weighted])


def in_numpy(templates, words, breaks, weighted=True):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(subsequence, "compiled", lambda name: None)
        return many_subsequence_costs(templates, words, breaks, STEPS[weighted])


STEPS = {True: "weighted", False: "printed"}


def made(seed, rows, frames, features, share_of_breaks=0.0):
    """Templates of some numbers of rows that often repeat one, words, and breaks for each."""
    rng = np.random.default_rng(seed)
    limit = (1 << features) - 1
    words = rng.integers(0, limit, frames, dtype=np.uint64, endpoint=True)
    templates, breaks = [], []
    for count in rows:
        some = rng.integers(0, limit, (2, count), dtype=np.uint64, endpoint=True)
        care, ones = some[:, np.sort(rng.integers(0, count, count))]
        care[rng.random(count) < 0.1] = 0
        templates.append((ones & care, care))
        breaks.append(np.flatnonzero(rng.random(frames) < share_of_breaks))
    return templates, words, breaks


@pytest.mark.parametrize("weighted", STEPS)
@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    rows=st.lists(st.integers(1, 12), min_size=1, max_size=4),
    frames=st.one_of(st.integers(0, 140), st.integers(2040, 2060), st.integers(4090, 4100)),
    features=st.sampled_from((1, 7, 8, 39, 63, 64)),
    share_of_breaks=st.sampled_from((0.0, 0.05, 0.5)),
)
def test_every_level_has_the_bits_of_numpy(
    level, weighted, seed, rows, frames, features, share_of_breaks
):
    case = made(seed, rows, frames, features, share_of_breaks)
    ours, theirs = in_c(level, *case, weighted), in_numpy(*case, weighted)
    np.testing.assert_array_equal(bits_of(ours), bits_of(theirs))


@pytest.mark.parametrize("weighted", STEPS)
@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    rows=st.integers(1, 40),
    frames=st.integers(1, 200),
    features=st.sampled_from((1, 3, 39, 64)),
    share_of_breaks=st.sampled_from((0.0, 0.02, 0.2)),
)
def test_every_level_finds_the_starts_of_numpy(
    level, weighted, seed, rows, frames, features, share_of_breaks
):
    templates, words, breaks = made(seed, [rows], frames, features, share_of_breaks)
    ends = np.random.default_rng(seed).integers(0, frames, 30)
    case = *templates[0], words, ends, breaks[0], STEPS[weighted]
    found = []
    for kernel in (KERNEL, None):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(subsequence, "LEVEL", level)
            patch.setattr(subsequence, "compiled", lambda name, kernel=kernel: kernel)
            found.append(subsequence_starts(*case))
    np.testing.assert_array_equal(*found)


def test_starts_of_long_templates_are_found_too(level, monkeypatch):
    monkeypatch.setattr(subsequence, "LEVEL", level)
    for rows in (subsequence.MOST_TRACED, subsequence.MOST_TRACED + 1):
        (template,), words, _ = made(7, [rows], 2100, 39)
        ours, theirs = [], []
        for kernel, found in ((KERNEL, ours), (None, theirs)):
            monkeypatch.setattr(subsequence, "compiled", lambda name, kernel=kernel: kernel)
            found.append(subsequence_starts(*template, words, np.array([2099, 600, 100])))
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize(
    "changes",
    [
        {"ones": np.zeros(0, np.uint64), "care": np.zeros(0, np.uint64)},
        {"ones": np.zeros(1025, np.uint64), "care": np.zeros(1025, np.uint64)},
        {"care": np.zeros(2, np.uint64)},
        {"words": np.zeros(9, np.int64)},
        {"breaks": np.zeros(2, np.int32)},
        {"ends": np.array([3, 9])},
        {"ends": np.array([-1, 3])},
        {"ends": np.array([3, 4, 5])},
        {"starts": np.zeros(2, np.uint64)},
        {"level": "avx1024"},
    ],
    ids=str,
)
def test_wrong_arguments_for_starts_are_refused(changes):
    right = {
        "ones": np.zeros(3, np.uint64),
        "care": np.zeros(3, np.uint64),
        "words": np.zeros(9, np.uint64),
        "breaks": np.array([99, -4]),
        "weighted": True,
        "ends": np.array([3, 8]),
        "starts": np.zeros(2, np.int64),
        "level": None,
    }
    assert KERNEL.starts(*right.values()) is None
    with pytest.raises((TypeError, ValueError, BufferError)):
        KERNEL.starts(*(right | changes).values())


def test_quotients_are_rounded_as_division_rounds_them(level):
    full = (1 << 64) - 1
    words = np.array([full >> 64 - n if n else 0 for n in range(65)], dtype=np.uint64)
    for of in range(1, 65):
        care = np.array([full >> 64 - of], dtype=np.uint64)
        costs = in_c(level, [(np.zeros(1, np.uint64), care)], words[: of + 1], [None])
        expected = np.arange(of + 1, dtype=np.float32) / np.float32(of)
        np.testing.assert_array_equal(bits_of(costs[0]), bits_of(expected))


@pytest.mark.parametrize("threads", [2, 3, 5])
@pytest.mark.parametrize("in_one", [in_c, in_numpy], ids=("c", "numpy"))
def test_threads_change_no_bit(threads, in_one, monkeypatch):
    monkeypatch.setattr(subsequence, "FRAMES_A_THREAD", 100)
    monkeypatch.setattr(subsequence, "compiled", lambda name: KERNEL if in_one is in_c else None)
    templates, words, breaks = made(3, (40, 1, 300), 5000, 39, 0.001)
    expected = in_numpy(templates, words, breaks)
    costs = many_subsequence_costs(templates, words, breaks, threads=threads)
    np.testing.assert_array_equal(bits_of(costs), bits_of(expected))


def arguments(**changes):
    """What a call of the kernel needs, for two templates of three and two rows."""
    rows, frames = np.zeros(5, np.uint64), np.zeros(9, np.uint64)
    right = {
        "ones": rows,
        "care": rows,
        "bounds": np.array([0, 3, 5]),
        "words": frames,
        "breaks": np.array([4, 5, 2]),
        "break_bounds": np.array([0, 2, 3]),
        "weighted": True,
        "costs": np.zeros((2, 9), np.float32),
        "begin": 0,
        "end": 9,
        "level": None,
    }
    return tuple((right | changes).values())


def test_right_arguments_are_taken():
    assert KERNEL.match(*arguments()) is None
    no_rows, none = np.zeros(0, np.uint64), np.zeros(1, np.int64)
    empty = {"ones": no_rows, "care": no_rows, "bounds": none, "breaks": none[:0]}
    KERNEL.match(*arguments(**empty, break_bounds=none, costs=np.zeros((0, 9), np.float32)))


@pytest.mark.parametrize(
    "changes",
    [
        {"ones": np.zeros(5, np.int64)},
        {"care": np.zeros(5, np.float64)},
        {"words": np.zeros(9, np.uint32)},
        {"words": np.zeros(9, ">u8")},
        {"bounds": np.array([0, 3, 5], np.uint64)},
        {"breaks": np.array([4.0, 5.0, 2.0])},
        {"costs": np.zeros((2, 9))},
        {"costs": np.zeros((2, 9), np.int32)},
        {"ones": None},
        {"words": [0] * 9},
        {"begin": 0.5},
        {"level": 0},
    ],
    ids=str,
)
def test_arguments_of_a_wrong_type_are_refused(changes):
    with pytest.raises(TypeError):
        KERNEL.match(*arguments(**changes))


@pytest.mark.parametrize(
    "changes",
    [
        {"ones": np.zeros(4, np.uint64)},
        {"care": np.zeros(6, np.uint64)},
        {"words": np.zeros(8, np.uint64)},
        {"words": np.zeros(18, np.uint64)[::2]},
        {"costs": np.zeros((2, 8), np.float32)},
        {"costs": np.zeros((2, 18), np.float32)[:, ::2]},
        {"costs": np.zeros((3, 9), np.float32)},
        {"bounds": np.array([0, 3, 6])},
        {"bounds": np.array([0, 6, 5])},
        {"bounds": np.array([1, 3, 5])},
        {"bounds": np.array([0, 0, 5])},
        {"bounds": np.array([-1, 3, 5])},
        {"bounds": np.array([0, np.iinfo(np.int64).min, 5])},
        {"bounds": np.zeros(0, np.int64)},
        {"break_bounds": np.array([0, 3])},
        {"break_bounds": np.array([0, 2, 4])},
        {"break_bounds": np.array([0, -2, 3])},
        {"begin": -1},
        {"begin": 5, "end": 4},
        {"end": 10},
        {"end": -1},
        {"level": ""},
        {"level": "avx1024"},
    ],
    ids=str,
)
def test_arguments_that_do_not_fit_are_refused(changes):
    with pytest.raises((ValueError, BufferError)):
        KERNEL.match(*arguments(**changes))


def test_costs_that_may_not_be_written_are_refused():
    costs = np.zeros((2, 9), np.float32)
    costs.flags.writeable = False
    with pytest.raises((ValueError, BufferError)):
        KERNEL.match(*arguments(costs=costs))


@pytest.mark.parametrize("breaks", [[8, 0, -5], [99, 99, 99], [-1, 2**62, 9], [5, 5, 5]], ids=str)
def test_breaks_in_disorder_touch_nothing_outside(breaks):
    costs = np.zeros((2, 9), np.float32)
    KERNEL.match(*arguments(breaks=np.array(breaks), costs=costs))
    assert ((costs >= 0) & ((costs <= 1) | np.isinf(costs))).all()
