"""Small stores of motions that are made up, for match webs."""

from dataclasses import replace

import numpy as np

from mocapidx.store import schema
from mocapidx.store.write import writing
from tests.made_store import SETTINGS, make_batch


def gesture(size=1.0, before=15, frames=60, rate=30.0, seed=0):
    """Somebody stands, swings an arm for a second and stands again."""
    random = np.random.default_rng(seed)
    rest = np.random.default_rng(1).normal(size=(24, 3)) * 0.3 + [0.0, 1.0, 0.0]
    times = np.clip((np.arange(frames) - before) / rate, 0, 1)
    poses = np.repeat(rest[None], frames, axis=0)
    poses[:, 20:24, 1] += size * 0.6 * np.sin(np.pi * times)[:, None]
    poses[:, 20:24, 0] += size * 0.3 * np.sin(2 * np.pi * times)[:, None]
    return poses + np.cumsum(random.normal(size=poses.shape) * 0.002, axis=0)


def gestures(count, rate=30.0):
    """Gestures that grow from one to the next, by the names of their documents."""
    frames, before = round(2 * rate), round(0.4 * rate)
    return {
        f"arm{n}.bvh": gesture(1 + 0.25 * n, before + n, frames, rate, seed=n) for n in range(count)
    }


def add_motions(path, motions, rate=30.0, poses=True, **changes):
    """Commit motions to a store as one batch; it is made where there is none."""
    batch = make_batch({name: len(p) for name, p in motions.items()}, poses=poses, **changes)
    if poses:
        arrays = dict(batch.arrays)
        arrays[schema.POSES.path] = [p.astype(np.float32) for p in motions.values()]
        batch = replace(batch, arrays=arrays)
    settings = replace(SETTINGS, rate=rate, poses=poses)
    with writing(path, command="test", create=settings) as writer:
        writer.commit(batch)
    return path
