"""What a motion is steered by, as a user gives it: a TOML file, or a function of a Python file.

A Python file runs with all that its owner may do; it is opened only where a user names it in a
command, never because a space file says so.
"""

import importlib.util
import re
from pathlib import Path
from typing import Final

from mocapidx.errors import FormatError
from mocapidx.printable import shown
from mocapidx.synthesis.parameters import Parameters, parse_parameters
from mocapidx.synthesis.spaces import MotionFunction
from mocapidx.toml_files import read_toml_text

__all__ = ["load_parameters"]

FUNCTION: Final = re.compile(r"(.+\.py):([A-Za-z_][A-Za-z0-9_]*)", re.DOTALL)
HINT: Final = "; name a TOML file, or FILE.py:FUNCTION"


def load_parameters(spec: str) -> Parameters | MotionFunction:
    """Read what a motion is steered by.

    Parameters
    ----------
    spec : str
        The path of a TOML file, or ``FILE.py:FUNCTION``; the Python file is run.

    Returns
    -------
    Parameters or callable
        A callable takes a `Motion` and returns one number or a sequence of them.

    Raises
    ------
    FormatError
        If the file can't be used; the message says what is wrong in it.
    """
    found = FUNCTION.fullmatch(spec)
    if found is not None:
        return _function(Path(found[1]), found[2])
    if spec.endswith(".py"):
        raise FormatError(f"{shown(spec, None)}: name a function of it too, as in FILE.py:FUNCTION")
    return parse_parameters(read_toml_text(spec, FormatError, HINT), shown(spec, None))


def _function(path: Path, name: str) -> MotionFunction:
    where = shown(path, None)
    if not path.is_file():
        raise FormatError(f"{where}: no such file{HINT}")
    spec = importlib.util.spec_from_file_location("mocapidx_user_parameters", path)
    if spec is None or spec.loader is None:
        raise FormatError(f"{where}: not a Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as exc:
        raise FormatError(f"{where}: failed with {type(exc).__name__}: {shown(exc, 200)}") from exc
    function = getattr(module, name, None)
    if not callable(function):
        raise FormatError(f"{where}: has no function '{shown(name, 40)}'")
    chosen: MotionFunction = function
    return chosen
