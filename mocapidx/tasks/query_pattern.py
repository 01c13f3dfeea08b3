"""Query by a pattern or a scene that was written by hand."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.model import IndexArray
from mocapidx.printable import count, shown
from mocapidx.queries.evaluate import DocumentGroup, evaluate, finder, in_documents
from mocapidx.queries.files import parse_pattern, parse_scene, read_query_text
from mocapidx.queries.language import parse_short, pattern_from_steps
from mocapidx.queries.pattern import Pattern, mirror_pattern, pattern_hits, restrict_pattern
from mocapidx.queries.scene import Condition, Scene, join_scene, scene_spans
from mocapidx.queries.source import Source
from mocapidx.tasks.answers import Answer, Archive, LookedAt
from mocapidx.tasks.best_answers import Chosen
from mocapidx.tasks.unspecified import told

__all__ = [
    "ask_scene",
    "explain_scene",
    "load_pattern",
    "load_scene",
    "mirror_scene",
    "scene_mask",
    "short_pattern",
]


def load_pattern(archive: Archive, path: str | Path) -> tuple[str, Pattern]:
    """Read a pattern for a store.

    Parameters
    ----------
    archive : Archive
    path : str or Path
        A TOML file, see ``docs/queries.md``.

    Returns
    -------
    label : str
        The pattern's name, else the file's.
    pattern : Pattern

    Raises
    ------
    FormatError
    """
    text = read_query_text(path)
    name, pattern = parse_pattern(text, archive.feature_set, archive.rate, shown(path))
    return name or Path(path).stem, pattern


def short_pattern(archive: Archive, features: str, steps: str) -> tuple[str, Pattern]:
    """Understand the short form of a pattern, such as ``F20`` and ``0 1 0 1 0``.

    Parameters
    ----------
    archive : Archive
    features, steps : str
        As in `mocapidx.queries.language.parse_short`.

    Returns
    -------
    label : str
    pattern : Pattern

    Raises
    ------
    ParameterError
    """
    given = parse_short(features, steps, archive.feature_set)
    return f"{features} {steps}", pattern_from_steps(given, archive.rate)


def load_scene(archive: Archive, path: str | Path) -> tuple[str, Scene]:
    """Read a scene for a store.

    Parameters
    ----------
    archive : Archive
    path : str or Path
        A TOML file, see ``docs/queries.md``, or the name of a scene that is shipped.

    Returns
    -------
    label : str
        The scene's name, else the file's.
    scene : Scene

    Raises
    ------
    FormatError
    """
    text = read_query_text(path, shipped=True)
    name, scene = parse_scene(text, archive.feature_set, archive.rate, shown(path))
    return name or Path(path).stem, scene


def mirror_scene(archive: Archive, scene: Scene) -> Scene:
    """Exchange left and right in all progressions."""
    permutation = archive.feature_set.mirror
    turned = tuple(mirror_pattern(pattern, permutation) for pattern in scene.progressions)
    return replace(scene, progressions=turned)


def ask_scene(
    archive: Archive, scene: Scene, mode: str, label: str, mirrored: bool = False
) -> list[Answer]:
    """Find a scene in all documents that count.

    Parameters
    ----------
    archive : Archive
    scene : Scene
    mode : str
        How the blocks of its progressions are found; not ``mismatch``.
    label : str
        Of the hits.
    mirrored : bool
        Whether `scene` is a mirrored one.

    Returns
    -------
    list of Answer
        Costs are 0. Documents whose skeletons can't tell a step of a progression from the next
        one are not asked: their answers have no pattern.

    Raises
    ------
    ParameterError
        If the mode is not one for scenes, or the conditions let too much through.
    """
    if mode == "mismatch":
        raise ParameterError("the mode mismatch is for one sequence of steps, not for a scene")
    asked = []
    for name, pattern in zip(scene.names, scene.progressions, strict=True):
        whole = restrict_pattern(pattern, pattern.mask)
        if whole is None or len(whole.steps) < len(pattern.steps):
            raise ParameterError(
                f"progression '{shown(name)}': two steps in a row can hold at once; add what tells "
                "them apart"
            )
        asked.append(whole)
    scene = replace(scene, progressions=tuple(asked))
    several = archive.each_file(partial(_scene_spans, scene, mode))
    return [
        _answer(place, group, scene, label, mirrored, found)
        for place, of_groups in zip(archive.files, several, strict=True)
        for group, found in zip(place.groups, of_groups, strict=True)
    ]


def _scene_spans(
    scene: Scene, mode: str, source: Source, groups: Sequence[DocumentGroup]
) -> list[tuple[IndexArray, IndexArray] | None]:
    """Find a scene in a segment file; runs in any process.

    Of each group documents and spans; None where its documents can't be asked.
    """
    tables = None
    found: list[tuple[IndexArray, IndexArray] | None] = []
    for group in groups:
        if any(pattern.mask & group.untrusted for pattern in scene.progressions):
            found.append(None)
            continue
        if tables is None:
            find = finder(mode, scene.progressions[0])
            tables = [pattern_hits(p, source, find) for p in scene.progressions]
        own = [in_documents(table, source, group.documents) for table in tables]
        spans = np.unique(scene_spans(scene, own, join_scene(scene, own, source)), axis=0)
        documents = source.document_at(spans[:, 0])
        found.append((documents, spans - source.first[documents, np.newaxis]))
    return found


def _answer(
    place: LookedAt,
    group: DocumentGroup,
    scene: Scene,
    label: str,
    mirrored: bool,
    found: tuple[IndexArray, IndexArray] | None,
) -> Answer:
    documents, spans = np.zeros(0, np.int64), np.zeros((0, 2), np.int64)
    if found is not None:
        documents, spans = found
        clear = told(place.file.documents, documents, spans, scene_mask(scene))
        documents, spans = documents[clear], spans[clear]
    pattern = None if found is None else scene.progressions[0]
    costs = np.zeros(len(spans))
    return Answer(place, documents, spans, label, mirrored, pattern, spans, costs, group)


def scene_mask(scene: Scene) -> int:
    """Give the features that any progression looks at."""
    mask = 0
    for pattern in scene.progressions:
        mask |= pattern.mask
    return mask


def explain_scene(
    archive: Archive, scene: Scene, mode: str, chosen: Sequence[Chosen]
) -> Iterator[str]:
    """Say how often each progression is found for itself, and where nothing meets conditions.

    Parameters
    ----------
    archive : Archive
    scene : Scene
        As it was asked.
    mode : str
    chosen : sequence of Chosen
        The hits.

    Yields
    ------
    str
        A line each.
    """
    counts = [
        sum(
            len(found.documents)
            for place in archive.files
            for found in evaluate(pattern, mode, place.source, place.groups)
        )
        for pattern in scene.progressions
    ]
    for name, number in zip(scene.names, counts, strict=True):
        yield f"progression '{shown(name)}' is found {count(number, 'time')} for itself"
    if chosen or not all(counts):
        return
    for place, condition in enumerate(scene.conditions):
        rest = scene.conditions[:place] + scene.conditions[place + 1 :]
        try:
            less = replace(scene, conditions=rest)
        except ParameterError:  # it alone links two progressions
            continue
        if number := sum(len(a.documents) for a in ask_scene(archive, less, mode, "")):
            text = _condition_text(scene, condition)
            yield f"without the condition '{text}': {count(number, 'hit')}"


def _condition_text(scene: Scene, condition: Condition) -> str:
    one, other = (
        scene.names[place.progression] + ("" if place.step is None else f".{place.step + 1}")
        for place in (condition.one, condition.other)
    )
    return f"{one} {condition.relation} {other}"
