"""Match graphs at the rate of their store."""

from functools import lru_cache

import numpy as np

from mocapidx.graphs.frame_distance import METRES_A_STEP, distance_grid, frame_clouds
from mocapidx.graphs.match_graph import MatchGraph, MatchNode
from mocapidx.graphs.refine import refined_graph
from mocapidx.model import FloatArray
from mocapidx.store.read import Snapshot
from mocapidx.tasks.open_web import OpenWeb
from mocapidx.tasks.stored import stored_poses

__all__ = ["refined"]


def refined(graph: MatchGraph, web: OpenWeb, store: Snapshot) -> MatchGraph:
    """Give a match graph at the rate of the store that its web was built from.

    Parameters
    ----------
    graph : MatchGraph
        At the rate of the web's grids.
    web : OpenWeb
    store : Snapshot

    Returns
    -------
    MatchGraph
        The same graph where both rates are one.
    """
    stride = web.web.stride
    if stride == 1:
        return graph
    placed = {entry.document.name: entry for entry in store.documents()}
    reach = round(float(web.web.rules["window"]) * web.rate)

    @lru_cache(maxsize=64)
    def poses(document: str) -> FloatArray:
        return stored_poses(store, placed[document])

    def distances(first: MatchNode, second: MatchNode) -> FloatArray:
        pair = [poses(first.document), poses(second.document)]
        joints = np.all([np.isfinite(one).all(axis=(0, 2)) for one in pair], axis=0)
        clouds = [
            frame_clouds(
                whole,
                joints,
                reach,
                np.arange(node.start_frame, node.end_frame),
                stride=stride,
            )
            for whole, node in zip(pair, (first, second), strict=True)
        ]
        return distance_grid(*clouds) * METRES_A_STEP

    frames = {known.name: known.frames for known in web.web.documents}
    return refined_graph(graph, stride, frames, distances)
