"""The command `man`."""

from collections.abc import Iterator
from pathlib import Path

import click

from mocapidx.printable import count

from .config import all_commands
from .main import COMMANDS
from .rows import note

__all__ = ["man", "manual_page"]

ENDS = (
    ("0", "done, also where nothing was found"),
    ("2", "wrong usage"),
    ("3", "an input file could not be used"),
    ("4", "a store or template file is damaged, of another version or of another feature set"),
    ("5", "done, but some inputs were passed over (--skip-bad)"),
    ("6", "another writer has locked the store"),
    ("7", "could not write; what was there before is unchanged"),
    ("129, 130, 143", "lost its terminal, interrupted, terminated"),
)


@click.command()
@click.option(
    "--output",
    required=True,
    type=click.Path(file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Where the pages go: its subfolder man1, which is made.",
)
def man(output: Path) -> None:
    """Write the manual pages: one for the program, one for each command.

    \b
    Example:
      mocapidx man --output ~/.local/share/man
      man mocapidx-index
    """
    from mocapidx.tasks.records import save_text
    from mocapidx.tasks.safe_names import check_outside_stores, make_folders

    root = click.get_current_context().find_root()
    pages = [("", root.command), *all_commands(root.command, root)]
    folder = output / "man1"
    check_outside_stores(folder)
    make_folders(folder)
    for words, command in pages:
        name = "-".join(["mocapidx", *words.split()])
        save_text(manual_page(name, words, command, root), folder / f"{name}.1")
    note(f"{count(len(pages), 'page')} in {folder}", False)


def manual_page(
    name: str, words: str, command: click.Command, root: click.Context
) -> Iterator[str]:
    """Write a command's help as the lines of a manual page."""
    ctx = click.Context(command, info_name=words or "mocapidx", parent=root if words else None)
    purpose, *paragraphs = (command.help or "").strip().split("\n\n")
    yield f'.TH "{name.upper()}" "1" "" "mocapidx" "mocapidx"'
    yield from (".SH NAME", f"{name} \\- {plain(purpose).rstrip('.')}")
    yield from (".SH SYNOPSIS", f".B mocapidx {plain(words)}".rstrip())
    yield plain(" ".join(command.collect_usage_pieces(ctx)))
    if paragraphs:
        yield ".SH DESCRIPTION"
        for paragraph in paragraphs:
            yield from ("", *described(paragraph))
    yield ".SH OPTIONS"
    for param in command.get_params(ctx):
        record = param.get_help_record(ctx)
        if record and isinstance(param, click.Option):
            yield from (".TP", f"\\fB{plain(record[0])}\\fR", plain(record[1]))
    inner = command.commands if isinstance(command, click.Group) and words else {}
    listed = [(key, each.get_short_help_str(200)) for key, each in inner.items()]
    if not words:
        listed = [(key, text) for key, (_, text) in COMMANDS.items()]
    if listed:
        yield ".SH COMMANDS"
        for key, text in listed:
            yield from (".TP", f"\\fB{name}-{plain(key)}\\fR(1)", plain(text))
    yield ".SH EXIT STATUS"
    for code, meaning in ENDS:
        yield from (".TP", code, plain(meaning))
    if words:
        yield from (".SH SEE ALSO", "\\fBmocapidx\\fR(1)")


def described(paragraph: str) -> Iterator[str]:
    """Fill a paragraph, or leave it as it is laid out."""
    if not paragraph.lstrip().startswith("\b"):
        yield plain(" ".join(paragraph.split()))
        return
    yield from (".nf", *map(plain, paragraph.strip().lstrip("\b").strip("\n").splitlines()), ".fi")


def plain(text: str) -> str:
    """Write text so that nothing in it is a request of roff."""
    text = text.replace("\\", "\\e").replace("-", "\\-").replace("'", "\\(aq")
    return f"\\&{text}" if text.startswith(".") else text
