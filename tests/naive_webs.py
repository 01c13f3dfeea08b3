"""Match webs the slow way: from the definitions, cell by cell, pair by pair."""

import math

import numpy as np


def frame_distance(first, second, i, k, reach):
    """Root mean square distance of two clouds, fitted on the floor by a search over angles."""
    offsets = range(-reach, reach + 1)
    weights = [(reach + 1 - abs(o)) / (reach + 1) ** 2 for o in offsets]
    one = [first[min(max(i + o, 0), len(first) - 1)] for o in offsets]
    other = [second[min(max(k + o, 0), len(second) - 1)] for o in offsets]
    joints = len(first[0])
    a = np.concatenate(one).astype(float)
    b = np.concatenate(other).astype(float)
    w = np.repeat(np.array(weights) / joints, joints)

    def misfit(angle):
        turned = b.copy()
        turned[:, 0] = math.cos(angle) * b[:, 0] - math.sin(angle) * b[:, 2]
        turned[:, 2] = math.sin(angle) * b[:, 0] + math.cos(angle) * b[:, 2]
        gap = a - turned
        gap[:, [0, 2]] -= w @ gap[:, [0, 2]]
        return w @ (gap**2).sum(axis=1)

    best = min(np.linspace(0, 2 * math.pi, 400, endpoint=False), key=misfit)
    width = 2 * math.pi / 400
    for _ in range(40):
        best = min((best - width, best, best + width), key=misfit)
        width /= 2
    return math.sqrt(misfit(best))


def minima(line):
    """Where a line of values is locally least; a run counts at its middle."""
    found = set()
    for start in range(len(line)):
        if start and line[start - 1] == line[start]:
            continue
        end = start
        while end + 1 < len(line) and line[end + 1] == line[start]:
            end += 1
        left = math.inf if start == 0 else line[start - 1]
        right = math.inf if end + 1 == len(line) else line[end + 1]
        if left > line[start] and right > line[start]:
            found.add((start + end) // 2)
    return found


def extended(line, place, alpha, stop_below):
    """A minimum and the cells around it that are less than a share larger."""
    found = {place}
    for step in (1, -1):
        at = place + step
        while 0 <= at < len(line) and line[at] < line[place] * (1 + alpha):
            if stop_below and line[at] < line[place]:
                break
            found.add(at)
            at += step
    return found


def minima_and_region(grid, alpha, stop_below):
    low, region = set(), set()
    for i, line in enumerate(grid):
        for j in minima(line):
            low.add((i, j))
            region |= {(i, c) for c in extended(line, j, alpha, stop_below)}
    for j, line in enumerate(zip(*grid, strict=True)):
        for i in minima(line):
            low.add((i, j))
            region |= {(r, j) for r in extended(line, i, alpha, stop_below)}
    return low, region


def least_path(grid, start, end, steepest):
    """Total and number of cells of the path with the least total between two cells.

    A path goes in steps of at most one, with at most `steepest` cells in a row or column.
    """
    best = {(*start, 1, 1): (grid[start], 1)}
    for i in range(start[0], end[0] + 1):
        for j in range(start[1], end[1] + 1):
            if (i, j) == start:
                continue
            for di, dj in ((1, 1), (1, 0), (0, 1)):
                for level in range(1, steepest + 1):
                    for upright in range(1, steepest + 1):
                        before = best.get((i - di, j - dj, level, upright))
                        runs = (1, 1) if di and dj else (1, upright + 1) if di else (level + 1, 1)
                        if before is None or max(runs) > steepest:
                            continue
                        way = before[0] + grid[i, j], before[1] + 1
                        best[i, j, *runs] = min(best.get((i, j, *runs), (math.inf, 0)), way)
    return min((way for (*cell, _, _), way in best.items() if tuple(cell) == end), default=None)
