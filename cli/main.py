"""The program `mocapidx`: finds the command, shows errors as one line, gives the exit code.

Commands are imported when they run. Their one-line help stands in the table here, or
``mocapidx --help`` would import every command, and NumPy with it, to print it.
"""

import importlib
import os
import signal
import sys
from types import FrameType
from typing import Any, NoReturn

import click

from mocapidx.errors import Interrupted, MocapidxError, WriteError

__all__ = ["main"]

COMMANDS = {
    "index": ("index:index", "Read motion files and folders into a store."),
    "query": ("query:query", "Find every place in a store that moves like an example."),
    "learn-mt": ("learn_mt:learn_mt", "Learn a motion template for each label."),
    "retrieve": ("retrieve:retrieve", "Find all occurrences of a motion class, best first."),
    "annotate": ("annotate:annotate", "Say which motion class occurs when."),
    "template": ("template:template", "Look at motion templates and change them by hand."),
    "evaluate": ("evaluate:evaluate", "Measure hits or annotations against labels."),
    "plot": ("plot:plot", "Draw distance functions and annotations."),
    "info": ("info:info", "Show what a store holds, or what is known of one document."),
    "verify": ("verify:verify", "Check every byte of a store; repair what can be rebuilt."),
    "compact": ("compact:compact", "Merge the segment files of a store."),
    "reindex": ("reindex:reindex", "Make a store of another feature set from a store's poses."),
    "features": ("features:features", "Look at feature sets, try them, learn thresholds."),
    "align": ("align:align", "Say which frame of one motion goes with which of another."),
    "skeleton": ("skeleton:skeleton", "Show how a file's skeleton is understood, and why."),
}
STOP_SIGNALS = ("SIGTERM", "SIGHUP", "SIGINT")


class PipeClosedError(Exception):
    """Whoever reads our standard output has seen enough."""


class CommandGroup(click.Group):
    """A click group that imports a command only when it runs."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Name the commands, in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import the module of one command."""
        if cmd_name not in COMMANDS:
            return None
        module, _, name = COMMANDS[cmd_name][0].partition(":")
        command: click.Command = getattr(importlib.import_module(f"mocapidx_cli.{module}"), name)
        return command

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; a reader that went away gets an error of its own.

        Click would end the program with 1 where it sees a `BrokenPipeError`.
        """
        try:
            return super().invoke(ctx)
        except BrokenPipeError as exc:
            raise PipeClosedError from exc

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands from the table, importing none."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])


@click.group(
    cls=CommandGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Start with: mocapidx index MY_TAKES --store takes.store",
)
@click.version_option(package_name="mocapidx", prog_name="mocapidx")
@click.option("--debug", is_flag=True, help="Show a traceback where something fails.")
def mocapidx(debug: bool) -> None:
    """Search an archive of motion capture by what happens in it."""


def fail(message: str, code: int) -> NoReturn:
    """Print one line on stderr and leave with the exit code."""
    click.echo(f"Error: {' '.join(message.split())}", err=True)
    leave(code)


def leave(code: int) -> NoReturn:
    """Flush the standard streams, silently if nobody reads them any more, and exit."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except OSError as exc:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        click.echo(f"Error: could not write to the standard output: {exc.strerror}", err=True)
        code = WriteError.exit_code
    sys.exit(code)


def stop(signal_number: int, frame: FrameType | None) -> None:
    """Raise `Interrupted` at the first signal; the second one ends the process at once."""
    for name in STOP_SIGNALS:
        signal.signal(getattr(signal, name), lambda number, _: os._exit(128 + number))
    raise Interrupted(signal_number)


def listen_to_signals() -> None:
    """Turn Ctrl-C, SIGTERM and SIGHUP into `Interrupted`, unless they are ignored (nohup)."""
    for name in STOP_SIGNALS:
        number = getattr(signal, name)
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, stop)


def main() -> None:
    """Run the program; the entry point of the installed script."""
    listen_to_signals()
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    debug = "--debug" in sys.argv[1:2]
    try:
        result: Any = mocapidx.main(prog_name="mocapidx", standalone_mode=False)
        sys.stdout.flush()
    except click.exceptions.NoArgsIsHelpError as exc:
        click.echo(exc.format_message(), err=True)
        leave(2)
    except click.UsageError as exc:
        command = exc.ctx.command_path if exc.ctx else "mocapidx"
        fail(f"{exc.format_message()} (see '{command} --help')", 2)
    except click.ClickException as exc:
        fail(exc.format_message(), exc.exit_code)
    except MocapidxError as exc:
        if debug:
            raise
        fail(str(exc), exc.exit_code)
    except (Interrupted, KeyboardInterrupt, click.Abort) as exc:
        number = exc.signal_number if isinstance(exc, Interrupted) else signal.SIGINT
        fail(str(exc) or "interrupted; nothing was written", 128 + number)
    except PipeClosedError:
        leave(0)
    except OSError as exc:
        if debug:
            raise
        where = f"{exc.filename}: " if exc.filename else ""
        fail(f"{where}{exc.strerror or exc}", WriteError.exit_code)
    except Exception as exc:
        if debug:
            raise
        fail(f"{type(exc).__name__}: {exc}; 'mocapidx --debug ...' shows where it happened", 1)
    leave(result if isinstance(result, int) else 0)
