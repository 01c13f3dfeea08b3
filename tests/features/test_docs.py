"""The page on feature sets says what the shipped files say."""

import re
from pathlib import Path

import pytest

from mocapidx.features.featureset import load_feature_set, parse_feature_set, shipped_sets
from mocapidx.features.kinds import KINDS, UNITS
from mocapidx.features.relations import COMBINATIONS

PAGE = (Path(__file__).parents[2] / "docs" / "features.md").read_text(encoding="utf-8")


def formula(condition):
    places = ["-".join(p) if isinstance(p, tuple) else p for p in condition.joints]
    if condition.kind not in COMBINATIONS:
        return f"{condition.kind}({', '.join(places)})"
    return f"{condition.kind.replace('_', ' ')} " + ", ".join(map(formula, condition.of))


def limits(condition):
    """The threshold columns; the parts of a combination share theirs in the shipped sets."""
    if condition.of:
        assert len({limits(part) for part in condition.of}) == 1
        return limits(condition.of[0])
    sign = {"above": "> ", "below": "< ", "within": ""}[condition.when]

    def shown(threshold):
        if isinstance(threshold, tuple):
            return f"[{threshold[0]:g}, {threshold[1]:g}]"
        return f"{sign}{threshold:g}"

    return f"{shown(condition.on)} | {shown(condition.off)} | {condition.unit}"


def table(name):
    """One row for each feature or pair, right version first, as the page has it."""
    rows = []
    for feature in load_feature_set(name).features:
        if feature.name.startswith(("left", "shoulders rotated left")):
            continue
        key = feature.id if feature.mirror == feature.id else f"{feature.id} / {feature.mirror}"
        rows.append(
            f"| {key} | {feature.part} | {feature.name} | {formula(feature.condition)} | "
            f"{limits(feature.condition)} |"
        )
    return rows


@pytest.mark.parametrize("name", shipped_sets())
def test_the_page_has_a_row_for_each_feature_and_no_other(name):
    section = PAGE.split(f"\n## `{name}`", 1)[1].split("\n## ", 1)[0]
    rows = [line for line in section.splitlines() if re.match(r"\| [A-Z]\d", line)]
    assert rows == table(name)


def test_the_page_names_every_kind_and_unit():
    for word in (*KINDS, *COMBINATIONS, *(unit for units in UNITS.values() for unit in units)):
        assert f"`{word}" in PAGE, word


def test_the_example_of_the_page_is_a_feature_set():
    example = re.search(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert example is not None
    own = parse_feature_set(example.group(1), "docs/features.md")
    assert own.mirror.tolist() == [1, 0, 2, 4, 3]
