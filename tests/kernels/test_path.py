import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.alignment import loops
from mocapidx.alignment.loops import align_loops, byte_tables, cheapest_path, join_loops

KERNEL = pytest.importorskip("mocapidx.kernels._path", reason="the kernels weren't built")
LEVELS = KERNEL.levels()


@pytest.fixture(params=("avx512", "avx2", "ssse3", "portable"), scope="module")
def level(request):
    """One set of instructions."""
    if request.param not in LEVELS:
        pytest.skip(f"this processor has no {request.param}")
    return request.param


def made(seed, lengths, frames, features):
    rng = np.random.default_rng(seed)
    costs = rng.choice([0.0, 0.1, 1.0, 3.0], (2, sum(lengths), features))
    costs *= rng.random() < 0.5 or rng.random(costs.shape)
    words = rng.integers(0, (1 << features) - 1, frames, dtype=np.uint64, endpoint=True)
    words = words[np.sort(rng.integers(0, frames, frames))]
    return words, byte_tables(*costs), join_loops(lengths)


def with_kernel(kernel, level, function, *arguments, **options):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loops, "LEVEL", level)
        patch.setattr(loops, "compiled", lambda name: kernel)
        return function(*arguments, **options)


def assert_same_path(ours, theirs):
    for one, other in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(one, other)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    lengths=st.lists(st.integers(1, 40), min_size=1, max_size=6),
    frames=st.integers(1, 200),
    features=st.sampled_from((1, 8, 39, 64)),
    jump_price=st.sampled_from((0.0, 0.3, 7.0, np.inf)),
    unknown_price=st.sampled_from((0.0, 0.44, np.inf)),
    pointer_bytes=st.sampled_from((1, 20_000, 1 << 20)),
)
def test_every_level_takes_the_path_of_numpy(
    level, seed, lengths, frames, features, jump_price, unknown_price, pointer_bytes
):
    case = made(seed, lengths, frames, features)
    prices = {"jump_price": jump_price, "unknown_price": unknown_price}
    ours = with_kernel(KERNEL, level, cheapest_path, *case, **prices, pointer_bytes=pointer_bytes)
    assert_same_path(ours, with_kernel(None, None, cheapest_path, *case, **prices))


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    lengths=st.lists(st.integers(1, 40), min_size=1, max_size=5),
    frames=st.integers(1, 200),
)
def test_every_level_aligns_as_numpy_does(level, seed, lengths, frames):
    case = made(seed, lengths, frames, 39)
    ours = with_kernel(KERNEL, level, align_loops, *case)
    np.testing.assert_array_equal(ours, with_kernel(None, None, align_loops, *case))


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32), length=st.integers(1, 300), frames=st.integers(1, 150))
def test_every_level_has_the_sums_of_numpy(level, seed, length, frames):
    words, tables, both = made(seed, [length], frames, 39)
    walk = loops._Walk(tables, both, 0.7, 0.44)
    sums = [
        with_kernel(kernel, level, walk.forward, words, walk.start()) for kernel in (KERNEL, None)
    ]
    for name in ("first", "second"):
        ours, theirs = (getattr(each, name).view(np.uint32) for each in sums)
        np.testing.assert_array_equal(ours, theirs)
    assert sums[0].unknown == sums[1].unknown


def forward_arguments(**changes):
    """What going over six frames needs, in templates of five columns together."""
    right = {
        "words": np.zeros(6, np.uint64),
        "tables": np.zeros((2, 256, 5), np.float32),
        "before": np.array([2, 0, 1, 4, 3]),
        "two_before": np.array([2, 0, 1, 4, 3]),
        "jump_price": 1.0,
        "unknown_price": 2.0,
        "fresh": True,
        "first": np.zeros(5, np.float32),
        "second": np.zeros(5, np.float32),
        "unknown": 0.0,
        "pointers": np.zeros((6, 5), np.uint8),
        "sources": np.zeros(6, np.int64),
        "unknown_jumps": np.zeros(6, np.uint8),
        "level": None,
    }
    return tuple((right | changes).values())


def trace_arguments(**changes):
    right = {
        "pointers": np.zeros((6, 5), np.uint8),
        "sources": np.zeros(6, np.int64),
        "unknown_jumps": np.zeros(6, np.uint8),
        "before": np.array([2, 0, 1, 4, 3]),
        "two_before": np.array([2, 0, 1, 4, 3]),
        "column": 4,
        "held": False,
        "columns": np.zeros(6, np.int64),
        "jumps": np.zeros(6, np.bool_),
    }
    return tuple((right | changes).values())


def test_right_arguments_are_taken():
    assert KERNEL.forward(*forward_arguments()) == 3.0
    not_kept = np.zeros((0, 5), np.uint8)
    assert KERNEL.forward(*forward_arguments(pointers=not_kept)) == 3.0
    assert KERNEL.forward(*forward_arguments(pointers=not_kept, words=np.zeros(0, np.uint64))) == 0
    assert KERNEL.trace(*trace_arguments()) == (4, False)


WRONG = [
    {"words": np.zeros(6, np.int64)},
    {"tables": np.zeros((2, 256, 5))},
    {"tables": np.zeros((2, 255, 5), np.float32)},
    {"tables": np.zeros((9, 256, 5), np.float32)},
    {"tables": np.zeros((0, 256, 5), np.float32)},
    {"before": np.array([2, 0, 1, 4, 5])},
    {"before": np.array([-1, 0, 1, 4, 3])},
    {"before": np.zeros(0, np.int64)},
    {"two_before": np.array([2, 0, 1, 4])},
    {"first": np.zeros(4, np.float32)},
    {"first": np.zeros(10, np.float32)[::2]},
    {"second": np.zeros(6, np.float32)},
    {"pointers": np.zeros((6, 4), np.uint8)},
    {"pointers": np.zeros((5, 6), np.bool_)},
    {"sources": np.zeros(5, np.int64)},
    {"unknown_jumps": np.zeros(7, np.uint8)},
    {"level": "avx1024"},
    {"jump_price": "much"},
]


@pytest.mark.parametrize("changes", WRONG, ids=str)
def test_wrong_arguments_of_the_walk_are_refused(changes):
    with pytest.raises((TypeError, ValueError, BufferError)):
        KERNEL.forward(*forward_arguments(**changes))


@pytest.mark.parametrize(
    "changes",
    [
        {"pointers": np.zeros((5, 5), np.uint8)},
        {"pointers": np.zeros((6, 5), np.int8)},
        {"sources": np.zeros(5, np.int64)},
        {"sources": np.zeros(6, np.int32)},
        {"unknown_jumps": np.zeros(5, np.uint8)},
        {"before": np.array([2, 0, 1, 4, 9])},
        {"before": np.array([2, 0, 1, 4, -2])},
        {"before": np.zeros(0, np.int64)},
        {"two_before": np.zeros(4, np.int64)},
        {"column": 5},
        {"column": -2},
        {"column": -1, "held": True},
        {"columns": np.zeros(7, np.int64)},
        {"columns": np.zeros(6, np.int32)},
        {"jumps": np.zeros(5, np.bool_)},
        {"jumps": np.zeros(6, np.uint8)},
        {"pointers": np.full((6, 5), 4, np.uint8), "sources": np.full(6, 5)},
        {"pointers": np.full((6, 5), 4, np.uint8), "sources": np.full(6, -2)},
    ],
    ids=str,
)
def test_wrong_arguments_of_the_trace_are_refused(changes):
    with pytest.raises((TypeError, ValueError, BufferError)):
        KERNEL.trace(*trace_arguments(**changes))
