"""The motion template: what the examples of a motion class have in common, and what not."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from mocapidx.errors import ParameterError
from mocapidx.markup import facts_html, grey_picture_html
from mocapidx.model import FloatArray
from mocapidx.printable import meant, shown

__all__ = ["DELTA", "TAU", "Kind", "MotionTemplate", "TemplateSet"]

DELTA = 0.1
TAU = 0.06
LONGEST_TEMPLATE = 4096

Kind: TypeAlias = Literal["class", "stretch"]


@dataclass(frozen=True, slots=True, eq=False)
class MotionTemplate:
    """A motion class as a matrix: rows are frames, columns are features.

    Parameters
    ----------
    label : str
        The motion class.
    matrix : ndarray of float64, shape (K, F)
        The share of the examples in which a feature holds at a time: 0 and 1 where the examples
        agree. At most 64 features.
    feature_set_digest : str
        The feature set that the columns belong to.
    rate : float
        Frames a second, in Hz.
    delta : float
        Entries below `delta` count as 0 and above ``1 - delta`` as 1, the others as undecided.
    mean_length : float
        Mean length of the examples in frames.
    passes : int
        Rounds of mutual warping that learning took.
    documents : tuple of str
        The examples: a document, or ``document@start:end`` in seconds.
    spread : tuple of float
        The distance of each example to the template (`mocapidx.templates.learn.Learned`).
    keyframes : tuple of int
        Rows that stand for the whole in a preselection, ascending; empty: none were chosen.
    keyframe_tolerance : int
        Entries of a keyframe that may disagree in a preselection.
    positive_cost, background_cost : float or None
        What the template's own class and everything else costs it; None: not known.
    tau : float or None
        The class's own threshold; None: there was nothing to base one on.
    kind : {"class", "stretch"}
        Whether the template stands for the class, or for one labelled stretch of repetitions.
    looping : bool
        Whether the examples were repetitions, so that the end goes on at the beginning.

    Raises
    ------
    ParameterError
        If a value is out of its range.
    """

    label: str
    matrix: FloatArray
    feature_set_digest: str
    rate: float
    delta: float = DELTA
    mean_length: float = 0.0
    passes: int = 0
    documents: tuple[str, ...] = ()
    spread: tuple[float, ...] = ()
    keyframes: tuple[int, ...] = ()
    keyframe_tolerance: int = 0
    positive_cost: float | None = None
    background_cost: float | None = None
    tau: float | None = None
    kind: Kind = "class"
    looping: bool = False

    def _repr_html_(self) -> str:
        """Show the template in a notebook: rows are features, columns are frames, white is 1."""
        frames, features = self.matrix.shape
        decided = float(np.mean((self.matrix < self.delta) | (self.matrix > 1 - self.delta)))
        facts = {
            "length": f"{frames} frames at {self.rate:g} Hz, {frames / self.rate:.2f} s",
            "features": features,
            "decided": f"{decided:.0%} of the entries",
            "examples": len(self.documents),
            "threshold": f"{self.threshold:.3f}",
        }
        picture = grey_picture_html(
            self.matrix.T, min(4 * frames, 900), 6 * features, f"template of {self.label}"
        )
        return facts_html(f"Motion template: {self.label}", facts) + picture

    def __post_init__(self) -> None:
        shape, where = self.matrix.shape, f"template '{shown(self.label)}'"
        if len(shape) != 2 or not (1 <= shape[0] <= LONGEST_TEMPLATE and 1 <= shape[1] <= 64):
            raise ParameterError(
                f"{where}: the matrix must have 1 to {LONGEST_TEMPLATE} frames and 1 to 64 "
                f"features, got the shape {shape}"
            )
        if (
            self.matrix.dtype != np.float64
            or not ((self.matrix >= 0.0) & (self.matrix <= 1.0)).all()
        ):
            raise ParameterError(f"{where}: the entries must be float64 between 0 and 1")
        if not 0.0 < self.delta < 0.5:
            raise ParameterError(f"{where}: delta must lie between 0 and 0.5, got {self.delta}")
        if not (np.isfinite(self.rate) and self.rate > 0):
            raise ParameterError(f"{where}: the rate must be positive, got {self.rate} Hz")
        if self.kind not in ("class", "stretch"):
            kind = shown(self.kind, 40)
            raise ParameterError(f"{where}: the kind must be 'class' or 'stretch', not '{kind}'")
        if list(self.keyframes) != sorted({*self.keyframes} & {*range(shape[0])}):
            raise ParameterError(
                f"{where}: keyframes must be different, ascending and from 0 to {shape[0] - 1}, "
                f"got {list(self.keyframes)}"
            )

    @property
    def threshold(self) -> float:
        """The class's own threshold, or the paper's 0.06 where it has none."""
        return TAU if self.tau is None else self.tau


@dataclass(frozen=True, slots=True)
class TemplateSet:
    """The templates of several classes over one feature set, as they stand in one file.

    Parameters
    ----------
    templates : tuple of MotionTemplate
    feature_set_name, feature_set_digest, feature_set_text : str
        The feature set, and its whole text, so that motion files can be read for it.
    rate : float
        Frames a second of all templates, in Hz.

    Raises
    ------
    ParameterError
        If a template is of another feature set or rate.
    """

    templates: tuple[MotionTemplate, ...]
    feature_set_name: str
    feature_set_digest: str
    feature_set_text: str
    rate: float

    def __post_init__(self) -> None:
        for template in self.templates:
            if (template.feature_set_digest, template.rate) != (self.feature_set_digest, self.rate):
                raise ParameterError(
                    f"template '{shown(template.label)}' is of another feature set or rate "
                    "than the rest"
                )

    @property
    def labels(self) -> tuple[str, ...]:
        """The classes, each once, in the order of their first template."""
        return tuple(dict.fromkeys(template.label for template in self.templates))

    def of(self, label: str) -> tuple[MotionTemplate, ...]:
        """Return the templates of one class.

        Raises
        ------
        ParameterError
            If there is none; the message names the classes there are.
        """
        found = tuple(template for template in self.templates if template.label == label)
        if not found:
            raise ParameterError(
                f"no template of a class '{shown(label)}'; there are: "
                f"{', '.join(map(shown, self.labels))}{meant(label, self.labels)}"
            )
        return found
