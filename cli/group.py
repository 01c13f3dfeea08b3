"""The group of commands: finds one, runs it, and shows what goes wrong as one line."""

import errno
import importlib
import os
from pathlib import Path
from typing import Any

import click

from mocapidx.errors import Interrupted, MocapidxError, WriteError
from mocapidx.printable import meant

from .main import COMMANDS, SECTIONS, fail, heard
from .settings import defaults, load, settings_options

__all__ = ["mocapidx", "run"]

OUTPUT_ERRORS = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EBADF, errno.EIO})


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

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command of the arguments, or name the one that may be meant."""
        name = args[0]
        if name not in COMMANDS and not name.startswith("-") and not ctx.resilient_parsing:
            ctx.fail(f"there is no command '{name}'{meant(name, COMMANDS)}")
        return super().resolve_command(ctx, args)

    def make_context(self, *args: Any, **options: Any) -> click.Context:
        """Read the arguments; a reader of the help that went away gets an error of its own.

        Click would end the program with 1 where it sees a `BrokenPipeError`.
        """
        try:
            return super().make_context(*args, **options)
        except BrokenPipeError as exc:
            raise PipeClosedError from exc

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command, likewise."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError as exc:
            raise PipeClosedError from exc

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[Any]:
        """Complete the names in the table, importing no command."""
        from click.shell_completion import CompletionItem

        return [
            *(
                CompletionItem(name, help=text)
                for name, (_, text) in COMMANDS.items()
                if name.startswith(incomplete)
            ),
            *click.Command.shell_complete(self, ctx, incomplete),
        ]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the commands from the table, a section for each purpose, importing none."""
        width = max(map(len, COMMANDS))
        for title, commands in SECTIONS.items():
            with formatter.section(title):
                formatter.write_dl([(f"{n:{width}}", text) for n, (_, text) in commands.items()])


@click.group(
    cls=CommandGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Start with: mocapidx index MY_TAKES --store takes.store\n\n"
    "More of a command: mocapidx query --help",
)
@click.version_option(package_name="mocapidx", prog_name="mocapidx")
@click.option("--debug", is_flag=True, help="Show a traceback where something fails.")
@click.option(
    "--untrusted",
    is_flag=True,
    help="Read files of strangers: at most 2 GiB and 600 s, or exit code 4.",
)
@settings_options
@click.pass_context
def mocapidx(
    ctx: click.Context, debug: bool, untrusted: bool, config: Path | None, no_config: bool
) -> None:
    """Search an archive of motion capture by what happens in it."""
    if untrusted and not ctx.obj:  # an option before it has the name of a command for its value
        raise click.UsageError("--untrusted must be the first option")
    ctx.obj = load(config, no_config)
    if ctx.obj is not None and isinstance(ctx.command, click.Group):
        ctx.default_map = defaults(ctx.command, ctx, ctx.obj)


def run(debug: bool, is_limited: bool) -> int:
    """Run the command that the arguments name; give its exit code."""
    try:
        result: Any = mocapidx.main(prog_name="mocapidx", standalone_mode=False, obj=is_limited)
    except click.exceptions.NoArgsIsHelpError as exc:
        click.echo(exc.format_message(), err=True)
        return 2
    except click.UsageError as exc:
        command = exc.ctx.command_path if exc.ctx else "mocapidx"
        fail(f"{one_line(exc)} (see '{command} --help')", 2)
    except click.ClickException as exc:
        fail(one_line(exc), exc.exit_code)
    except MocapidxError as exc:
        if debug:
            raise
        fail(str(exc), exc.exit_code)
    except PipeClosedError:
        return 0
    except OSError as exc:
        if debug:
            raise
        fail(f"{place(exc)}{(exc.strerror or str(exc)).lower()}", WriteError.exit_code)
    except MemoryError:
        if debug:
            raise
        fail("out of memory; what is saved is whole; run again where there is more, or on less", 1)
    except Exception as exc:
        if debug:
            raise
        if heard:  # libraries in C make an ImportError of a stop while they are loaded
            raise Interrupted(heard[0]) from exc
        fail(f"{type(exc).__name__}: {exc}; 'mocapidx --debug ...' shows where it happened", 1)
    return result if isinstance(result, int) else 0


def one_line(error: click.ClickException) -> str:
    """Put click's message on one line."""
    return " ".join(error.format_message().split())


def place(error: OSError) -> str:
    """Say where the system refused something; what has no name is the folder or our output."""
    if error.filename:
        return f"{os.fsdecode(error.filename)}: "
    if isinstance(error, FileNotFoundError):
        return "the working directory: "
    return "could not write to the standard output: " if error.errno in OUTPUT_ERRORS else ""
