"""An ordinary motion template from an example and the hits that are surely like it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mocapidx.model import Hit
from mocapidx.store.manifest import Placed
from mocapidx.store.read import Snapshot
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.oneshot_example import ExampleShot
from mocapidx.tasks.segment_sources import store_feature_set
from mocapidx.tasks.unspecified import untrusted_between
from mocapidx.templates.classes import ClassMotion, learn_class
from mocapidx.templates.file import save_templates
from mocapidx.templates.template import DELTA, TemplateSet
from mocapidx.templates.thresholds import Clip

__all__ = ["learn_from_hits", "stretch_name"]


def learn_from_hits(
    path: Path, example: ExampleShot, snapshot: Snapshot, hits: Sequence[Hit]
) -> None:
    """Learn a template and write it to a file of its own.

    Parameters
    ----------
    path : Path
        The template file.
    example : ExampleShot
        Gives the template its label.
    snapshot : Snapshot
        Holds the hits' documents.
    hits : sequence of Hit
        Those that are surely like the example.

    Raises
    ------
    ParameterError
        If the example is too short.
    WriteError
        If the file could not be written.
    """
    settings = snapshot.manifest.settings
    places = {placed.document.name: placed for placed in snapshot.documents()}
    job = ClassMotion(
        label=example.label,
        examples=(
            Clip(example.words, example.untrusted),
            *(_clip(snapshot, places[hit.document], hit) for hit in hits),
        ),
        names=(example.name, *map(stretch_name, hits)),
        groups=(example.name, *(hit.document for hit in hits)),
        others=(),
        background=(),
        features=len(store_feature_set(snapshot).features),
        feature_set_digest=settings.feature_set_digest,
        rate=settings.rate,
        repetitions="none",
        delta=DELTA,
    )
    templates = TemplateSet(
        learn_class(job).templates,
        settings.feature_set_name,
        settings.feature_set_digest,
        settings.feature_set_text,
        settings.rate,
    )
    save_templates(path, templates)


def _clip(snapshot: Snapshot, placed: Placed, hit: Hit) -> Clip:
    start = placed.frame_offset + hit.start_frame
    end = placed.frame_offset + hit.end_frame
    words = snapshot.array(placed.file, FRAME_WORDS.path, start, end).astype(np.uint64)
    return Clip(words, untrusted_between(placed.document, hit.start_frame, hit.end_frame))


def stretch_name(hit: Hit) -> str:
    """Name where a hit lies, in seconds: ``document@start:end``."""
    return f"{hit.document}@{hit.start_time:g}:{hit.end_time:g}"
