"""Features in words and formulas, as the documentation writes them."""

from mocapidx.features.kinds import Place
from mocapidx.features.relations import COMBINATIONS, Condition, Threshold

__all__ = ["common_threshold", "formula_text", "threshold_text"]

WORDS = {"all_of": "all of", "any_of": "any of", "not": "not"}
SIGNS = {"above": "> ", "below": "< ", "within": ""}


def formula_text(condition: Condition) -> str:
    """Write what a condition measures.

    Parameters
    ----------
    condition : Condition

    Returns
    -------
    str
        Such as ``touch(rwrist, neck-head)``; the parts of a combination have their thresholds
        with them where they differ.
    """
    if condition.kind not in COMBINATIONS:
        return f"{condition.kind}({', '.join(map(_place_text, condition.joints))})"
    alike = common_threshold(condition) is not None
    parts = [
        formula_text(part) if alike or part.kind in COMBINATIONS else _whole_text(part)
        for part in condition.of
    ]
    return f"{WORDS[condition.kind]} ({', '.join(parts)})"


def threshold_text(condition: Condition, *, strong: bool) -> str:
    """Write one of the two thresholds of a condition, without its unit.

    Parameters
    ----------
    condition : Condition
    strong : bool
        The one that turns it on, else the one that keeps it on.

    Returns
    -------
    str
        Such as ``> 1.2`` or ``[0, 110]``; empty where the parts of a combination differ.
    """
    leaf = common_threshold(condition)
    if leaf is None:
        return ""
    return SIGNS[leaf.when] + _number_text(leaf.on if strong else leaf.off)


def common_threshold(condition: Condition) -> Condition | None:
    """Return a generic feature of a condition, if all that it is made of have its thresholds.

    Parameters
    ----------
    condition : Condition

    Returns
    -------
    Condition or None
        None if they differ, or something is denied.
    """
    if condition.kind not in COMBINATIONS:
        return condition
    found = [common_threshold(part) for part in condition.of]
    first = found[0]
    if condition.kind == "not" or first is None:
        return None
    told = (first.unit, first.when, first.on, first.off)
    same = all(part and (part.unit, part.when, part.on, part.off) == told for part in found)
    return first if same else None


def _whole_text(leaf: Condition) -> str:
    return f"{formula_text(leaf)} {threshold_text(leaf, strong=True)} {leaf.unit}"


def _place_text(place: Place) -> str:
    return place if isinstance(place, str) else "-".join(place)


def _number_text(threshold: Threshold) -> str:
    if isinstance(threshold, tuple):
        return f"[{threshold[0]:g}, {threshold[1]:g}]"
    return f"{threshold:g}"
