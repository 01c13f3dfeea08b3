"""Recordings of skeletons that no body has: any tree, any axes, any channels."""

import numpy as np

from mocapidx.model import Recording, Skeleton


def random_recording(seed, turned_by, frames=5):
    """Make one of two to eight nodes, `turned_by` their parent's rotations or their own."""
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 9))
    parents = np.array([-1, *(random.integers(0, i) for i in range(1, count))])
    axes = None
    if random.random() < 0.7:
        axes = np.linalg.qr(random.normal(size=(count, 3, 3)))[0]
        axes *= np.sign(np.linalg.det(axes))[:, None, None]
        axes[random.random(count) < 0.4] = np.eye(3)
    nodes, kinds = [], []
    for node in range(count):
        own = random.permutation(6)[: random.integers(0, 7)]
        nodes += [node] * len(own)
        kinds += own.tolist()
    return Recording(
        Skeleton(
            tuple(f"n{i}" for i in range(count)),
            parents.astype(np.int64),
            random.normal(size=(count, 3)),
            turned_by,
            axes,
        ),
        np.array(nodes, dtype=np.int64),
        np.array(kinds, dtype=np.int64),
        random.normal(size=(frames, len(nodes))) * 2,
        None,
        None,
    )
