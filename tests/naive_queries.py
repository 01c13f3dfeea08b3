"""Queries from their definitions, frame by frame and word by word: slow and obvious."""

from itertools import groupby, pairwise, product


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


def mismatch_hits(steps, mask, documents, mismatches, may_fail):
    """Windows of segments on the selected features, all but some of which agree."""
    hits = []
    for d, words in enumerate(documents):
        found = segments(words, mask)
        for k in range(len(found) - len(steps) + 1):
            window = found[k : k + len(steps)]
            wrong = [
                i
                for i, ((word, _, _), step) in enumerate(zip(window, steps, strict=True))
                if not in_set(word, step)
            ]
            if len(wrong) <= mismatches and all(may_fail[i] for i in wrong):
                hits.append((d, *(start for _, start, _ in window), window[-1][2]))
    return hits


def lasting(hits, bounds):
    """Hits of a block all of whose steps last between a least and a greatest number of frames."""
    return [
        hit
        for hit in hits
        if all(
            low <= end - start <= high
            for (start, end), (low, high) in zip(pairwise(hit[1:]), bounds, strict=True)
        )
    ]


def pattern_hits(blocks, gaps):
    """Chains of hits of blocks: for each first one, every next one is the earliest that can go on.

    `blocks` are lists of hits (document, *bounds), `gaps` the least and greatest numbers of frames
    between the end of one and the start of the next.
    """

    def completion(hit, number):
        if number == len(blocks):
            return ()
        low, high = gaps[number - 1]
        for following in sorted(blocks[number]):
            between = following[1] - hit[-1]
            if following[0] == hit[0] and low <= between <= high:
                rest = completion(following, number + 1)
                if rest is not None:
                    return following[1:] + rest
        return None

    found = [(hit, completion(hit, 1)) for hit in blocks[0]]
    return sorted(hit + rest for hit, rest in found if rest is not None)


def holds(one, relation, other, within, others):
    """Whether two stretches (document, start, end) meet a condition; `others` are all there are."""
    if one[0] != other[0]:
        return False
    gap = max(other[1] - one[2], one[1] - other[2])
    if relation == "overlaps":
        return gap < 0
    if relation == "during":
        return other[1] <= one[1] and one[2] <= other[2]
    if relation == "near":
        return gap <= within
    if other[1] < one[2]:
        return False
    if within is not None:
        return other[1] - one[2] <= within
    return not any(x[0] == one[0] and one[2] <= x[1] < other[1] for x in others)


def scene_hits(tables, conditions):
    """All pairs and more: every combination of hits that meets all conditions.

    `tables` are lists of hits, each a list of stretches; a condition is (progression, stretch,
    relation, progression, stretch, within).
    """
    found = []
    for rows in product(*(range(len(table)) for table in tables)):
        if all(
            holds(
                tables[p][rows[p]][s],
                relation,
                tables[q][rows[q]][t],
                within,
                [] if p == q else [hit[t] for hit in tables[q]],
            )
            for p, s, relation, q, t, within in conditions
        ):
            found.append(rows)
    return found


def warping_cost(distances):
    """The least sum of a path through a matrix, cell by cell."""
    totals = {}
    for k, row in enumerate(distances):
        for j, distance in enumerate(row):
            before = [totals[at] for at in ((k - 1, j - 1), (k - 1, j), (k, j - 1)) if at in totals]
            totals[k, j] = distance + (min(before) if before else 0)
    return totals[len(distances) - 1, len(distances[0]) - 1]
