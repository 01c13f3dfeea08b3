"""The program `mocapidx`: standard streams, signals, and how it all ends.

Click is imported only after the signals are heard, and each command only when it runs. Their
one-line help stands in the table here, or ``mocapidx --help`` would import every command, and
NumPy with it, to print it.
"""

import contextlib
import os
import signal
import sys
from itertools import takewhile
from types import FrameType
from typing import Any, NoReturn

from mocapidx.errors import Interrupted, StoreError, WriteError
from mocapidx.printable import shown

__all__ = ["COMMANDS", "SECTIONS", "fail", "heard", "main", "say"]

SECTIONS = {
    "Take in motion": {
        "index": ("index:index", "Read motion files and folders into a store."),
        "doctor": ("doctor:doctor", "Examine motion files: what is recognised, what is not sound."),
        "skeleton": ("skeleton:skeleton", "Show how a file's skeleton is understood, and why."),
    },
    "Find what is like an example": {
        "query": ("query:query", "Find every place in a store that moves like an example."),
        "web": ("web:web", "Compare all motion of a store, for 'match' to search in."),
        "match": ("match:match", "Find what moves like a stretch, through what is in between."),
    },
    "Learn motion classes, find them": {
        "learn-mt": ("learn_mt:learn_mt", "Learn a motion template for each label."),
        "retrieve": ("retrieve:retrieve", "Find all occurrences of a motion class, best first."),
        "annotate": ("annotate:annotate", "Say which motion class occurs when."),
        "evaluate": ("evaluate:evaluate", "Measure hits or annotations against labels."),
        "template": ("template:template", "Look at motion templates and change them by hand."),
        "features": ("features:features", "Look at feature sets, try them, learn thresholds."),
    },
    "Look": {
        "report": ("report:report", "Write a page on which hits and annotations move."),
        "plot": ("plot:plot", "Draw features, lists, templates, distances, annotations."),
        "align": ("align:align", "Say which frame of one motion goes with which of another."),
        "info": ("info:info", "Show what a store holds, or what is known of one document."),
    },
    "Take along": {
        "export": ("export:export", "Take hits along: clips, or annotations for other programs."),
        "blend": ("blend:blend", "Make new motion from found motion: steered blends."),
    },
    "Look after stores": {
        "verify": ("verify:verify", "Check every byte of a store; repair what can be rebuilt."),
        "merge": ("merge:merge", "Join stores that independent jobs built."),
        "remove": ("remove:remove", "Take documents out of a store."),
        "compact": ("compact:compact", "Merge the segment files of a store."),
        "reindex": ("reindex:reindex", "Make a store of another feature set from a store's poses."),
    },
    "The program itself": {
        "config": ("config:config", "Show settings from files, and where each value comes from."),
        "completion": ("completion:completion", "Make a shell complete commands and options."),
        "man": ("man:man", "Write the manual pages."),
    },
}
COMMANDS = {name: row for section in SECTIONS.values() for name, row in section.items()}
COLOURS = {"Error": "1;31", "Warning": "1;33"}  # bold red and yellow
heard: list[int] = []  # the signal that asked us to stop
STOP_SIGNALS = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)


def say(message: str) -> None:
    """Print one line on stderr, with nothing in it that could steer a terminal.

    Where nobody can hear it, the exit code still tells.
    """
    text = shown(message, None)
    kind, colon, rest = text.partition(":")
    if colon and kind in COLOURS and coloured():
        text = f"\x1b[{COLOURS[kind]}m{kind}:\x1b[0m{rest}"
    with contextlib.suppress(OSError):
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()


def coloured() -> bool:
    """Whether words on stderr may have colours: on a terminal, unless NO_COLOR is set."""
    wanted = not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return wanted and sys.stderr.isatty()


def fail(message: str, code: int) -> NoReturn:
    """Print one line on stderr and leave with the exit code."""
    say(f"Error: {message}")
    leave(code)


def leave(code: int) -> NoReturn:
    """Flush the standard output, silently if nobody reads it any more, and exit."""
    try:
        sys.stdout.flush()
    except OSError as exc:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if code == 0 and not isinstance(exc, BrokenPipeError):  # else one line was said already
            say(f"Error: could not write to the standard output: {(exc.strerror or '').lower()}")
            code = WriteError.exit_code
    signal.setitimer(signal.ITIMER_REAL, 0)
    for number in STOP_SIGNALS:  # whoever asks us to stop from now on has what he wants
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: os._exit(code))
    sys.exit(code)


def stop(signal_number: int, frame: FrameType | None) -> None:
    """Raise `Interrupted` at the first signal; the second one ends the process at once."""
    for number in STOP_SIGNALS:
        signal.signal(number, lambda number, _: os._exit(128 + number))
    heard.append(signal_number)
    raise Interrupted(signal_number)


def stop_again(unraisable: Any) -> None:
    """Raise `Interrupted` once more where Python has to swallow it, as in the end of an object."""
    swallowed = unraisable.exc_value
    if not isinstance(swallowed, Interrupted):
        sys.__unraisablehook__(unraisable)
        return

    def again(number: int, frame: FrameType | None) -> None:
        raise Interrupted(swallowed.signal_number)

    signal.signal(signal.SIGALRM, again)
    signal.setitimer(signal.ITIMER_REAL, 0.001)


def listen_to_signals() -> None:
    """Turn Ctrl-C, SIGTERM and SIGHUP into `Interrupted`, unless they are ignored (nohup)."""
    sys.unraisablehook = stop_again
    for number in STOP_SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, stop)


def open_streams() -> None:
    """Let the standard streams take any character; give those that are closed a place.

    Files that we open would get their numbers. Writing to a closed output stays an error.
    """
    for number, mode in enumerate((os.O_RDONLY, os.O_RDONLY, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, mode), True)
    sys.stdout = sys.stdout or os.fdopen(1, "w", encoding="utf-8")
    sys.stderr = sys.stderr or os.fdopen(2, "w", encoding="utf-8")
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]


def wait_for_child() -> None:
    """Go on in a child with limits; the parent leaves with the child's exit code."""
    from mocapidx.tasks.untrusted import in_limited_child

    try:
        code = in_limited_child()
    except StoreError as exc:
        fail(str(exc), exc.exit_code)
    except OSError as exc:  # no more processes
        fail(f"the process for untrusted files could not be started: {exc.strerror}", 1)
    if code is not None:
        leave(code)


def main() -> NoReturn:
    """Run the program; the entry point of the installed script."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # else NumPy starts a thread for each core
    try:
        listen_to_signals()
        open_streams()
        before = [*takewhile(lambda word: word not in COMMANDS, sys.argv[1:])]
        if "--untrusted" in before:
            wait_for_child()
        from .group import run

        leave(run(debug="--debug" in before, is_limited="--untrusted" in before))
    except (Interrupted, KeyboardInterrupt) as exc:
        from mocapidx.tasks.farewell import farewell

        number = exc.signal_number if isinstance(exc, Interrupted) else signal.SIGINT
        fail(str(exc) or farewell(), 128 + number)
