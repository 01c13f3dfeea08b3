"""The data of a page as JSON: numbers in base64, nothing in it that HTML could take for markup."""

import base64
import json
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.model import FloatArray, WordArray
from mocapidx.printable import shown
from mocapidx.reports.page.content import (
    PageContent,
    PageCurve,
    PageDocument,
    PageHit,
    PagePiece,
    PageReference,
)
from mocapidx.skeleton.joints import CANONICAL_JOINTS, MIRROR, PARENTS

__all__ = ["UNKNOWN", "encode_content", "encode_poses", "joint_sides"]

UNKNOWN: Final = -32768
"""A coordinate of a joint that the skeleton lacks."""

FARTHEST: Final = 32767
NO_COST: Final = 65535
COST_STEP: Final = 1e-4
MOST_POINTS: Final = 4000
"""Points of a distance function; of more, the lowest of each few is kept."""


def encode_content(content: PageContent, colours: Mapping[str, str]) -> str:
    """Lay out the data of a page.

    Parameters
    ----------
    content : PageContent
    colours : mapping of str to str
        ``#rrggbb`` for each class.

    Returns
    -------
    str
        JSON in ASCII without ``<``, ``>`` and ``&``, so that it is text wherever it stands.
    """
    classes = sorted(colours)
    numbers = {label: number for number, label in enumerate(classes)}
    data = {
        "rate": content.rate,
        "joints": CANONICAL_JOINTS,
        "parents": PARENTS.tolist(),
        "sides": joint_sides(),
        "features": [
            {"id": shown(each.id), "name": shown(each.name), "part": shown(each.part)}
            for each in content.features
        ],
        "classes": [{"label": shown(label), "colour": colours[label]} for label in classes],
        "documents": [
            _document(each, numbers, len(content.features)) for each in content.documents
        ],
        "hits": [_hit(each, numbers) for each in content.hits],
        "references": [_reference(each, len(content.features)) for each in content.references],
    }
    text = json.dumps(data, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def joint_sides() -> str:
    """Tell of each joint whether it is left, right or in the middle: ``l``, ``r`` or ``m``."""
    return "".join(
        "m" if MIRROR[number] == number else name[0] for number, name in enumerate(CANONICAL_JOINTS)
    )


def encode_poses(poses: FloatArray) -> tuple[list[int], int, str]:
    """Round positions to whole millimetres about an origin of their own.

    Parameters
    ----------
    poses : ndarray of float, shape (T, J, 3)
        In metres; NaN for joints that are unknown.

    Returns
    -------
    origin : list of int
        In millimetres.
    unit : int
        Millimetres in one: more than 1 only where the motion would not fit else.
    data : str
        ``unit`` times these and the origin is the position: int16, little-endian, in base64;
        `UNKNOWN` where there is none.
    """
    known = np.isfinite(poses)
    millimetres = np.where(known, poses, 0.0).astype(np.float64) * 1000
    points = millimetres[known.all(axis=2)]
    if not len(points):
        return [0, 0, 0], 1, _base64(np.full(poses.shape, UNKNOWN, "<i2"))
    low, high = points.min(axis=0), points.max(axis=0)
    origin = np.rint((low + high) / 2)
    unit = max(1, int(np.ceil((high - low).max() / 2 / (FARTHEST - 1))))
    values = np.rint((millimetres - origin) / unit)
    values = np.where(known, values, UNKNOWN).astype("<i2")
    return [int(each) for each in origin], unit, _base64(values)


def _document(document: PageDocument, numbers: Mapping[str, int], features: int) -> dict[str, Any]:
    return {
        "name": shown(document.name, None),
        "frames": document.frames,
        "untrusted": f"{document.untrusted:x}",
        "floor": round(document.floor, 3),
        "size": round(document.size, 3),
        "pieces": [_piece(piece, features) for piece in document.pieces],
        "curves": [_curve(curve, numbers[curve.label]) for curve in document.curves],
    }


def _piece(piece: PagePiece, features: int) -> dict[str, Any]:
    origin, unit, poses = encode_poses(piece.poses[:: piece.step])
    return {
        "start": piece.start,
        "frames": len(piece.words),
        "step": piece.step,
        "origin": origin,
        "unit": unit,
        "poses": poses,
        "words": _words(piece.words, features),
    }


def _words(words: WordArray, features: int) -> str:
    octets = np.ascontiguousarray(words, dtype="<u8").view(np.uint8).reshape(-1, 8)
    return _base64(np.ascontiguousarray(octets[:, : -(-features // 8)]))


def _curve(curve: PageCurve, number: int) -> dict[str, Any]:
    every = -(-len(curve.costs) // MOST_POINTS)
    costs = np.minimum.reduceat(curve.costs, np.arange(0, len(curve.costs), every))
    steps = np.rint(np.where(np.isfinite(costs), costs, 0.0).astype(np.float64) / COST_STEP)
    values = np.where(np.isfinite(costs), np.clip(steps, 0, NO_COST - 1), NO_COST)
    return {
        "class": number,
        "tau": round(float(curve.tau), 6),
        "every": every,
        "costs": _base64(values.astype("<u2")),
    }


def _hit(hit: PageHit, numbers: Mapping[str, int]) -> dict[str, Any]:
    return {
        "document": hit.document,
        "class": numbers[hit.label],
        "cost": round(float(hit.cost), 9),
        "start": hit.start,
        "end": hit.end,
        "rank": hit.rank,
        "reference": hit.reference,
        "steps": list(hit.steps),
    }


def _reference(reference: PageReference, features: int) -> dict[str, Any]:
    piece = reference.piece
    return {
        "name": shown(reference.name, None),
        "hit": reference.hit,
        "piece": None if piece is None else _piece(piece, features),
        "size": round(reference.size, 3),
        "floor": round(reference.floor, 3),
    }


def _base64(values: NDArray[Any]) -> str:
    return base64.b64encode(values.tobytes()).decode("ascii")
