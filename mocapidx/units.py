"""Lengths in metres: the units that motion files come in."""

from typing import Final

__all__ = ["ACCLAIM", "INCH", "LENGTHS"]

INCH: Final = 0.0254  # metres, by definition
ACCLAIM: Final = INCH / 0.45  # CMU's and HDM05's `length 0.45`: inches times 0.45
LENGTHS: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": INCH, "acclaim": ACCLAIM}
