"""Slow, plain versions of what blends are made of, written from the papers."""

import itertools
import math


def slope_limited_total(costs, steepest):
    """Least total cost of a path by trying every path, cell by cell."""
    rows, columns = len(costs), len(costs[0])
    best = math.inf
    waiting = [((0, 0), costs[0][0], (0, 0))]  # cell, total, run length in its row and column
    while waiting:
        (row, column), total, (across, down) = waiting.pop()
        if (row, column) == (rows - 1, columns - 1):
            best = min(best, total)
            continue
        for step in ((1, 1), (1, 0), (0, 1)):
            cell = (row + step[0], column + step[1])
            runs = (across + 1 if step == (0, 1) else 0, down + 1 if step == (1, 0) else 0)
            if cell[0] < rows and cell[1] < columns and max(runs) < steepest:
                waiting.append((cell, total + costs[cell[0]][cell[1]], runs))
    return best


def interpolate(points, weights, target, count):
    """Equations 2 and 3, one number at a time."""
    order = sorted(range(len(points)), key=lambda i: math.dist(points[i], target))[:count]
    distances = [math.dist(points[i], target) for i in order]
    alphas = [1 / d - 1 / distances[-1] for d in distances]
    total = sum(alphas)
    return [
        sum(a / total * weights[i][e] for a, i in zip(alphas, order, strict=True))
        for e in range(len(weights[0]))
    ]


def corners(count, extrapolation):
    """Extreme points of the valid weights: all but one at a bound, the last one within."""
    low, high = -extrapolation, 1 + extrapolation
    found = set()
    for place in range(count):
        for bounds in itertools.product((low, high), repeat=count - 1):
            rest = 1 - sum(bounds)
            if low - 1e-9 <= rest <= high + 1e-9:
                corner = [*bounds[:place], rest, *bounds[place:]]
                found.add(tuple(round(value, 6) + 0.0 for value in corner))
    return found
