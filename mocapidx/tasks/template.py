"""Look at template files and change them."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from mocapidx.errors import FeatureSetError, FormatError, ParameterError, StoreError
from mocapidx.features.featureset import FeatureSet, load_feature_set, parse_feature_set
from mocapidx.printable import shown
from mocapidx.tasks.records import Record
from mocapidx.tasks.template_records import template_facts
from mocapidx.templates.designs import apply_design, parse_designs
from mocapidx.templates.edit import (
    combine_templates,
    mask_template,
    mirror_template,
    subtract_templates,
    with_keyframes,
)
from mocapidx.templates.file import load_templates, save_templates
from mocapidx.templates.template import MotionTemplate, TemplateSet
from mocapidx.toml_files import read_toml_text

__all__ = [
    "combine_classes",
    "design_templates",
    "edit_templates",
    "keyframe_class",
    "mask_class",
    "mirror_class",
    "shown_template",
    "subtract_classes",
    "template_features",
    "template_records",
]

NEW_RATE: Final = 30.0


def template_records(path: Path) -> list[Record]:
    """List the templates of a file, a record each.

    Parameters
    ----------
    path : Path
        A template file.

    Returns
    -------
    list of mapping
        In the order of the file.

    Raises
    ------
    StoreError
        If there is no such file, or it is damaged.
    """
    return [template_facts(template) for template in load_templates(path).templates]


def shown_template(path: Path, label: str) -> tuple[tuple[MotionTemplate, ...], FeatureSet]:
    """Load the templates of one class, and their features.

    Parameters
    ----------
    path : Path
        A template file.
    label : str
        The class.

    Returns
    -------
    templates : tuple of MotionTemplate
    feature_set : FeatureSet

    Raises
    ------
    ParameterError, StoreError
    """
    templates = load_templates(path)
    return templates.of(label), template_features(templates)


def template_features(templates: TemplateSet) -> FeatureSet:
    """Return the feature set that stands in a template file.

    Raises
    ------
    StoreError
        If it is none, or not that of the templates.
    """
    try:
        found = parse_feature_set(templates.feature_set_text, "the templates' feature set")
    except FeatureSetError as exc:
        raise StoreError(f"{exc}; make the template file again") from exc
    if any(each.matrix.shape[1] != len(found.features) for each in templates.templates):
        raise StoreError(
            "the templates have other features than their feature set; make them again"
        )
    return found


def mirror_class(path: Path, label: str, new_label: str, output: Path) -> None:
    """Add the mirror image of a class to the templates.

    Parameters
    ----------
    path : Path
        A template file.
    label : str
        The class.
    new_label : str
        Of its mirror image.
    output : Path
        The file that gets all templates, the new ones too; it may be `path`.

    Raises
    ------
    ParameterError
        If there is no such class, or one of the new name.
    StoreError, WriteError
    """
    templates = load_templates(path)
    permutation = template_features(templates).mirror
    mirrored = [mirror_template(each, permutation, new_label) for each in templates.of(label)]
    save_templates(output, _with(templates, mirrored, replacing=None))


def combine_classes(path: Path, labels: Sequence[str], new_label: str, output: Path) -> None:
    """Add one template learned from the templates of several classes.

    Parameters
    ----------
    path, output
        As for `mirror_class`.
    labels : sequence of str
        The classes, at least two.
    new_label : str
        Of the combined class.

    Raises
    ------
    ParameterError, StoreError, WriteError
    """
    templates = load_templates(path)
    combined = combine_templates(
        [each for label in dict.fromkeys(labels) for each in _class_templates(templates, label)],
        new_label,
    )
    save_templates(output, _with(templates, [combined], replacing=None))


def mask_class(
    path: Path,
    label: str,
    output: Path,
    *,
    features: str = "all",
    start: float | None = None,
    end: float | None = None,
    new_label: str | None = None,
) -> None:
    """Make some features of a class undecided, over some time.

    Parameters
    ----------
    path, output
        As for `mirror_class`.
    label : str
        The class.
    features : str
        As in `FeatureSet.select`.
    start, end : float, optional
        In seconds of the template; by default all of it.
    new_label : str, optional
        Leave the class as it is and add the masked one under this name.

    Raises
    ------
    ParameterError
        If there is no such class or feature, or both all features and all time are meant.
    StoreError, WriteError
    """
    templates = load_templates(path)
    feature_set = template_features(templates)
    mask = feature_set.select(features)
    if mask == (1 << len(feature_set.features)) - 1 and start is None and end is None:
        raise ParameterError("to mask all features at all times would leave nothing to match")
    masked = []
    for template in templates.of(label):
        first = 0 if start is None else round(start * template.rate)
        last = None if end is None else round(end * template.rate)
        frames = len(template.matrix)
        if first >= min(frames, frames if last is None else last):
            raise ParameterError(
                f"'{shown(label)}' lasts {frames / template.rate:.2f} s; nothing of it lies "
                "between --start and --end"
            )
        masked.append(mask_template(_named(template, new_label), mask, first, last))
    save_templates(output, _with(templates, masked, replacing=label if not new_label else None))


def subtract_classes(
    path: Path, label: str, others: Sequence[str], output: Path, new_label: str | None = None
) -> None:
    """Keep of a class what separates it from other classes.

    Parameters
    ----------
    path, output
        As for `mirror_class`.
    label : str
        The class.
    others : sequence of str
        The classes that it is mistaken for.
    new_label : str, optional
        Leave the class as it is and add what is left under this name.

    Raises
    ------
    ParameterError, StoreError, WriteError
    """
    templates = load_templates(path)
    if label in others:
        raise ParameterError(f"'{shown(label)}' can't be subtracted from itself")
    against = [
        each for other in dict.fromkeys(others) for each in _class_templates(templates, other)
    ]
    left = [
        subtract_templates(_named(template, new_label), against) for template in templates.of(label)
    ]
    save_templates(output, _with(templates, left, replacing=label if not new_label else None))


def keyframe_class(
    path: Path, label: str, keyframes: Sequence[int], tolerance: int, output: Path
) -> None:
    """Choose the keyframes of a class by hand.

    Parameters
    ----------
    path, output
        As for `mirror_class`.
    label : str
        The class.
    keyframes : sequence of int
        Frames of the class template; none: no preselection.
    tolerance : int
        Entries of a keyframe that may disagree.

    Raises
    ------
    ParameterError, StoreError, WriteError
    """
    templates = load_templates(path)
    chosen = [
        with_keyframes(each, keyframes, tolerance) if each.kind == "class" else each
        for each in templates.of(label)
    ]
    save_templates(output, _with(templates, chosen, replacing=label))


def edit_templates(path: Path, design_path: Path, output: Path) -> tuple[str, ...]:
    """Change templates as a TOML file says.

    Parameters
    ----------
    path, output
        As for `mirror_class`.
    design_path : Path
        See ``docs/template-editing.md`` for its form.

    Returns
    -------
    tuple of str
        The classes that were changed or added.

    Raises
    ------
    FormatError
        If the TOML file is wrong.
    ParameterError, StoreError, WriteError
    """
    return _designed(load_templates(path), design_path, output)


def design_templates(design_path: Path, output: Path) -> tuple[str, ...]:
    """Make templates without any training, as a TOML file says.

    Parameters
    ----------
    design_path : Path
        See ``docs/template-editing.md`` for its form.
    output : Path
        The template file to be made.

    Returns
    -------
    tuple of str
        The classes.

    Raises
    ------
    FeatureSetError, FormatError, ParameterError, WriteError
    """
    designs = parse_designs(read_toml_text(design_path), shown(design_path))
    feature_set = load_feature_set(designs.feature_set or "f39")
    empty = TemplateSet(
        (), feature_set.name, feature_set.digest, feature_set.text, designs.rate or NEW_RATE
    )
    return _designed(empty, design_path, output)


def _designed(templates: TemplateSet, design_path: Path, output: Path) -> tuple[str, ...]:
    feature_set = template_features(templates)
    designs = parse_designs(read_toml_text(design_path), shown(design_path))
    _check_settings(designs.feature_set, designs.rate, templates, shown(design_path))
    for design in designs.designs:
        if design.frames is None and not templates.templates:
            raise FormatError(f"{design.where}: key 'frames' is missing; a new template needs it")
        made = apply_design(design, templates, feature_set)
        replacing = design.label if design.frames is None and design.new_label is None else None
        templates = _with(templates, made, replacing)
    save_templates(output, templates)
    return tuple(
        design.label if design.new_label is None else design.new_label for design in designs.designs
    )


def _check_settings(
    feature_set: str | None, rate: float | None, templates: TemplateSet, where: str
) -> None:
    """Refuse a file that was meant for templates of another feature set or rate."""
    if feature_set is not None:
        digest = load_feature_set(feature_set).digest
        if digest != templates.feature_set_digest:
            raise FormatError(
                f"{where}: key 'feature_set': '{shown(feature_set)}', the templates have "
                f"'{shown(templates.feature_set_name)}'"
            )
    if rate is not None and rate != templates.rate:
        raise FormatError(f"{where}: key 'rate': {rate:g}, the templates have {templates.rate:g}")


def _class_templates(templates: TemplateSet, label: str) -> list[MotionTemplate]:
    """Return the templates that stand for a whole class, or all that it has."""
    found = templates.of(label)
    return [each for each in found if each.kind == "class"] or list(found)


def _named(template: MotionTemplate, label: str | None) -> MotionTemplate:
    return template if label is None else replace(template, label=label)


def _with(
    templates: TemplateSet, made: Iterable[MotionTemplate], replacing: str | None
) -> TemplateSet:
    """Put templates in the place of those of a class, or behind all others."""
    made = list(made)
    if replacing is None:
        if made[0].label in templates.labels:
            raise ParameterError(
                f"there is a class '{shown(made[0].label)}' already; choose another name"
            )
        return replace(templates, templates=(*templates.templates, *made))
    first = next(n for n, each in enumerate(templates.templates) if each.label == replacing)
    others = [each for each in templates.templates if each.label != replacing]
    return replace(templates, templates=(*others[:first], *made, *others[first:]))
