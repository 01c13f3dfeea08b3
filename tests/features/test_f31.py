"""What the features of f31 mean, on posed bodies and on real clips."""

import os
from pathlib import Path

import numpy as np
import pytest

from mocapidx.features.extract import extract_features
from mocapidx.features.featureset import load_feature_set
from mocapidx.model import Motion
from tests import naive_features as naive

ROOT = Path(__file__).parents[2]
HDM05 = Path(os.environ.get("MOCAP_DATA", ROOT.parent / "shared" / "data")) / "hdm05"
F31 = load_feature_set("f31")
LEFT_HALF = {
    "lhip": (0.1, 0.9, 0), "lknee": (0.11, 0.5, 0.01), "lankle": (0.12, 0.1, 0),
    "ltoes": (0.13, 0.02, 0.16), "lclavicle": (0, 1.42, 0), "lshoulder": (0.2, 1.4, 0),
    "lelbow": (0.27, 1.13, 0), "lwrist": (0.33, 0.88, 0.02), "lfingers": (0.35, 0.72, 0.03),
}  # fmt: skip
MIDDLE = {
    "root": (0, 0.95, 0), "belly": (0, 1.08, 0), "chest": (0, 1.22, 0), "neck": (0, 1.42, 0),
    "head": (0, 1.52, 0.02), "headtop": (0, 1.72, 0.03),
}  # fmt: skip
STANDING = MIDDLE | LEFT_HALF | naive.mirror_pose(LEFT_HALF)

# Poses that differ from standing, and the features that this changes.
POSES = {
    "right hand stretched forwards": (
        {"relbow": (-0.2, 1.38, 0.28), "rwrist": (-0.2, 1.36, 0.53)},
        {"U1"},
    ),
    "right hand above the head": (
        {"relbow": (-0.25, 1.66, 0.05), "rwrist": (-0.25, 1.9, 0.05)},
        {"U3"},
    ),
    "right arm out to the side": (
        {"relbow": (-0.48, 1.35, 0), "rwrist": (-0.73, 1.3, 0)},
        {"U5"},
    ),
    "right hand on the head": (
        {"relbow": (-0.42, 1.5, 0.05), "rwrist": (-0.2, 1.6, 0.08)},
        {"U3", "U7", "M3"},
    ),
    "clapping above the head": (
        {
            **{"relbow": (-0.2, 1.68, 0.05), "rwrist": (-0.06, 1.88, 0.08)},
            **{"lelbow": (0.2, 1.68, 0.05), "lwrist": (0.06, 1.88, 0.08)},
        },
        {"U3", "U4", "U12"},
    ),
    "arms crossed before the chest": (
        {
            **{"relbow": (-0.22, 1.15, 0.12), "rwrist": (0.12, 1.2, 0.2)},
            **{"lelbow": (0.22, 1.15, 0.12), "lwrist": (-0.12, 1.22, 0.24)},
        },
        {"U7", "U8", "U11"},
    ),
    "right hand on the hip": (
        {"relbow": (-0.42, 1.22, -0.05), "rwrist": (-0.2, 0.98, 0.02)},
        {"U7", "M5"},
    ),
    "right knee raised": (
        {"rknee": (-0.11, 0.85, 0.4), "rankle": (-0.12, 0.45, 0.42), "rtoes": (-0.12, 0.4, 0.56)},
        {"L2", "L3", "L7"},
    ),
    "right hand on the raised right knee": (
        {
            **{"rknee": (-0.11, 0.85, 0.4), "rankle": (-0.12, 0.45, 0.42)},
            **{"rtoes": (-0.12, 0.4, 0.56), "relbow": (-0.2, 1.15, 0.12)},
            "rwrist": (-0.16, 0.93, 0.24),
        },
        {"L2", "L3", "L7", "M1"},
    ),
    "right leg out to the side": (
        {"rknee": (-0.3, 0.54, 0.01), "rankle": (-0.5, 0.2, 0), "rtoes": (-0.52, 0.12, 0.16)},
        {"L9"},
    ),
    "right leg far behind": (
        {"rknee": (-0.11, 0.52, -0.15), "rankle": (-0.12, 0.2, -0.4), "rtoes": (-0.12, 0.05, -0.3)},
        {"L1"},
    ),
    "legs crossed": (
        {"rankle": (0.2, 0.1, 0.1), "rtoes": (0.21, 0.02, 0.26), "rknee": (0.0, 0.5, 0.12)},
        {"L11"},
    ),
    "bent forwards": (
        {
            **{"belly": (0, 1.0, 0.12), "chest": (0, 1.03, 0.26), "neck": (0, 1.05, 0.46)},
            **{"head": (0, 1.04, 0.56), "headtop": (0, 1.02, 0.76)},
            **{"lclavicle": (0, 1.05, 0.46), "rclavicle": (0, 1.05, 0.46)},
            **{"lshoulder": (0.2, 1.03, 0.44), "rshoulder": (-0.2, 1.03, 0.44)},
            **{"lelbow": (0.22, 0.95, 0.18), "relbow": (-0.22, 0.95, 0.18)},
            **{"lwrist": (0.4, 0.95, 0), "rwrist": (-0.4, 0.95, 0)},
        },
        {"M7"},
    ),
}  # fmt: skip


