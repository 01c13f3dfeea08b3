"""Why something is a hit, what nearly kept it from being one, and why there is none."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mocapidx.features.featureset import FeatureSet
from mocapidx.model import WordArray
from mocapidx.printable import shown
from mocapidx.queries.evaluate import evaluate
from mocapidx.queries.language import describe
from mocapidx.queries.pattern import UNLIMITED, Block, Pattern, restrict_pattern
from mocapidx.queries.steps import FuzzyQuery, FuzzySet
from mocapidx.store.schema import FRAME_WORDS
from mocapidx.tasks.answers import Archive
from mocapidx.tasks.best_answers import Chosen
from mocapidx.tasks.query_example import LoadedExample

__all__ = ["StepAgreement", "agreements", "explain_hit", "explain_nothing", "step_records"]

BRIEF = 2
"""A step of so few frames is one threshold away from not being there."""

UNLIKE = 3.0
"""A step that is so many times longer or shorter than in the example is worth a word."""

MOST_NAMES = 6


@dataclass(frozen=True, slots=True)
class StepAgreement:
    """One step of a hit.

    Parameters
    ----------
    start, end : int
        In frames of the document.
    demanded : FuzzySet
    found : int
        The feature word at its first frame.
    agrees : bool
        False where a mismatch was allowed.
    example_frames : int
        Frames of the example in the step; 0 where there is no example.
    alike, opposite, others : int
        Masks of features that the query doesn't look at: with one and the same value throughout
        the step of the hit and that of the example; with opposite values throughout; all.
    """

    start: int
    end: int
    demanded: FuzzySet
    found: int
    agrees: bool
    example_frames: int
    alike: int = 0
    opposite: int = 0
    others: int = 0


def agreements(
    archive: Archive, chosen: Chosen, example: LoadedExample | None
) -> list[StepAgreement]:
    """Look at each step of a hit.

    Parameters
    ----------
    archive : Archive
    chosen : Chosen
        Of a pattern.
    example : LoadedExample or None
        What was asked for, mirrored where the hit is.

    Returns
    -------
    list of StepAgreement
        Empty for scenes.
    """
    answer, pattern = chosen.answer, chosen.answer.pattern
    if pattern is None or answer.bounds.shape[1] != len(pattern.steps) + len(pattern.blocks):
        return []
    placed = answer.place.placed[answer.documents[chosen.row]]
    start, stop = chosen.hit.start_frame, chosen.hit.end_frame
    rows = (placed.frame_offset + start, placed.frame_offset + stop)
    words = archive.snapshot.array(placed.file, FRAME_WORDS.path, *rows).astype(np.uint64)
    bounds = answer.bounds[chosen.row : chosen.row + 1]
    stretches = pattern.stretches(bounds)[0].tolist()
    lengths = pattern.lengths
    ends = np.cumsum(lengths)
    known = (1 << len(archive.feature_set.features)) - 1
    others = known & ~pattern.mask & ~answer.group.untrusted
    others = others & ~example.untrusted if example else 0
    found = []
    for number, ((first, last), step) in enumerate(zip(stretches, pattern.steps, strict=True)):
        own = words[first - start : last - start]
        alike = opposite = 0
        if example is not None:
            theirs = example.words[ends[number] - lengths[number] : ends[number]]
            alike, opposite = _compare(own, theirs, others)
        found.append(
            StepAgreement(
                first,
                last,
                step,
                int(own[0]),
                bool(step.contains(own[:1])[0]),
                int(lengths[number]),
                alike,
                opposite,
                others,
            )
        )
    return found


def _compare(own: WordArray, theirs: WordArray, mask: int) -> tuple[int, int]:
    """Give the features that are the same, and opposite, throughout two stretches."""
    on, off = (int(np.bitwise_and.reduce(own)), ~int(np.bitwise_or.reduce(own)))
    their_on, their_off = int(np.bitwise_and.reduce(theirs)), ~int(np.bitwise_or.reduce(theirs))
    alike = (on & their_on | off & their_off) & mask
    return alike, (on & their_off | off & their_on) & mask


def step_records(
    steps: Sequence[StepAgreement], feature_set: FeatureSet, rate: float
) -> list[dict[str, object]]:
    """Lay the steps of a hit out for programs.

    Parameters
    ----------
    steps : sequence of StepAgreement
    feature_set : FeatureSet
    rate : float
        Frames a second.

    Returns
    -------
    list of dict
    """
    records = []
    for step in steps:
        record: dict[str, object] = {
            "start_time": round(step.start / rate, 6),
            "end_time": round(step.end / rate, 6),
            "frames": step.end - step.start,
            "demanded": describe(step.demanded, feature_set, 64),
            "agrees": step.agrees,
        }
        if step.example_frames:
            record["example_frames"] = step.example_frames
            record["others_alike"] = _ids(feature_set, step.alike)
            record["others_opposite"] = _ids(feature_set, step.opposite)
        records.append(record)
    return records


def _ids(feature_set: FeatureSet, mask: int) -> list[str]:
    return [id for bit, id in enumerate(feature_set.ids) if mask >> bit & 1]


def explain_hit(
    rank: int,
    chosen: Chosen,
    steps: Sequence[StepAgreement],
    feature_set: FeatureSet,
    rate: float,
) -> Iterator[str]:
    """Say for people why something is a hit.

    Parameters
    ----------
    rank : int
        From 1.
    chosen : Chosen
    steps : sequence of StepAgreement
    feature_set : FeatureSet
    rate : float
        Frames a second.

    Yields
    ------
    str
        A line each: the hit, its steps, and where it nearly failed.
    """
    hit = chosen.hit
    mirrored = ", mirrored" if chosen.answer.mirrored else ""
    yield f"{rank}. {shown(hit.document)}, {hit.start_time:.2f} to {hit.end_time:.2f} s{mirrored}"
    for number, step in enumerate(steps, start=1):
        count = step.end - step.start
        frames = f"{count} frame{'' if count == 1 else 's'}"
        if step.example_frames:
            frames += f" (example {step.example_frames})"
        text = describe(step.demanded, feature_set)
        verdict = "" if step.agrees else f"; DISAGREES: {_found(step, feature_set)}"
        yield (
            f"   step {number}  {step.start / rate:.2f}-{step.end / rate:.2f} s  {frames}: "
            f"{text}{verdict}{_others(step, feature_set)}"
        )
    for remark in _near_failures(steps):
        yield f"   {remark}"


def _found(step: StepAgreement, feature_set: FeatureSet) -> str:
    mask = 0
    for bits, _ in step.demanded.cubes:
        mask |= bits
    return describe(FuzzySet(((mask, step.found & mask),)), feature_set)


def _others(step: StepAgreement, feature_set: FeatureSet) -> str:
    if not step.others:
        return ""
    text = f"; {step.alike.bit_count()} of {step.others.bit_count()} other features agree"
    if step.opposite:
        names = [f.name for bit, f in enumerate(feature_set.features) if step.opposite >> bit & 1]
        more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
        text += f", opposite: {', '.join(names[:MOST_NAMES])}{more}"
    return text


def _near_failures(steps: Sequence[StepAgreement]) -> Iterator[str]:
    brief = [n for n, step in enumerate(steps, start=1) if step.end - step.start <= BRIEF]
    if brief:
        noun, verb = ("step", "lasts") if len(brief) == 1 else ("steps", "last")
        numbers = ", ".join(map(str, brief))
        yield f"nearly failed: {noun} {numbers} {verb} {BRIEF} frames or fewer"
    ratios = [
        max((s.end - s.start) / s.example_frames, s.example_frames / (s.end - s.start))
        for s in steps
        if s.example_frames
    ]
    if ratios and max(ratios) >= UNLIKE:
        number = int(np.argmax(ratios))
        longer = steps[number].end - steps[number].start > steps[number].example_frames
        yield (
            f"least like the example: step {number + 1}, {max(ratios):.1f} times "
            f"{'longer' if longer else 'shorter'}"
        )


def explain_nothing(
    archive: Archive, pattern: Pattern, mode: str, mismatches: int, label: str
) -> Iterator[str]:
    """Say why there is no hit: which step loses the last candidates, and what would help.

    Parameters
    ----------
    archive : Archive
    pattern : Pattern
        As it was asked.
    mode : str
    mismatches : int
    label : str
        What the pattern is called.

    Yields
    ------
    str
        A line each.
    """
    asked = restrict_pattern(pattern, pattern.mask)
    if asked is None:
        return
    counts = []
    for end in range(1, len(asked.steps) + 1):
        part = _beginning(asked, end)
        few = min(mismatches, end - 1)
        counts.append(_count(archive, part, mode, few))
        if not counts[-1]:
            break
    last = len(counts)
    if not counts[-1]:
        what = describe(asked.steps[last - 1], archive.feature_set)
        if last == 1:
            yield f"no hit for {shown(label)}: nothing goes through step 1 ({what})"
        else:
            yield (
                f"no hit for {shown(label)}: step {last} of {len(asked.steps)} ({what}) loses the "
                f"last candidates; {_times(counts[-2])} through {_steps_before(last)}"
            )
    bounded = any(
        (block.shortest > 1).any() or (block.longest < UNLIMITED).any() for block in asked.blocks
    ) or any(gap != (0, UNLIMITED) for gap in asked.gaps)
    if bounded and (count := _count(archive, _unbounded(asked), mode, mismatches)):
        yield f"without the bounds on durations there would be {count}"
    yield from _without_features(archive, asked, mode, mismatches)


def _times(count: int) -> str:
    return "1 goes" if count == 1 else f"{count} go"


def _steps_before(last: int) -> str:
    return "step 1" if last == 2 else f"steps 1 to {last - 1}"


def _without_features(
    archive: Archive, pattern: Pattern, mode: str, mismatches: int
) -> Iterator[str]:
    """Say which single feature keeps hits away."""
    gains = []
    for bit, feature in enumerate(archive.feature_set.features):
        rest = pattern.mask & ~(1 << bit)
        fewer = restrict_pattern(pattern, rest) if pattern.mask >> bit & 1 and rest else None
        if fewer is not None and mismatches < len(fewer.steps):
            gains.append((_count(archive, fewer, mode, mismatches), feature))
    gains = [gain for gain in gains if gain[0]]
    if gains:
        count, feature = min(gains, key=lambda gain: gain[0])
        yield f"without {feature.id} ({feature.name}) there would be {count}"
    elif pattern.mask.bit_count() > 1:
        yield "no single feature is the reason; select fewer"


def _count(archive: Archive, pattern: Pattern, mode: str, mismatches: int) -> int:
    return sum(
        len(found.documents)
        for place in archive.files
        for found in evaluate(pattern, mode, place.source, place.groups, mismatches)
    )


def _beginning(pattern: Pattern, count: int) -> Pattern:
    """Give the first steps of a pattern, however many blocks they take."""
    blocks = []
    for block in pattern.blocks:
        if count <= 0:
            break
        size = min(count, len(block.query.steps))
        query = FuzzyQuery(block.query.steps[:size], block.query.lengths[:size])
        blocks.append(
            Block(query, block.shortest[:size], block.longest[:size], block.may_fail[:size])
        )
        count -= size
    return Pattern(tuple(blocks), pattern.gaps[: len(blocks) - 1])


def _unbounded(pattern: Pattern) -> Pattern:
    blocks = tuple(
        Block(
            block.query,
            np.zeros_like(block.shortest),
            np.full_like(block.longest, UNLIMITED),
            block.may_fail,
        )
        for block in pattern.blocks
    )
    return Pattern(blocks, ((0, UNLIMITED),) * len(pattern.gaps))
