"""Jumps and exchanged sides are found, quick motion is none."""

import numpy as np

from mocapidx.skeleton.joints import INDEX
from mocapidx.skeleton.plausibility import exchanges, jumps


def swing(frames=120, rate=120.0, speed=8.0):
    """Hands and feet that go to and fro with up to `speed` m/s, left apart from right."""
    times = np.arange(frames) / rate
    poses = np.zeros((frames, 24, 3))
    poses[..., 0] = speed / 12 * np.sin(12 * times)[:, None]
    poses[:, [i for j, i in INDEX.items() if j[0] == "l"], 2] = 0.4
    return poses


def test_quick_motion_is_no_jump():
    for rate in (30.0, 120.0):
        assert not len(jumps(swing(rate=rate), rate))
    assert not len(exchanges(swing()))


def test_a_spike_and_a_shift_are_jumps():
    poses = swing()
    poses[50, INDEX["lwrist"]] += 0.5
    poses[80:, INDEX["head"]] += 0.3
    found = [tuple(row) for row in jumps(poses, 120.0).tolist()]
    assert found == [(50, INDEX["lwrist"]), (51, INDEX["lwrist"]), (80, INDEX["head"])]


def test_sides_that_change_places_are_told_by_frame_and_joint():
    poses = swing()
    knees = [INDEX["lknee"], INDEX["rknee"]]
    poses[40:60, knees] = poses[40:60, knees[::-1]]
    assert exchanges(poses).tolist() == [[40, INDEX["lknee"]], [60, INDEX["lknee"]]]


def test_what_is_not_known_neither_jumps_nor_changes():
    poses = swing()
    poses[30:50, INDEX["lwrist"]] = np.nan
    poses[:, INDEX["ltoes"]] = np.nan
    assert not len(jumps(poses, 120.0))
    assert not len(exchanges(poses))
    assert not len(jumps(poses[:1], 120.0))
