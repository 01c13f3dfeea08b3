"""The 39 features one frame and one joint at a time, straight from the formulas.

Slow and obvious: right versions are computed on the pose, left versions by the same code on the
mirrored pose. Shares nothing with the library.
"""

import math

import numpy as np

LEGS = ["root", "lhip", "lknee", "lankle", "ltoes", "rhip", "rknee", "rankle", "rtoes"]
TRUNK = ["belly", "chest", "neck", "head", "headtop"]
LEFT_ARM = ["lclavicle", "lshoulder", "lelbow", "lwrist", "lfingers"]
RIGHT_ARM = ["rclavicle", "rshoulder", "relbow", "rwrist", "rfingers"]
JOINTS = LEGS + TRUNK + LEFT_ARM + RIGHT_ARM


def sub(a, b):
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def length(a):
    return math.sqrt(dot(a, a))


def unit(a):
    return [x / length(a) for x in a]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def angle(a, b):
    return math.degrees(math.acos(max(-1.0, min(1.0, dot(unit(a), unit(b))))))


def other_side(joint):
    if joint == "root" or joint[0] not in "lr":
        return joint
    return ("r" if joint[0] == "l" else "l") + joint[1:]


def mirror_pose(vectors):
    return {other_side(j): [-v[0], v[1], v[2]] for j, v in vectors.items()}


def mirror_motion(positions, joints=JOINTS):
    """Exchange left and right joints and negate x; shape (T, J, 3) as `joints` has them."""
    order = [list(joints).index(other_side(joint)) for joint in joints]
    return positions[:, order] * np.array([-1.0, 1.0, 1.0])


def body_units(motion):
    def distance(points, a, b):
        return length(sub(points[motion.joints.index(a)], points[motion.joints.index(b)]))

    def measure(a, b):
        if motion.rest is not None:
            return distance(motion.rest, a, b)
        return float(np.median([distance(pose, a, b) for pose in motion.positions]))

    hl = (measure("lshoulder", "lelbow") + measure("rshoulder", "relbow")) / 2
    return {"hl": hl, "sw": measure("lshoulder", "rshoulder"), "hw": measure("lhip", "rhip")}


def frame_vectors(motion, t):
    """Positions and velocities of one frame as dictionaries by joint."""
    last = len(motion.positions) - 1
    before, after = max(t - 1, 0), min(t + 1, last)
    p, v = {}, {}
    for j, joint in enumerate(motion.joints):
        p[joint] = [float(x) for x in motion.positions[t, j]]
        step = sub(motion.positions[after, j], motion.positions[before, j])
        v[joint] = [float(x) * motion.rate / max(after - before, 1) for x in step]
    return p, v


def right_values(p, v, hl, sw, hw):
    """The values of the features with right joints, by number; F25 has two."""
    out = {}
    n = cross(sub(p["rhip"], p["neck"]), sub(p["lhip"], p["neck"]))
    out[1] = dot(sub(v["rwrist"], v["neck"]), unit(n)) / hl
    out[3] = dot(sub(p["rwrist"], p["neck"]), unit(sub(p["neck"], p["chest"]))) / hl
    out[5] = dot(sub(v["rwrist"], v["chest"]), unit(sub(p["chest"], p["belly"]))) / hl
    out[7] = angle(sub(p["rshoulder"], p["relbow"]), sub(p["rwrist"], p["relbow"]))
    across = unit(sub(p["rshoulder"], p["lshoulder"]))
    out[9] = dot(sub(p["rwrist"], p["lwrist"]), across) / sw
    out[10] = dot(sub(v["lwrist"], v["rwrist"]), unit(sub(p["rwrist"], p["lwrist"]))) / hl
    out[11] = dot(sub(v["root"], v["rwrist"]), unit(sub(p["root"], p["rwrist"]))) / hl
    out[13] = length(v["rwrist"]) / hl
    n = cross(sub(p["lhip"], p["root"]), sub(p["ltoes"], p["root"]))
    out[15] = dot(sub(p["rankle"], p["root"]), unit(n)) / hl
    out[17] = (p["rankle"][1] - min(p[j][1] for j in JOINTS if j in p and j != "rankle")) / hl
    out[19] = dot(sub(p["rankle"], p["lankle"]), unit(sub(p["rhip"], p["lhip"]))) / hw
    out[20] = angle(sub(p["rhip"], p["rknee"]), sub(p["rankle"], p["rknee"]))
    h = unit(sub(p["lhip"], p["rhip"]))
    out[22] = dot(sub(p["rankle"], p["lankle"]), h) / hw
    w = unit(sub(p["lankle"], p["rankle"]))
    out[23] = dot(sub(v["rankle"], v["lankle"]), w) * abs(dot(w, h)) / hl
    out[24] = -out[23]
    out[25] = (length(v["rankle"]) / hl, length(v["rtoes"]) / hl)
    spine = sub(p["root"], p["neck"])
    out[27] = angle(spine, sub(p["relbow"], p["rshoulder"]))
    out[29] = angle(spine, sub(p["rknee"], p["rhip"]))
    n = cross(sub(p["neck"], p["rankle"]), sub(p["lankle"], p["rankle"]))
    out[31] = dot(sub(p["root"], p["rankle"]), unit(n)) / hl
    out[32] = angle(spine, [0, 1, 0])
    out[33] = -(p["rwrist"][1] - min(p[j][1] for j in JOINTS if j in p and j != "rwrist")) / hl
    n = cross(sub(p["rhip"], p["neck"]), sub(p["lhip"], p["neck"]))
    out[35] = dot(sub(p["lshoulder"], p["rshoulder"]), unit(n)) / sw
    heights = [p[j][1] for j in JOINTS if j in p]
    out[37] = (max(heights) - min(heights)) / hl
    out[38] = (
        max(math.hypot(p[a][0] - p[b][0], p[a][2] - p[b][2]) for a in JOINTS for b in JOINTS) / hl
    )
    out[39] = length(v["root"]) / hl
    return out


