"""The command `remove`."""

from pathlib import Path

import click

from mocapidx.printable import count, shown

from .options import lock_options, quiet_option, store_argument
from .rows import note

__all__ = ["remove"]


@click.command()
@store_argument
@click.option(
    "--where",
    required=True,
    metavar="CONDITION",
    help="Which documents, such as 'document = build/* or actor = ann'.",
)
@lock_options
@quiet_option
def remove(store: Path, where: str, lock_timeout: float, use_lock: bool, quiet: bool) -> None:
    """Take the documents that meet a condition out of STORE.

    Their names are printed, one a line; `info --where` lists them before. The motion files stay,
    and an `index` of their folder takes them in again. The room on disk is free after a `compact`.

    \b
    Example:
      mocapidx info takes.store --where "document = build/*"
      mocapidx remove takes.store --where "document = build/*"
    """
    from mocapidx.tasks.remove import remove_documents

    names = remove_documents(store, where, lock_timeout=lock_timeout, use_lock=use_lock)
    for name in names:
        click.echo(shown(name, None))
    note(f"{shown(store)}: {count(len(names), 'document')} removed", quiet)
