"""Slow, plain subsequence warping with a weight for every entry, cell by cell."""

import math


def local_cost(ones, weights, frame):
    """Sum of the weights of the features in which a row and a frame disagree."""
    return sum(w for q, w, y in zip(ones, weights, frame, strict=True) if bool(q) != bool(y))


def matches(ones, weights, frames):
    """For each last frame: the lowest cost and the latest start of a match with that cost."""
    total = [[(math.inf, 0)] * len(frames) for _ in ones]
    for k, (row, weight) in enumerate(zip(ones, weights, strict=True)):
        for column, frame in enumerate(frames):
            cost = local_cost(row, weight, frame)
            if k == 0:
                total[k][column] = (cost, -column)
                continue
            before = [
                (total[k - up][column - left][0] + paid, total[k - up][column - left][1])
                for up, left, paid in ((1, 1, cost), (2, 1, 2 * cost + 1), (1, 2, cost + 1))
                if k >= up and column >= left
            ]
            total[k][column] = min(before, default=(math.inf, 0))
    return [(c, -s if math.isfinite(c) else -1) for c, s in total[-1]]
