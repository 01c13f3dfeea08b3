"""Documents of few words over features with gaps between them, and queries that have hits."""

import numpy as np
from hypothesis import strategies as st

from mocapidx.queries.source import source_from_words
from mocapidx.queries.steps import FuzzyQuery, FuzzySet

BITS = (0, 1, 2, 5, 6, 40, 63)  # of the features; neighbours, gaps and the last bit there is
MASKS = {"upper": 0b111, "lower": 0b1100000, "mix": 1 << 40 | 1 << 63}
ALL = sum(1 << bit for bit in BITS)


def word_of(code):
    return sum(1 << bit for i, bit in enumerate(BITS) if code >> i & 1)


ALL_WORDS = [word_of(code) for code in range(1 << len(BITS))]


def draws_of_words(codes):
    """Documents of runs of few words, so that queries have hits."""
    run = st.tuples(codes.map(word_of), st.integers(1, 3))
    runs = st.lists(run, min_size=1, max_size=25)
    return runs.map(lambda pairs: [word for word, size in pairs for _ in range(size)])


vocabularies = st.lists(st.integers(0, 127), min_size=1, max_size=5).map(
    lambda codes: st.sampled_from(codes)
)
documents_of_few_words = vocabularies.flatmap(
    lambda codes: st.lists(draws_of_words(codes), min_size=1, max_size=4)
)
selections = st.integers(1, 127).map(word_of)
cubes = st.tuples(st.integers(1, 127), st.integers(0, 127)).map(
    lambda pair: (word_of(pair[0]), word_of(pair[0] & pair[1]))
)
fuzzy_sets = st.lists(cubes, min_size=1, max_size=4)


@st.composite
def documents_and_examples(draw):
    """Documents and a stretch of one of them."""
    documents = draw(documents_of_few_words)
    words = draw(st.sampled_from(documents))
    start = draw(st.integers(0, len(words) - 1))
    return documents, words[start : start + draw(st.integers(1, 12))]


def arrays(documents):
    return [np.array(words, np.uint64) for words in documents]


def source_of(documents, masks=MASKS):
    return source_from_words(arrays(documents), masks)


def query_of(steps):
    return FuzzyQuery(tuple(FuzzySet(tuple(step)) for step in steps), np.ones(len(steps), np.int64))


def rows(hits, source):
    """Hits in positions as (document, bounds in frames)."""
    documents = source.document_at(hits[:, 0])
    frames = hits - source.first[documents, np.newaxis]
    return [(d, *bounds) for d, bounds in zip(documents.tolist(), frames.tolist(), strict=True)]
