"""Slow, plain versions of the alignments, written from the papers, cell by cell."""

import math
from fractions import Fraction


def dtw(reference, other):
    """Cost and path of classical DTW with exact fractions; ties: diagonal, reference, other."""
    best = {}
    for k, x in enumerate(reference):
        for column, y in enumerate(other):
            cost = sum(abs(Fraction(a) - Fraction(b)) for a, b in zip(x, y, strict=True))
            before = [
                best[cell][0]
                for cell in ((k - 1, column - 1), (k - 1, column), (k, column - 1))
                if cell in best
            ]
            best[k, column] = (cost + min(before, default=0), cost)
    path = [(len(reference) - 1, len(other) - 1)]
    while path[-1] != (0, 0):
        k, column = path[-1]
        cells = [(k - 1, column - 1), (k - 1, column), (k, column - 1)]
        path.append(min((c for c in cells if c in best), key=lambda c: best[c][0]))
    return best[len(reference) - 1, len(other) - 1][0], path[::-1]


def warp(matrix, weights, path):
    """Warp along a path: a frame matched n times gives 1/n of its weight to each."""
    rows = path[-1][0] + 1
    features = len(matrix[0])
    new_weights = [Fraction(0)] * rows
    sums = [[Fraction(0)] * features for _ in range(rows)]
    for k, column in path:
        matched = sum(1 for _, c in path if c == column)
        share = Fraction(weights[column]) / matched
        new_weights[k] += share
        for i in range(features):
            sums[k][i] += share * Fraction(matrix[column][i])
    return [[s / w for s in row] for row, w in zip(sums, new_weights, strict=True)], new_weights


def unwarp(matrix, weights):
    """Integrate a piecewise constant sequence over bins of one frame."""
    total = sum(weights)
    bounds = [sum(weights[:k]) for k in range(len(weights) + 1)]
    rows, lengths = [], []
    for begin in range(math.ceil(total)):
        end = min(begin + 1, total)
        parts = [
            max(Fraction(0), min(end, bounds[k + 1]) - max(begin, bounds[k]))
            for k in range(len(weights))
        ]
        rows.append(
            [
                sum(p * Fraction(row[i]) for p, row in zip(parts, matrix, strict=True))
                / (end - begin)
                for i in range(len(matrix[0]))
            ]
        )
        lengths.append(end - begin)
    return rows, lengths


def subsequence(cost, charge):
    """Delta and the whole matrix of subsequence DTW, steps (1,1), (2,1), (1,2).

    `charge` is the number of times that the step (2,1) pays for the cell it ends in.
    """
    rows, columns = len(cost), len(cost[0])
    total = [[math.inf] * columns for _ in range(rows)]
    for k in range(rows):
        for column in range(columns):
            if k == 0:
                total[k][column] = cost[k][column]
                continue
            for up, left, times in ((1, 1, 1), (2, 1, charge), (1, 2, 1)):
                if k >= up and column >= left:
                    total[k][column] = min(
                        total[k][column], total[k - up][column - left] + times * cost[k][column]
                    )
    return [value / rows for value in total[-1]], total


def path_cost(cost, start, end, charge):
    """Lowest cost of a path from the first row at `start` to the last row at `end`."""
    window = [row[start : end + 1] for row in cost]
    for column in range(1, len(window[0])):
        window[0][column] = math.inf
    return subsequence(window, charge)[0][-1]
