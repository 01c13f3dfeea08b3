"""Slow, plain versions of the distance of poses and of time warping inside a region."""

import math


def pose_distance(one, other, angles=20_000):
    """Root mean square distance of joints after the best shift and turn, by trying many turns."""
    count = len(one)
    centres = [[sum(p[axis] for p in pose) / count for axis in (0, 2)] for pose in (one, other)]
    best = math.inf
    for n in range(angles):
        c, s = math.cos(2 * math.pi * n / angles), math.sin(2 * math.pi * n / angles)
        total = 0.0
        for p, q in zip(one, other, strict=True):
            x, z = p[0] - centres[0][0], p[2] - centres[0][1]
            u, w = q[0] - centres[1][0], q[2] - centres[1][1]
            total += (x - (c * u - s * w)) ** 2 + (z - (s * u + c * w)) ** 2 + (p[1] - q[1]) ** 2
        best = min(best, total)
    return math.sqrt(best / count)


def warp(costs, allowed):
    """Cost and path of DTW through the allowed cells; ties: diagonal, row, column."""
    rows, columns = len(costs), len(costs[0])
    best = {}
    for k in range(rows):
        for column in range(columns):
            if not allowed(k, column):
                continue
            before = [
                best[cell]
                for cell in ((k - 1, column - 1), (k - 1, column), (k, column - 1))
                if cell in best
            ]
            if before or (k, column) == (0, 0):
                best[k, column] = costs[k][column] + min(before, default=0)
    path = [(rows - 1, columns - 1)]
    while path[-1] != (0, 0):
        k, column = path[-1]
        cells = [(k - 1, column - 1), (k - 1, column), (k, column - 1)]
        path.append(min((c for c in cells if c in best), key=lambda c: best[c]))
    return best[rows - 1, columns - 1], path[::-1]


def in_widened_segments(bounds, other_bounds, margin):
    """Tell whether a cell is at most `margin` frames from a matched segment."""
    segments = list(zip(bounds[:-1], bounds[1:], other_bounds[:-1], other_bounds[1:], strict=True))

    def allowed(k, column):
        return any(
            top - margin <= k < bottom + margin and left - margin <= column < right + margin
            for top, bottom, left, right in segments
        )

    return allowed
