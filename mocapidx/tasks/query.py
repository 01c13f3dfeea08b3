"""Answer a query from a store: by examples, by a pattern, by a scene."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from mocapidx.errors import ParameterError
from mocapidx.model import HitList
from mocapidx.queries.evaluate import MODES
from mocapidx.queries.pattern import Pattern, mirror_pattern
from mocapidx.tasks.answers import Answer, Archive, Found, ask, open_archive, untrusted_remarks
from mocapidx.tasks.best_answers import Chosen, best
from mocapidx.tasks.example import Example, parse_example
from mocapidx.tasks.query_example import (
    LoadedExample,
    agreeing,
    ask_example,
    example_remarks,
    load_example,
    mirror_example,
)
from mocapidx.tasks.query_rank import RANKINGS, costs_by
from mocapidx.tasks.read import ReadOptions

if TYPE_CHECKING:
    from mocapidx.tasks.parallel import MapFunction

# What a plain query by example has no use for is imported where it is needed: it would take as
# long to import as the query takes to answer.

__all__ = ["MODES", "RANKINGS", "Example", "Found", "parse_example", "query_store"]

COMBINATIONS: Final = ("any", "all")


@dataclass(frozen=True, slots=True)
class Asking:
    """How a query is asked, whatever it is about; see `query_store`."""

    select: str
    mode: str
    mismatches: int
    mismatch_at: Sequence[int] | None
    rank: str
    top: int | None
    combine: str
    mirror: bool
    explain: bool
    read: ReadOptions


@dataclass(frozen=True, slots=True)
class Asked:
    """One question and its answers: an example or a pattern, as it is or mirrored."""

    pattern: Pattern | None
    answers: Sequence[Answer]
    label: str
    example: LoadedExample | None = None


def query_store(
    store: str | Path,
    example: str | Path | Example | Sequence[str | Path | Example] | None = None,
    *,
    pattern: str | Path | None = None,
    steps_of: tuple[str, str] | None = None,
    scene: str | Path | None = None,
    select: str | None = None,
    mode: str = "adaptive",
    mismatches: int = 0,
    mismatch_at: Sequence[int] | None = None,
    rank: str | None = None,
    top: int | None = None,
    combine: str = "any",
    mirror: bool = False,
    where: str | None = None,
    explain: bool = False,
    read: ReadOptions | None = None,
    map_fn: "MapFunction | None" = None,
) -> Found:
    """Find every stretch of a store that answers a query.

    One of `example`, `pattern`, `steps_of` and `scene` says what is looked for.

    Parameters
    ----------
    store : str or Path
    example : str, Path, Example, or a sequence of these
        As text: ``FILE`` or ``FILE@START:END``, or in place of FILE a document of the store.
    pattern : str or Path
        A TOML file with a sequence of steps.
    steps_of : (str, str)
        Features and the short form of a sequence of steps: ``("F20", "0 1 0 1 0")``.
    scene : str or Path
        A TOML file with several progressions, or the name of a shipped scene.
    select : str, optional
        The features of an example that count, as in `FeatureSet.select`; default all. With
        ``relax`` features are left out until there are enough hits.
    mode : {"exact", "fuzzy", "adaptive", "mismatch"}
    mismatches : int
        Steps that may disagree, for the mode ``mismatch``.
    mismatch_at : sequence of int, optional
        Which steps may disagree, from 1; default all.
    rank : {"length", "dtw", "template", "none"}, optional
        What costs compare; by default lengths for examples, and nothing for what has no
        example: costs are then 0.
    top : int, optional
        Keep the best only.
    combine : {"any", "all"}
        With several examples: hits of any of them, or those on which all agree.
    mirror : bool
        Ask the query with left and right exchanged too; each hit has the extra ``mirrored``.
    where : str, optional
        A condition on documents, as in `mocapidx.tasks.where`.
    explain : bool
        Say why there are hits, or why there is none.
    read : ReadOptions, optional
        How the example's file is understood.
    map_fn : callable, optional
        Asks the segment files, with the shape of ``map``; by default one after the other.

    Returns
    -------
    Found
        Hits by cost, then by document name, then by start.

    Raises
    ------
    FormatError
        If an example, a pattern or a scene can't be used.
    ParameterError, StoreError
    """
    given = {"example": example, "pattern": pattern, "steps-of": steps_of, "scene": scene}
    kinds = [kind for kind, value in given.items() if value is not None and value != ()]
    if len(kinds) != 1:
        raise ParameterError(
            "a query is one of --example, --pattern, --steps-of and --scene"
            + (f"; given are {' and '.join(f'--{kind}' for kind in kinds)}" if kinds else "")
        )
    by_example = kinds == ["example"]
    asking = Asking(
        "all" if select is None else select,
        mode,
        mismatches,
        mismatch_at,
        rank or ("length" if by_example else "none"),
        top,
        combine,
        mirror,
        explain,
        read or ReadOptions(),
    )
    _check(asking, kinds[0], select)
    with open_archive(store, where, map_fn) as archive:
        if scene is not None:
            return _by_scene(archive, scene, asking)
        if example is not None:
            several = [example] if isinstance(example, (str, Path, Example)) else example
            return _by_examples(archive, several, asking)
        from mocapidx.tasks.query_pattern import load_pattern, short_pattern

        if steps_of is not None:
            label, given_pattern = short_pattern(archive, *steps_of)
        else:
            label, given_pattern = load_pattern(archive, pattern or "")
        return _by_pattern(archive, label, given_pattern, asking)


def _check(asking: Asking, kind: str, select: str | None) -> None:
    """Refuse what does not go together."""
    if asking.combine not in COMBINATIONS:
        raise ParameterError(f"several examples combine by any or all, not '{asking.combine}'")
    if kind != "example" and select is not None:
        raise ParameterError(f"--select is for examples; --{kind} names its features itself")
    if kind != "example" and asking.rank != "none":
        raise ParameterError(f"--rank {asking.rank} compares with an example; --{kind} has none")
    if asking.mode != "mismatch" and (asking.mismatches or asking.mismatch_at is not None):
        raise ParameterError("mismatches are for the mode mismatch")


def _by_examples(
    archive: Archive, examples: Sequence[str | Path | Example], asking: Asking
) -> Found:
    if asking.select == "relax":
        if len(examples) != 1 or asking.mirror or asking.mode == "mismatch":
            raise ParameterError("--select relax takes one example, without --mirror or mismatches")
        from mocapidx.tasks.relax import ask_relaxed

        return ask_relaxed(archive, examples[0], asking.mode, asking.rank, asking.top, asking.read)
    costs = costs_by(asking.rank, archive)
    mask = archive.feature_set.select(asking.select)
    asked: list[list[Asked]] = []
    remarks: list[str] = []
    for example in examples:
        loaded = load_example(archive, example, asking.read)
        remarks += example_remarks(archive, loaded, mask)
        asked.append([])
        for turned, own_mask in _with_mirrored_example(archive, loaded, mask, asking.mirror):
            pattern, answers = ask_example(
                archive,
                turned,
                own_mask,
                asking.mode,
                asking.mismatches,
                asking.mismatch_at,
                costs,
            )
            asked[-1].append(Asked(pattern, answers, loaded.label, turned))
    questions = [question for some in asked for question in some]
    for question in questions[: 1 if len(examples) == 1 else None]:
        if question.pattern is not None and not (question.example and question.example.mirrored):
            mine = untrusted_remarks(archive.feature_set, question.answers, question.pattern.mask)
            remarks += (remark for remark in mine if remark not in remarks)
    together = asking.combine == "all" and len(examples) > 1
    if together:
        sides = [[answer for question in some for answer in question.answers] for some in asked]
        chosen = best(archive, agreeing(sides), asking.top, apart=True)
    else:
        answers = [answer for question in questions for answer in question.answers]
        chosen = best(archive, answers, asking.top)
    return _found(archive, chosen, remarks, questions, asking, several=len(examples) > 1)


def _with_mirrored_example(
    archive: Archive, example: LoadedExample, mask: int, mirror: bool
) -> Iterator[tuple[LoadedExample, int]]:
    yield example, mask
    if mirror:
        permutation = archive.feature_set.mirror
        partners = permutation.tolist()
        turned = sum(1 << partners[bit] for bit in range(len(partners)) if mask >> bit & 1)
        yield mirror_example(example, permutation), turned


def _by_pattern(archive: Archive, label: str, pattern: Pattern, asking: Asking) -> Found:
    pattern = _with_mismatches_at(pattern, asking.mismatch_at)
    turns = [(pattern, False)]
    if asking.mirror:
        turns.append((mirror_pattern(pattern, archive.feature_set.mirror), True))
    questions = [
        Asked(turn, ask(archive, turn, asking.mode, asking.mismatches, label, mirrored), label)
        for turn, mirrored in turns
    ]
    chosen = best(archive, [a for question in questions for a in question.answers], asking.top)
    mask, answers = pattern.mask, questions[0].answers
    remarks = [
        *_joined_remarks(pattern, answers),
        *untrusted_remarks(archive.feature_set, answers, mask),
    ]
    return _found(archive, chosen, remarks, questions, asking)


def _with_mismatches_at(pattern: Pattern, steps: Sequence[int] | None) -> Pattern:
    if steps is None:
        return pattern
    count = len(pattern.steps)
    if wrong := [step for step in steps if not 1 <= step <= count]:
        raise ParameterError(f"no step {wrong[0]} to disagree; the pattern has {count}")
    block = pattern.blocks[0]  # patterns of several are refused by the mode
    may_fail = [step in steps for step in range(1, len(block.query.steps) + 1)]
    first = replace(block, may_fail=block.may_fail & may_fail)
    return Pattern((first, *pattern.blocks[1:]), pattern.gaps)


def _joined_remarks(pattern: Pattern, answers: Sequence[Answer]) -> Iterator[str]:
    for answer in answers:
        if answer.pattern is not None and not answer.group.untrusted & pattern.mask:
            if len(answer.pattern.steps) < len(pattern.steps):
                yield (
                    f"steps in a row that can hold at once were joined: {len(pattern.steps)} steps "
                    f"became {len(answer.pattern.steps)}"
                )
            return


def _by_scene(archive: Archive, path: str | Path, asking: Asking) -> Found:
    from mocapidx.tasks.query_pattern import (
        ask_scene,
        explain_scene,
        load_scene,
        mirror_scene,
        scene_mask,
    )

    label, scene = load_scene(archive, path)
    answers = ask_scene(archive, scene, asking.mode, label)
    remarks = list(untrusted_remarks(archive.feature_set, answers, scene_mask(scene)))
    if asking.mirror:
        turned = mirror_scene(archive, scene)
        answers = [*answers, *ask_scene(archive, turned, asking.mode, label, mirrored=True)]
    chosen = best(archive, answers, asking.top)
    extras = tuple({"mirrored": one.answer.mirrored} for one in chosen) if asking.mirror else ()
    lines = tuple(explain_scene(archive, scene, asking.mode, chosen)) if asking.explain else ()
    return Found(HitList(one.hit for one in chosen), tuple(remarks), extras, lines)


def _found(
    archive: Archive,
    chosen: Sequence[Chosen],
    remarks: Sequence[str],
    questions: Sequence[Asked],
    asking: Asking,
    several: bool = False,
) -> Found:
    extras: list[dict[str, object]] = [{} for _ in chosen]
    lines: list[str] = []
    if asking.mirror:
        for extra, one in zip(extras, chosen, strict=True):
            extra["mirrored"] = one.answer.mirrored
    if asking.explain:
        from mocapidx.tasks.query_explain import (
            agreements,
            explain_hit,
            explain_nothing,
            step_records,
        )

        example_of = _examples_of(questions)
        for rank, (extra, one) in enumerate(zip(extras, chosen, strict=True), start=1):
            steps = agreements(archive, one, example_of(one.answer))
            extra["steps"] = step_records(steps, archive.feature_set, archive.rate)
            lines += explain_hit(rank, one, steps, archive.feature_set, archive.rate)
        if not chosen:
            for question in questions:
                if question.pattern is not None and not _turned(question):
                    lines += explain_nothing(
                        archive, question.pattern, asking.mode, asking.mismatches, question.label
                    )
            if several and any(len(a.documents) for q in questions for a in q.answers):
                lines.append("each example has hits, but nowhere do hits of all overlap")
    hits = HitList(one.hit for one in chosen)
    return Found(hits, tuple(remarks), tuple(extras) if any(extras) else (), tuple(lines))


def _turned(question: Asked) -> bool:
    return any(answer.mirrored for answer in question.answers)


def _examples_of(questions: Sequence[Asked]) -> Callable[[Answer], LoadedExample | None]:
    """Tell of which example an answer is: by label and side, for answers may have been cut."""
    known = {
        (question.label, bool(question.example and question.example.mirrored)): question.example
        for question in questions
    }
    return lambda answer: known.get((answer.label, answer.mirrored))
