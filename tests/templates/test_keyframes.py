import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.features.words import pack_words
from mocapidx.templates.keyframes import (
    Keyframes,
    choose_keyframes,
    learn_keyframes,
    preselect,
)
from mocapidx.templates.match import end_padding, find_hits, match_documents
from mocapidx.templates.quantise import Quantised, quantise
from mocapidx.templates.thresholds import Clip


def laid(documents):
    """Lay documents end to end; give their words and where they begin and end."""
    lengths = [len(words) for words in documents]
    return np.concatenate(documents), np.concatenate(([0], np.cumsum(lengths)))


def random_template(rng, rows):
    care = rng.integers(0, 64, rows, dtype=np.uint64)
    ones = rng.integers(0, 64, rows, dtype=np.uint64) & care
    return Quantised(ones, care, np.bitwise_count(care).astype(np.int64))


def naive_kept(quantised, keyframes, words, padding):
    """The frames that some chain of keyframes reaches, chain by chain."""
    last, frames = len(quantised.ones) - 1, range(-padding, len(words) + padding)
    held = []
    for row in keyframes.rows:
        one, care = int(quantised.ones[row]), int(quantised.care[row])
        at = [int(words[min(max(t, 0), len(words) - 1)]) for t in frames]
        held.append(
            [
                t
                for t, word in zip(frames, at, strict=True)
                if ((word ^ one) & care).bit_count() <= keyframes.tolerance
            ]
        )
    around = [set() for _ in keyframes.rows]
    for chain in itertools.product(*held):
        gaps = zip(itertools.pairwise(keyframes.rows), itertools.pairwise(chain), strict=True)
        if all((b - a) / 2 <= u - t <= 2 * (b - a) for (a, b), (t, u) in gaps):
            for reach, row, t in zip(around, keyframes.rows, chain, strict=True):
                reach.update(range(t - 2 * row, t + 2 * (last - row) + 1))
    return sorted(set.intersection(*around) & set(range(len(words))))


@given(st.integers(0, 2**32), st.integers(1, 3), st.integers(0, 3), st.booleans())
def test_pieces_match_the_plain_version(seed, count, tolerance, padded):
    rng = np.random.default_rng(seed)
    quantised = random_template(rng, int(rng.integers(count, 7)))
    rows = sorted(rng.choice(len(quantised.ones), count, replace=False).tolist())
    keyframes = Keyframes(tuple(rows), tolerance)
    documents = [rng.integers(0, 64, n, dtype=np.uint64) for n in rng.integers(1, 25, 3)]
    pieces = preselect(quantised, keyframes, *laid(documents), padded)
    lengths = np.array([len(words) for words in documents])
    paddings = end_padding(lengths, len(quantised.ones)) if padded else np.zeros(3, dtype=int)
    for number, (words, padding) in enumerate(zip(documents, paddings.tolist(), strict=True)):
        own = pieces.documents == number
        found = [
            t
            for start, end in zip(pieces.starts[own], pieces.ends[own], strict=True)
            for t in range(start, end)
        ]
        assert found == naive_kept(quantised, keyframes, words, padding)


def test_a_tolerance_as_large_as_a_row_keeps_everything():
    rng = np.random.default_rng(1)
    documents = [rng.integers(0, 64, 30, dtype=np.uint64)]
    pieces = preselect(random_template(rng, 8), Keyframes((2, 5), 6), *laid(documents), True)
    assert (pieces.starts.tolist(), pieces.ends.tolist()) == ([0], [30])


@pytest.mark.parametrize("rows", [(), (8,), (3, 2), (2, 2), (-1,)])
def test_rows_that_are_not_the_template_s_are_refused(rows):
    rng = np.random.default_rng(1)
    words, bounds = laid([rng.integers(0, 64, 9, dtype=np.uint64)])
    with pytest.raises(ParameterError, match="from 0 to 7"):
        preselect(random_template(rng, 8), Keyframes(rows), words, bounds, True)


def test_the_rule_prefers_ones_and_decided_entries_and_keeps_apart():
    matrix = np.full((20, 6), 0.5)
    matrix[3:6], matrix[15:17, :5], matrix[10] = 1.0, 1.0, 0.0
    keyframes = choose_keyframes(quantise(matrix, 0.1))
    assert keyframes.rows == (4, 16)
    assert len(choose_keyframes(quantise(matrix[:1], 0.1)).rows) == 1


STEPS = np.kron(np.eye(6), np.ones((1, 3)))  # three features at a time, one time after the other


def gesture(rng, flaw=False):
    """The steps at some speed; with a flaw the third one never comes."""
    bits = np.repeat(STEPS, rng.integers(2, 5, 6), axis=0).astype(bool)
    if flaw:
        bits[:, 6:9] = False
    return pack_words(bits)


def test_learned_keyframes_keep_the_examples_and_cut_the_rest():
    rng = np.random.default_rng(3)
    own = quantise(np.repeat(STEPS, 3, axis=0), 0.1)
    examples = [Clip(gesture(rng)) for _ in range(6)]
    flawed = [Clip(gesture(rng, flaw=True)) for _ in range(6)]
    keyframes = learn_keyframes(own, [(own, examples[:3]), (own, examples[3:])], flawed)
    assert keyframes is not None
    assert keyframes.tolerance < 3
    assert any(row in range(6, 9) for row in keyframes.rows)  # where the flaw shows
    words, bounds = laid([clip.words for clip in examples + flawed])
    kept = set(preselect(own, keyframes, words, bounds, True).documents.tolist())
    assert kept == set(range(6))


def test_nothing_to_judge_by_gives_no_keyframes():
    own = quantise(STEPS, 0.1)
    clip = Clip(gesture(np.random.default_rng(0)))
    assert learn_keyframes(own, [], [clip]) is None
    assert learn_keyframes(own, [(own, [clip])], []) is None


def test_untrusted_features_lose_no_example():
    rng = np.random.default_rng(5)
    own = quantise(np.repeat(STEPS, 3, axis=0), 0.1)
    lost = [Clip(gesture(rng, flaw=True), untrusted=0x1C0) for _ in range(4)]
    keyframes = learn_keyframes(own, [(own, lost)], [Clip(np.zeros(30, dtype=np.uint64))])
    assert keyframes is not None
    words, bounds = laid([clip.words for clip in lost])
    kept = preselect(own.without(0x1C0), keyframes, words, bounds, True).documents
    assert set(kept.tolist()) == set(range(4))


def test_matching_the_pieces_finds_the_hits_that_keyframes_keep():
    rng = np.random.default_rng(7)
    own = quantise(np.repeat(STEPS, 3, axis=0), 0.1)
    zeros = np.zeros(60, dtype=np.uint64)
    take = np.concatenate([part for _ in range(4) for part in (zeros, gesture(rng))])
    full = find_hits(match_documents(own, take, np.array([0, len(take)])), 0.06)
    pieces = preselect(own, Keyframes((4, 13), 0), *laid([take]), True)
    assert (pieces.ends - pieces.starts).sum() < len(take) / 1.5
    words = [take[a:b] for a, b in zip(pieces.starts, pieces.ends, strict=True)]
    bounds = np.concatenate(([0], np.cumsum([len(each) for each in words])))
    padded = (pieces.starts == 0, pieces.ends == len(take))
    hits = find_hits(match_documents(own, np.concatenate(words), bounds, padded=padded), 0.06)
    ends = sorted((pieces.starts[hits.documents] + hits.ends).tolist())
    assert ends == sorted(full.ends.tolist())