LEFT_OF = {k + 1: k for k in (1, 3, 5, 7, 11, 13, 15, 17, 20, 25, 27, 29, 33, 35)}

# Strong and weak test of each right version.
TESTS = {
    1: (lambda x: x > 1.8, lambda x: x > 1.3),
    3: (lambda x: x > 0.2, lambda x: x > 0),
    5: (lambda x: x > 1.8, lambda x: x > 1.3),
    7: (lambda x: x <= 110, lambda x: x <= 120),
    9: (lambda x: x > 2.5, lambda x: x > 2),
    10: (lambda x: x > 1.4, lambda x: x > 1.2),
    11: (lambda x: x > 1.4, lambda x: x > 1.2),
    13: (lambda x: x > 2.5, lambda x: x > 2),
    15: (lambda x: x > 0.38, lambda x: x > 0),
    17: (lambda x: x > 1.2, lambda x: x > 1),
    19: (lambda x: x > 2.1, lambda x: x > 1.8),
    20: (lambda x: x <= 110, lambda x: x <= 120),
    22: (lambda x: x > 0.2, lambda x: x > 0),
    23: (lambda x: x > 1.4, lambda x: x > 1.2),
    24: (lambda x: x > 1.4, lambda x: x > 1.2),
    27: (lambda x: x >= 25, lambda x: x >= 20),
    29: (lambda x: x >= 50, lambda x: x >= 45),
    31: (lambda x: x > 0.5, lambda x: x > 0.35),
    32: (lambda x: 70 <= x <= 110, lambda x: 60 <= x <= 120),
    33: (lambda x: x > -1.2, lambda x: x > -1.4),
    35: (lambda x: x > 0.25, lambda x: x > 0.15),
    37: (lambda x: x < 3.0, lambda x: x < 3.4),
    38: (lambda x: x > 4.2, lambda x: x > 3.8),
    39: (lambda x: x > 2.3, lambda x: x > 2),
}
FAST = (lambda x: x > 2.5, lambda x: x > 2)


def hysteresis(values, tests):
    """One value a frame to one bit a frame, as the robust threshold is defined."""
    strong, weak = tests
    bits, state = [], 0
    for value in values:
        if strong(value):
            state = 1
        elif not weak(value):
            state = 0
        bits.append(state)
    return bits


def f39_values(motion):
    """The values of all 39 features, one dictionary a frame."""
    units = body_units(motion)
    frames = []
    for t in range(len(motion.positions)):
        p, v = frame_vectors(motion, t)
        right = right_values(p, v, **units)
        left = right_values(mirror_pose(p), mirror_pose(v), **units)
        frames.append({k: left[LEFT_OF[k]] if k in LEFT_OF else right[k] for k in range(1, 40)})
    return frames


def f39(motion):
    """The 39 features of a motion that is at its final rate, bool (T, 39)."""
    frames = f39_values(motion)
    columns = []
    for k in range(1, 40):
        values = [frame[k] for frame in frames]
        if LEFT_OF.get(k, k) == 25:
            ankle = hysteresis([value[0] for value in values], FAST)
            toes = hysteresis([value[1] for value in values], FAST)
            columns.append([a and b for a, b in zip(ankle, toes, strict=True)])
        else:
            columns.append(hysteresis(values, TESTS[LEFT_OF.get(k, k)]))
    return np.array(columns, dtype=bool).reshape(39, -1).T
