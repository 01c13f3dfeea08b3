"""Forward kinematics as the formats describe it: one frame, one joint, one matrix at a time."""

import math


def turn(axis, angle):
    c, s = math.cos(angle), math.sin(angle)
    return {
        0: [[1, 0, 0], [0, c, -s], [0, s, c]],
        1: [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        2: [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }[axis]


def product(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def transposed(a):
    return [list(column) for column in zip(*a, strict=True)]


def applied(a, v):
    return [sum(a[i][k] * v[k] for k in range(3)) for i in range(3)]


def node_positions(recording, positions="add"):
    """Return [frame][node] points of all nodes, in file units."""
    skeleton = recording.skeleton
    frames = []
    for values in recording.values.tolist():
        points, turns = [], []
        for node, parent in enumerate(skeleton.parents.tolist()):
            offset = skeleton.offsets[node].tolist()
            local = [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]
            for column, owner in enumerate(recording.channel_nodes.tolist()):
                kind = int(recording.channel_kinds[column])
                if owner == node and kind < 3:
                    stays = offset[kind] if positions == "add" else 0.0
                    offset[kind] = stays + values[column]
                elif owner == node:
                    local = product(local, turn(kind - 3, values[column]))
            if skeleton.axes is not None:
                axes = skeleton.axes[node].tolist()
                local = product(product(axes, local), transposed(axes))
            if parent < 0:
                turns.append(local)
                points.append(offset)
                continue
            turns.append(product(turns[parent], local))
            by = turns[node if skeleton.turned_by == "own" else parent]
            moved = applied(by, offset)
            points.append([points[parent][i] + moved[i] for i in range(3)])
        frames.append(points)
    return frames