def features_on(positions):
    motion = Motion(tuple(naive.JOINTS), positions, 30.0, posed({})[0])
    return {key for key, on in zip(F31.ids, extract_features(motion, F31)[-1], strict=True) if on}


def posed(moves, frames=1):
    body = STANDING | moves
    return np.array([[body[joint] for joint in naive.JOINTS]] * frames, dtype=float)


def test_the_set_has_the_papers_31_features():
    sizes = [F31.part_mask(part).bit_count() for part in ("lower", "upper", "mix")]
    assert sizes == [11, 12, 8]


def test_both_feet_of_a_standing_body_are_in_front():
    assert features_on(posed({})) == {"L1", "L2"}


@pytest.mark.parametrize("pose", POSES)
def test_a_pose_changes_the_features_that_name_it_and_no_others(pose):
    moves, expected = POSES[pose]
    found = features_on(posed(moves))
    assert found ^ {"L1", "L2"} == expected
    partner = {feature.id: feature.mirror for feature in F31.features}
    mirrored = features_on(naive.mirror_motion(posed(moves)))
    assert mirrored == {partner[key] for key in found}


@pytest.mark.parametrize(
    ("joints", "expected"),
    [
        (("rwrist",), {"U9"}),
        (("rankle",), set()),
        (("rankle", "rtoes"), {"L5"}),
        (("root",), {"M8"}),
    ],
)
def test_what_moves_at_a_metre_a_second_is_fast(joints, expected):
    positions = posed({}, frames=3)
    for joint in joints:
        positions[:, naive.JOINTS.index(joint), 2] += np.arange(3) / 30
    assert features_on(positions) - {"L1", "L2"} == expected


@pytest.mark.skipif(not HDM05.is_dir(), reason="no real clips; set MOCAP_DATA to their folder")
@pytest.mark.parametrize(
    ("clips", "begin", "end", "on", "off"),
    [
        ("squat1Reps", 0.4, 0.6, ("L7", "L8"), ("L3", "L4", "L11")),
        ("kickLFront1Reps", 0.45, 0.6, ("L4", "L6"), ("L3", "L7")),
        ("grabHighR", 0.4, 0.6, ("U1", "U3"), ("U2", "U4", "U12")),
        ("elbowToKnee1RepsLelbowStart", 0.4, 0.6, ("L3", "L7", "U4"), ("L4", "U3")),
        ("lieDownFloor", 0.45, 0.65, ("M7",), ("U3", "U4")),
        ("depositFloorR", 0.45, 0.55, ("M7",), ("M3", "M4")),
    ],
)
def test_real_clips_have_the_features_of_their_class(clips, begin, end, on, off):
    from mocapidx.tasks.read import read_motion

    shares = []
    for path in sorted((HDM05 / clips).glob("*.amc"))[:4]:
        features = extract_features(read_motion(path), F31)
        shares.append(features[int(begin * len(features)) : int(end * len(features))].mean(axis=0))
    share = dict(zip(F31.ids, np.mean(shares, axis=0), strict=True))
    assert all(share[key] >= 0.7 for key in on), {key: share[key] for key in on}
    assert all(share[key] <= 0.3 for key in off), {key: share[key] for key in off}
