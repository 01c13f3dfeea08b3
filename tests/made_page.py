"""Pages of made-up people, small and known to the last number."""

import dataclasses

import numpy as np

from mocapidx.features.featureset import load_feature_set
from mocapidx.reports.page.content import (
    PageContent,
    PageCurve,
    PageDocument,
    PageFeature,
    PageHit,
    PagePiece,
    PageReference,
)
from mocapidx.skeleton.joints import INDEX

ODD = '</script><script>alert("1")</script> {{data}} \x1b[2J \udc80 \u202e \' & 中'


def standing(frames=30, move=0.01):
    """Poses of somebody who stands with spread arms and glides to the side."""
    pose = np.zeros((24, 3), np.float32)
    heights = {"ankle": 0.1, "toes": 0.05, "knee": 0.5, "hip": 0.95, "headtop": 1.8, "head": 1.6}
    for name, joint in INDEX.items():
        side = {"l": 1.0, "r": -1.0}.get(name[0], 0.0) if name != "root" else 0.0
        kind = name[1:] if side else name
        pose[joint] = (0.15 * side, heights.get(kind, 1.3), 0.0)
    away = np.arange(frames, dtype=np.float32)[:, None] * np.float32([move, 0, 0])
    return pose + away[:, None, :]


def content(name="walk/a.bvh", label="walk", **changes):
    words = (np.arange(30) % 5).astype(np.uint64) | np.uint64(1 << 37)
    piece = PagePiece(10, standing(), words)
    costs = np.full(60, np.inf, np.float32)
    costs[20:] = 0.05
    document = PageDocument(name, 60, 0b100, 0.0, 1.0, (piece,), (PageCurve(label, 0.06, costs),))
    hits = (
        PageHit(0, label, 0.01, 12, 22, 1, None),
        PageHit(0, label, 0.02, 22, 40, 2, 0, tuple(range(18))),
    )
    features = tuple(
        PageFeature(each.id, each.name, each.part) for each in load_feature_set("f39").features
    )
    made = PageContent(label, 30.0, features, (document,), hits, (PageReference(label, hit=0),))
    return dataclasses.replace(made, **changes)


def waving(frames, beats, turn=0.0):
    """Poses of somebody who waves with the left arm so many times, turned about the vertical."""
    poses = standing(frames, 0.002)
    phase = np.sin(np.linspace(0, 2 * np.pi * beats, frames))
    for name, reach in (("lelbow", 0.25), ("lwrist", 0.5), ("lfingers", 0.6)):
        poses[:, INDEX[name], 1] += reach * phase.astype(np.float32)
        poses[:, INDEX[name], 0] += reach
    sin, cos = np.sin(turn), np.cos(turn)
    return poses @ np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]], np.float32)


def several_hits():
    """A long take of two classes, and two short clips of one of them, with all there is to see."""
    words = np.where(np.arange(300) // 20 % 2, 0b1011, 0b0100).astype(np.uint64)
    costs = (0.05 + 0.04 * np.cos(np.arange(300) / 15)).astype(np.float32)
    curves = (PageCurve("wave", 0.03, costs), PageCurve("stand", 0.05, costs[::-1].copy()))
    take = PageDocument(
        "takes/long.bvh", 300, 0, 0.0, 1.0, (PagePiece(0, waving(300, 10), words),), curves
    )
    clips = tuple(
        PageDocument(
            name, 60, 1 << 5, 0.0, 1.0, (PagePiece(0, waving(60, 2, turn), words[:60]),), ()
        )
        for name, turn in (("clips/a.bvh", 1.0), ("clips/b.bvh", -2.0))
    )
    hits = (
        PageHit(1, "wave", 0.01, 0, 60, 1, None),
        PageHit(2, "wave", 0.02, 5, 55, 2, 0, tuple(range(50))),
        PageHit(0, "wave", 0.03, 30, 110, 3, 0, tuple(n // 2 for n in range(80))),
        PageHit(0, "stand", 0.04, 110, 200, 1, None),
        PageHit(0, "wave", 0.05, 200, 290, 4, 0, ()),
    )
    features = content().features
    references = (PageReference("best of wave", hit=0),)
    return PageContent("Hits in made.store", 30.0, features, (take, *clips), hits, references)
