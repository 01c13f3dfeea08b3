"""Query by example with `--select relax`: features are left out until there are enough hits."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.features.extract import feature_margins
from mocapidx.features.featureset import PARTS
from mocapidx.features.words import unpack_words
from mocapidx.model import FloatArray, Motion
from mocapidx.printable import shown
from mocapidx.queries.relax import relaxations
from mocapidx.skeleton.joints import CANONICAL_JOINTS
from mocapidx.tasks.answers import Answer, Archive, Found, feature_names, feature_ranges
from mocapidx.tasks.best_answers import best
from mocapidx.tasks.example import Example
from mocapidx.tasks.query_example import LoadedExample, ask_example, load_example
from mocapidx.tasks.query_rank import costs_by
from mocapidx.tasks.read import ReadOptions
from mocapidx.templates.oneshot import OneShot, flipping_distances, signed_distances, weigh
from mocapidx.templates.sigma import usual_sigma

__all__ = ["ENOUGH", "ask_relaxed"]

ENOUGH: Final = 20
"""Hits after which no more features are left out, if nobody says how many are wanted."""


def ask_relaxed(
    archive: Archive,
    example: str | Path | Example,
    mode: str,
    rank: str,
    top: int | None,
    options: ReadOptions,
) -> Found:
    """Ask for an example with fewer and fewer features, until there are enough hits.

    Parameters
    ----------
    archive : Archive
    example : str, Path or Example
    mode, rank : str
        As in `mocapidx.tasks.query.query_store`.
    top : int, optional
        How many hits are wanted; default 20, and then all that the last selections find are
        given.
    options : ReadOptions
        How the example's file is understood.

    Returns
    -------
    Found
        The whole part of a cost says how many features were left out, so hits that agree in
        more come first. Each hit has the extra ``selection``.

    Raises
    ------
    FormatError
        If the example can't be used.
    ParameterError
        If it is a document of a store without poses.

    References
    ----------
    .. [1] Mueller, Roeder, Clausen, SIGGRAPH 2005, section 6.2, last paragraph.
    """
    loaded = load_example(archive, example, options)
    costs, wanted = costs_by(rank, archive), ENOUGH if top is None else top
    features = archive.feature_set
    families = [features.select("all"), *map(features.part_mask, PARTS)]
    trusted = [family & ~loaded.untrusted for family in families]
    selections: list[int] = []
    answers: list[Answer] = []
    chosen, asked = best(archive, [], None), 0
    for step in relaxations(loaded.words, trusted, _importance(archive, loaded, example)):
        for mask in step.masks:
            _, found = ask_example(archive, loaded, mask, mode, 0, None, costs)
            some = [_cost_after(answer, step.left_out) for answer in found if len(answer.documents)]
            answers += some
            selections += [mask] * len(some)
        asked += len(step.masks)
        if sum(len(answer.documents) for answer in answers) >= wanted:
            chosen = best(archive, answers, None, apart=True)
            if len(chosen) >= wanted:
                break
    else:
        chosen = best(archive, answers, None, apart=True)
    chosen = chosen[:top]
    used = {id(answer): mask for answer, mask in zip(answers, selections, strict=True)}
    names = [feature_names(features, used[id(one.answer)]) for one in chosen]
    return Found(
        tuple(one.hit for one in chosen),
        tuple(_remarks(archive, loaded, asked, names)),
        tuple({"selection": name} for name in names),
    )


def _importance(
    archive: Archive, loaded: LoadedExample, example: str | Path | Example
) -> FloatArray:
    """Weigh the features as a one-shot template does, by what is usual, for the index alone."""
    if loaded.poses is None:
        raise ParameterError(
            f"{shown(str(example))}: the store keeps no poses to weigh its features by; "
            "give the motion file"
        )
    features = archive.feature_set
    bits = unpack_words(loaded.words, len(features.features))
    motion = Motion(CANONICAL_JOINTS, loaded.poses, archive.rate)
    margins = feature_margins(motion, features, archive.rate)
    distances = flipping_distances(bits, margins.strong, margins.weak)
    distances[:, [bit for bit in range(bits.shape[1]) if loaded.untrusted >> bit & 1]] = np.nan
    signed = signed_distances(OneShot(bits, distances), usual_sigma(features))
    weights: FloatArray = weigh(signed).weights.sum(axis=0)
    return weights


def _cost_after(answer: Answer, left_out: int) -> Answer:
    """Put the features left out before the point, and what was a cost behind it."""
    return replace(answer, costs=left_out + answer.costs / (1.0 + answer.costs))


def _remarks(
    archive: Archive, loaded: LoadedExample, asked: int, names: Sequence[str]
) -> Sequence[str]:
    remarks = []
    if loaded.untrusted:
        unknown = feature_ranges(archive.feature_set, loaded.untrusted)
        remarks.append(f"the example's skeleton can't tell {unknown}; they were left out")
    if not asked:
        remarks.append("too little happens in the example: no selection gives it three steps")
    elif names:
        remarks.append(f"{asked} selections were asked for; the last hit agrees in {names[-1]}")
    else:
        remarks.append(f"{asked} selections were asked for, and none was found")
    return remarks
