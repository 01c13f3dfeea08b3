"""How pictures look, and how they become bytes: equal input gives equal bytes."""

import io
import logging
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from mocapidx.errors import ParameterError, WriteError
from mocapidx.printable import shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "ACCENT",
    "FAINT",
    "FORMATS",
    "INCHES_A_CHARACTER",
    "INK",
    "class_colours",
    "drawing",
    "new_figure",
    "picture_format",
    "render",
]

FORMATS: Final = ("png", "svg")
INK: Final = "#222222"
FAINT: Final = "#8a8a8a"
ACCENT: Final = "#0072b2"
DPI: Final = 150
INCHES_A_CHARACTER: Final = 0.063
"""Width of small letters, to leave room for names."""
INCHES_A_TITLE_CHARACTER: Final = 0.105

CLASS_COLOURS: Final = (
    "#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377",
    "#ee8866", "#44bb99", "#882255", "#999933", "#332288", "#ddcc77",
)  # fmt: skip
"""Told apart by the colour-blind as far as a dozen colours can be (after Paul Tol)."""

SHADES: Final = ((0, 0.0), (0, 0.4), (255, 0.4))
"""For each dozen of classes: mixed with black or white, and how much of it."""

STYLE: Final[dict[Any, Any]] = {
    "figure.dpi": DPI,
    "savefig.dpi": DPI,
    "font.family": "DejaVu Sans",  # comes with matplotlib, so it is the same everywhere
    "font.size": 8.0,
    "axes.titlesize": 9.0,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "text.color": INK,
    "text.parse_math": False,  # a dollar in a name is a dollar
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "svg.fonttype": "path",  # names are drawn, never text or markup of the file
    "svg.hashsalt": "mocapidx",
    "path.simplify": True,
}


@contextmanager
def drawing() -> Iterator[None]:
    """Draw in our own style, whatever the user's settings are, and without remarks."""
    # Where the home folder can't be written, matplotlib would say so on stderr.
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    try:
        import matplotlib
        import matplotlib.font_manager
    except OSError as exc:
        raise WriteError(
            "matplotlib, which draws, needs a folder to write to, and may neither write to the "
            "home folder nor to one for temporary files; set MPLCONFIGDIR to a folder"
        ) from exc
    with warnings.catch_warnings(), matplotlib.rc_context():
        warnings.simplefilter("ignore")  # a name may have letters that the font lacks
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


def new_figure(width: float, height: float, title: str) -> "Figure":
    """Begin a figure of a size in inches; no display, no global state."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    fitting = int((width - 0.2) / INCHES_A_TITLE_CHARACTER)
    figure.suptitle(shown(title, fitting), x=0.008, ha="left", fontsize=11.0, fontweight="bold")
    return figure


def picture_format(path: Path) -> str:
    """Return how a picture is to be written, to be asked before any work is done.

    Parameters
    ----------
    path : Path
        Of the picture.

    Returns
    -------
    {"png", "svg"}

    Raises
    ------
    ParameterError
        If its suffix is another.
    """
    suffix = path.suffix.lower().lstrip(".")
    if suffix not in FORMATS:
        raise ParameterError(f"{shown(path)}: pictures are .png or .svg files")
    return suffix


def render(figure: "Figure", suffix: str) -> bytes:
    """Turn a figure into the bytes of a file.

    Parameters
    ----------
    figure : Figure
        Made within `drawing`, and rendered there too.
    suffix : str
        ``png`` or ``svg``; a dot before it and upper case do not matter.

    Returns
    -------
    bytes

    Raises
    ------
    ParameterError
        If it is another suffix.
    """
    kind = suffix.lower().lstrip(".")
    if kind not in FORMATS:
        raise ParameterError(f"pictures are .png or .svg files, not '{suffix}'")
    metadata = {"Software": None} if kind == "png" else {"Date": None, "Creator": None}
    sheet = io.BytesIO()
    figure.savefig(sheet, format=kind, metadata=metadata)
    return sheet.getvalue()


def class_colours(labels: Iterable[str]) -> dict[str, str]:
    """Give each class a colour, by the order of the names; 36 classes have colours of their own."""
    return {label: _colour(number) for number, label in enumerate(sorted(set(labels)))}


def _colour(number: int) -> str:
    dozen, place = divmod(number, len(CLASS_COLOURS))
    other, share = SHADES[dozen % len(SHADES)]
    parts = (int(CLASS_COLOURS[place][at : at + 2], 16) for at in (1, 3, 5))
    return "#" + "".join(f"{round(part + share * (other - part)):02x}" for part in parts)
