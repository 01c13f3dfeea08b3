"""Template files: the templates of several classes, saved and loaded."""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mocapidx.errors import ParameterError, StoreError
from mocapidx.printable import shown
from mocapidx.store.templates import read_templates, write_templates
from mocapidx.templates.template import MotionTemplate, TemplateSet

__all__ = ["load_templates", "save_templates"]

SET_FIELDS: Final = {
    "feature_set_name": (str,),
    "feature_set_digest": (str,),
    "feature_set_text": (str,),
    "rate": (float,),
}
FIELDS: Final[dict[str, tuple[type, ...]]] = {
    "label": (str,),
    "kind": (str,),
    "looping": (bool,),
    "delta": (float,),
    "mean_length": (float,),
    "passes": (int,),
    "documents": (list,),
    "spread": (list,),
    "keyframes": (list,),
    "keyframe_tolerance": (int,),
    "positive_cost": (float, type(None)),
    "background_cost": (float, type(None)),
    "tau": (float, type(None)),
}
ENTRIES: Final = {"documents": str, "spread": float, "keyframes": int}


def save_templates(path: Path, templates: TemplateSet) -> None:
    """Write templates to a file that is whole, or as it was before; equal ones give equal bytes.

    Parameters
    ----------
    path : Path
    templates : TemplateSet

    Raises
    ------
    ParameterError
        If there are too many for one file.
    WriteError
        If the file could not be written.
    """
    entries = [
        {name: _plain(getattr(template, name), kinds) for name, kinds in FIELDS.items()}
        for template in templates.templates
    ]
    meta = {name: getattr(templates, name) for name in SET_FIELDS} | {
        "rate": float(templates.rate),
        "templates": entries,
    }
    write_templates(path, meta, [template.matrix for template in templates.templates])


def _plain(value: Any, kinds: tuple[type, ...]) -> Any:
    """Give a value the one type that its field has in a file."""
    if isinstance(value, tuple):
        return [item.item() if isinstance(item, np.generic) else item for item in value]
    return value if value is None else kinds[0](value)


def load_templates(path: Path) -> TemplateSet:
    """Read templates from a file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    TemplateSet

    Raises
    ------
    StoreError
        If there is no such file, it is damaged, of another version, or its parts do not fit.
    """
    meta, matrices = read_templates(path)
    try:
        entries = _typed(meta, "templates", (list,))
        if len(entries) != len(matrices):
            raise ParameterError(f"{len(entries)} templates for {len(matrices)} matrices")
        known: dict[str, Any] = {
            name: _typed(meta, name, kinds) for name, kinds in SET_FIELDS.items()
        }
        templates = tuple(
            _template(entry, matrix, known["feature_set_digest"], known["rate"])
            for entry, matrix in zip(entries, matrices, strict=True)
        )
        return TemplateSet(templates, **known)
    except ParameterError as exc:
        raise StoreError(
            f"{shown(path)}: damaged ({exc}); make it again with 'mocapidx learn-mt'"
        ) from exc


def _template(entry: Any, matrix: NDArray[np.float64], digest: str, rate: float) -> MotionTemplate:
    if type(entry) is not dict:
        raise ParameterError("a template is no JSON object")
    values = {name: _typed(entry, name, kinds) for name, kinds in FIELDS.items()}
    for name, kind in ENTRIES.items():
        if any(type(value) is not kind for value in values[name]):
            raise ParameterError(f"'{name}' of a template holds values of a wrong type")
        values[name] = tuple(values[name])
    return MotionTemplate(
        matrix=matrix.astype(np.float64), feature_set_digest=digest, rate=rate, **values
    )


def _typed(tree: dict[str, Any], key: str, kinds: tuple[type, ...]) -> Any:
    value = tree.get(key)
    if key not in tree or type(value) not in kinds:
        raise ParameterError(f"'{key}' is missing or of a wrong type")
    return value
