"""Which kernels run: compiled ones where they were built, else NumPy's.

A kernel is one C file in this folder, ``matching.c``, built as ``mocapidx.kernels._matching``.
The module that owns the behaviour asks `compiled` for it and does the same in NumPy where the
answer is None; both ways give the same bits.
"""

import os
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Final

from mocapidx.errors import ParameterError
from mocapidx.printable import shown

__all__ = ["VARIABLE", "compiled", "instructions_in_use", "kernels_in_use"]

VARIABLE: Final = "MOCAPIDX_KERNELS"
"""Environment variable: ``numpy`` forces the fallback, ``c`` demands the compiled kernels."""

KERNELS: Final[tuple[str, ...]] = (
    "dtw",
    "kinematics",
    "matching",
    "path",
    "text",
    "sequences",
    "webs",
    "weighted",
)


@cache
def compiled(name: str) -> ModuleType | None:
    """Find a compiled kernel.

    Parameters
    ----------
    name : str
        Name of the C file without its suffix.

    Returns
    -------
    module or None
        None where it wasn't built, or the user asked for NumPy.

    Raises
    ------
    ParameterError
        If `VARIABLE` has an unknown value, or demands kernels that weren't built.
    """
    wanted = os.environ.get(VARIABLE, "")
    if wanted not in ("", "c", "numpy"):
        raise ParameterError(f"{VARIABLE} must be 'c' or 'numpy', got '{shown(wanted)}'")
    if wanted == "numpy":
        return None
    try:
        return import_module(f"mocapidx.kernels._{name}")
    except ImportError as exc:
        if wanted == "c":
            raise ParameterError(
                f"{VARIABLE} is 'c', but the kernel '{name}' wasn't built; install a C compiler "
                "and install mocapidx again"
            ) from exc
        return None


def kernels_in_use() -> str:
    """Name what runs.

    Returns
    -------
    {"c", "numpy", "c and numpy"}
        The last where some kernels couldn't be built.
    """
    found = [compiled(name) is not None for name in KERNELS]
    if found and all(found):
        return "c"
    return "c and numpy" if any(found) else "numpy"


def instructions_in_use() -> str:
    """Name the way in which templates are matched, the fastest that the processor has.

    Returns
    -------
    {"avx512", "avx2", "ssse3", "portable", "numpy"}
    """
    kernel = compiled("matching")
    return "numpy" if kernel is None else str(kernel.levels()[0])
