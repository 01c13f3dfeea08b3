"""Which frame rates a motion file may have."""

from typing import Final

__all__ = ["EXPECTED", "is_rate"]

SLOWEST, FASTEST = 0.1, 10_000.0  # Hz
EXPECTED: Final = f"between {SLOWEST:g} and {FASTEST:g}"


def is_rate(rate: float) -> bool:
    """Tell whether a number can be the frames a second of a recording; NaN can't."""
    return SLOWEST <= rate <= FASTEST
