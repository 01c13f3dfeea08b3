"""How templates look to people: facts as records, entries drawn in text."""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.features.featureset import PARTS, FeatureSet
from mocapidx.printable import shown
from mocapidx.tasks.records import Record
from mocapidx.templates.edit import decided_entries
from mocapidx.templates.template import MotionTemplate
from mocapidx.templates.thresholds import POOR_SEPARATION

__all__ = ["LIST_COLUMNS", "draw_text", "template_facts"]

LIST_COLUMNS: Final = (
    "class",
    "kind",
    "frames",
    "seconds",
    "examples",
    "decided",
    "positive_cost",
    "background_cost",
    "tau",
)
"""What a table shows of a template."""

SIGNS: Final = np.array([".", "#", " "])
"""How an entry looks in text: 0, 1, undecided."""


def template_facts(template: MotionTemplate) -> Record:
    """Say in numbers what is known of a template.

    Parameters
    ----------
    template : MotionTemplate

    Returns
    -------
    mapping
        ``decided`` is the share of entries that count; ``spread`` the mean distance of the
        examples; what is not known is None.
    """
    frames = len(template.matrix)
    return {
        "class": template.label,
        "kind": template.kind,
        "looping": template.looping,
        "frames": frames,
        "seconds": round(frames / template.rate, 3),
        "rate_hz": template.rate,
        "delta": template.delta,
        "examples": len(template.documents),
        "mean_length": round(template.mean_length, 3),
        "passes": template.passes,
        "spread": round(float(np.mean(template.spread)), 6) if template.spread else None,
        "decided": round(float(np.mean(_signs(template) < 2)), 4),
        "positive_cost": _rounded(template.positive_cost),
        "background_cost": _rounded(template.background_cost),
        "tau": _rounded(template.tau),
        "keyframes": " ".join(map(str, template.keyframes)),
        "keyframe_tolerance": template.keyframe_tolerance,
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else round(value, 6)


def _signs(template: MotionTemplate) -> NDArray[np.int64]:
    """Entries as 0, 1, or 2 for undecided; shape (K, F)."""
    ones, zeros = decided_entries(template.matrix, template.delta)
    return np.where(ones, 1, np.where(zeros, 0, 2))


def draw_text(template: MotionTemplate, feature_set: FeatureSet, width: int = 100) -> Iterator[str]:
    """Draw a template in text: rows are features, columns are frames.

    Parameters
    ----------
    template : MotionTemplate
    feature_set : FeatureSet
    width : int
        Characters in a line; a longer template has several frames in a column, which shows
        what most of them have.

    Yields
    ------
    str
        One line a feature, and what people should know before them.
    """
    yield from _headline(template)
    names = [f"{feature.id:>4} {feature.name}" for feature in feature_set.features]
    margin = max(map(len, names)) + 2
    signs = _signs(template)
    per_column = -(-len(signs) // max(width - margin, 20))
    columns = [
        _majority(signs[first : first + per_column]) for first in range(0, len(signs), per_column)
    ]
    drawn = SIGNS[np.array(columns)]
    yield ""
    yield f"# is 1, . is 0, blank is undecided; a column is {_frames(per_column)}"
    for part in PARTS:
        yield ""
        yield part
        for number, feature in enumerate(feature_set.features):
            if feature.part == part:
                yield f"{names[number]:<{margin}}{''.join(drawn[:, number])}".rstrip()
    if template.keyframes:
        marks = [" "] * len(drawn)
        for row in template.keyframes:
            marks[row // per_column] = "^"
        yield ""
        yield f"{'     keyframes':<{margin}}{''.join(marks)}".rstrip()


def _majority(block: NDArray[np.int64]) -> NDArray[np.int64]:
    """Most frequent sign of each feature; where 0 and 1 are equally frequent, undecided."""
    counts = np.array([(block == sign).sum(axis=0) for sign in (0, 1, 2)])
    best = counts.argmax(axis=0)
    return np.where((counts[0] == counts[1]) & (counts[2] <= counts[0]), 2, best)


def _frames(count: int) -> str:
    return "one frame" if count == 1 else f"{count} frames"


def _headline(template: MotionTemplate) -> Iterator[str]:
    facts = template_facts(template)
    kind = "one stretch of repetitions" if template.kind == "stretch" else "class"
    yield f"{shown(template.label)} ({kind}{', looping' if template.looping else ''})"
    yield (
        f"{facts['frames']} frames at {template.rate:g} Hz, {facts['seconds']:.2f} s; "
        f"{facts['decided']:.0%} of the entries decided with delta {template.delta:g}"
    )
    examples = len(template.documents)
    if examples:
        spread = "" if not template.spread else f", mean spread {facts['spread']:.3f}"
        yield (
            f"learned from {examples} example{'s' * (examples > 1)} of "
            f"{template.mean_length:.1f} frames in {template.passes} "
            f"pass{'es' * (template.passes != 1)}{spread}"
        )
    yield _threshold_line(template)
    separation = _separation(template)
    if separation is not None and separation >= POOR_SEPARATION:
        yield (
            f"warning: not well separated from other motion (own cost / other cost = "
            f"{separation:.2f}); add people or examples"
        )


def _threshold_line(template: MotionTemplate) -> str:
    known = [
        f"{name} {value:.4f}"
        for name, value in (
            ("own class", template.positive_cost),
            ("other motion", template.background_cost),
        )
        if value is not None
    ]
    costs = f"costs: {', '.join(known)}; " if known else ""
    if template.tau is None:
        return f"{costs}no threshold of its own, {template.threshold:g} is taken"
    return f"{costs}threshold {template.tau:.4f}"


def _separation(template: MotionTemplate) -> float | None:
    """Own cost over other cost: near 0 is well separated, near 1 not at all."""
    own, other = template.positive_cost, template.background_cost
    if own is None or other is None:
        return None
    return own / other if other > 0 else np.inf
