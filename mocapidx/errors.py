"""The errors a user can cause, each with the exit code that the commands give it."""

from typing import ClassVar

__all__ = [
    "FeatureSetError",
    "FormatError",
    "Interrupted",
    "LockedError",
    "MocapidxError",
    "ParameterError",
    "StoreError",
    "WriteError",
]


class MocapidxError(Exception):
    """Root of every error that mocapidx raises on purpose, for a person to read.

    The message is one line: which file, where in it, what was found, what to do.
    """

    exit_code: ClassVar[int] = 1


class ParameterError(MocapidxError, ValueError):
    """An argument has a wrong shape, range or combination."""

    exit_code = 2


class FormatError(MocapidxError):
    """An input file could not be used: not of its format, cut off, or out of bounds."""

    exit_code = 3


class FeatureSetError(MocapidxError):
    """A feature-set or joint-map file is wrong; the message names the entry and the key."""

    exit_code = 3


class StoreError(MocapidxError):
    """A store or template file is damaged, of another version or of another feature set."""

    exit_code = 4


class LockedError(MocapidxError):
    """A store is being written by somebody else, or can't be locked at all."""

    exit_code = 6


class WriteError(MocapidxError):
    """Something could not be written; what was there before is unchanged unless said."""

    exit_code = 7


class Interrupted(BaseException):
    """A signal asked the program to stop; like `KeyboardInterrupt` no error to be handled.

    Parameters
    ----------
    signal_number : int
        The signal; the exit code is 128 more.
    message : str
        What was done before, for a person to read.
    """

    def __init__(self, signal_number: int, message: str = "") -> None:
        super().__init__(message)
        self.signal_number = signal_number
