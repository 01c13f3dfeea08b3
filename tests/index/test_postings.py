import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mocapidx.errors import StoreError
from mocapidx.index.build import FREE_WORD
from mocapidx.index.postings import encode_index, open_index

words_of_runs = st.lists(st.sampled_from([0, 1, 5, 2**31 - 1, FREE_WORD]), max_size=60)


def everything(data, head_size, head=None):
    """Read all there is: (words, lists) of each part."""
    head = data[:head_size] if head is None else head
    lists = open_index(head, lambda at, size: data[at : at + size], len(data))
    return {
        name: (part.words.tolist(), [list(runs) for runs in part.lists(range(len(part.words)))])
        for name, part in lists.items()
    }


@settings(max_examples=100, deadline=None)
@given(words_of_runs, words_of_runs)
def test_each_run_stands_in_the_list_of_its_word_alone(upper, lower):
    drawn = {"upper": upper, "lower": lower}
    data, head = encode_index({name: np.array(w, np.uint32) for name, w in drawn.items()})
    for name, (words, lists) in everything(data, head).items():
        assert words == sorted(set(drawn[name]) - {FREE_WORD})
        assert lists == [[r for r, w in enumerate(drawn[name]) if w == word] for word in words]


def random_walk(size, seed=0):
    return np.random.default_rng(seed).integers(0, 40, size).astype(np.uint32)


def test_equal_runs_give_equal_bytes():
    parts = {"upper": random_walk(5000), "mix": random_walk(700, 1)}
    assert encode_index(parts) == encode_index({k: v.copy() for k, v in parts.items()})


def test_neighbouring_lists_are_read_at_one_go_and_only_once():
    data, head = encode_index({"upper": random_walk(3000)})
    reads = []

    def read(at, size):
        reads.append(size)
        return data[at : at + size]

    lists = open_index(data[:head], read, len(data))["upper"]
    assert not reads
    lists.lists([3, 4, 5, 7])
    assert len(reads) == 1
    lists.lists([7, 3])
    assert len(reads) == 1
    assert lists.missing(np.array([3, 7, 8])) == 1


@pytest.mark.parametrize("seed", range(4))
def test_a_changed_byte_is_a_store_error_or_changes_nothing(seed):
    rng = np.random.default_rng(seed)
    data, head = encode_index({"upper": random_walk(400), "lower": random_walk(300, 1)})
    good = everything(data, head)
    for _ in range(150):
        at = int(rng.integers(len(data)))
        changed = bytearray(data)
        changed[at] ^= 1 << int(rng.integers(8))
        try:
            found = everything(bytes(changed), head)
        except StoreError:
            continue
        # Only a name or a word of the directory can differ: the head's own digest sees to it.
        assert at < head
        assert [lists for _, lists in found.values()] == [lists for _, lists in good.values()]


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200), st.integers(0, 400), st.booleans())
def test_random_bytes_are_a_store_error(noise, at, head_too):
    data, head = encode_index({"upper": random_walk(400)})
    cut = min(at, len(data) - 1)
    mutated = data[:cut] + noise
    kept = mutated[:head] if head_too else data[:head]
    assume(mutated != data)
    with pytest.raises(StoreError):
        everything(mutated, head, kept)


@pytest.mark.parametrize("cut", [0, 5, 20, 60, -1])
def test_a_cut_off_file_is_a_store_error(cut):
    data, head = encode_index({"upper": random_walk(100)})
    with pytest.raises(StoreError):
        everything(data[:cut], head)


def test_lists_with_right_digests_must_still_fit_the_runs():
    data, head = encode_index({"upper": np.array([1, 2, 1, 2], np.uint32)})
    place = len(b"mocapidx-lists 1\n") + 12 + 16
    changed = data[:place] + (2).to_bytes(4, "little") + data[place + 4 :]
    with pytest.raises(StoreError):
        everything(changed, head)
