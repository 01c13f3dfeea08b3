"""Queries from their definitions, frame by frame and word by word: slow and obvious."""

from itertools import groupby, pairwise


def in_set(word, cubes):
    return any(word & mask == value for mask, value in cubes)


def joined(steps, lengths, all_words):
    """Conjoin adjacent sets while any two share a word; tries every word there is."""
    steps, lengths = [tuple(step) for step in steps], list(lengths)
    while True:
        for i, (one, other) in enumerate(pairwise(steps)):
            if any(in_set(word, one) and in_set(word, other) for word in all_words):
                steps[i : i + 2] = [one + other]
                lengths[i : i + 2] = [lengths[i] + lengths[i + 1]]
                break
        else:
            return steps, lengths


def segments(words, mask):
    """Every segment of a document with respect to some features: (word, first, end)."""
    at, found = 0, []
    for word, frames in groupby(words, key=lambda word: word & mask):
        size = len(list(frames))
        found.append((word, at, at + size))
        at += size
    return found


def exact_hits(values, mask, documents):
    """Equation 4 on the selected features: (document, bounds)."""
    hits = []
    for d, words in enumerate(documents):
        found = segments(words, mask)
        for k in range(len(found) - len(values) + 1):
            window = found[k : k + len(values)]
            if [word for word, _, _ in window] == list(values):
                hits.append((d, *(start for _, start, _ in window), window[-1][2]))
    return hits


def fuzzy_hits(steps, segment_mask, documents):
    """Equation 9; the documents are cut by all features of `segment_mask`."""
    hits = []
    for d, words in enumerate(documents):
        found = segments(words, segment_mask)
        for k in range(len(found) - len(steps) + 1):
            window = found[k : k + len(steps)]
            if all(in_set(word, step) for (word, _, _), step in zip(window, steps, strict=True)):
                hits.append((d, *(start for _, start, _ in window), window[-1][2]))
    return hits


def adaptive_hits(steps, documents):
    """Section 5.2, walked frame by frame; steps are disjoint from their neighbours."""
    hits = []
    for d, words in enumerate(documents):
        for start in range(len(words)):
            if start and in_set(words[start - 1], steps[0]):
                continue
            bounds = [start]
            for step in steps:
                end = bounds[-1]
                while end < len(words) and in_set(words[end], step):
                    end += 1
                if end == bounds[-1]:
                    break
                bounds.append(end)
            else:
                hits.append((d, *bounds))
    return hits
