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
@click.option("--dry-run", is_flag=True, help="Only say which documents would go.")
@lock_options
@quiet_option
def remove(
    store: Path, where: str, dry_run: bool, lock_timeout: float, use_lock: bool, quiet: bool
) -> None:
    """Take the documents that meet a condition out of STORE.

    Their names are printed, one a line. The motion files themselves stay, and an `index` of their
    folder takes them in again. The room on disk is free after the next `compact`.

    \b
    Example:
      mocapidx remove takes.store --where "document = build/*" --dry-run
      mocapidx remove takes.store --where "document = build/*"
    """
    from mocapidx.tasks.remove import remove_documents

    names = remove_documents(
        store, where, dry_run=dry_run, lock_timeout=lock_timeout, use_lock=use_lock
    )
    for name in names:
        click.echo(shown(name, None))
    would = "would be " if dry_run else ""
    note(f"{shown(store)}: {count(len(names), 'document')} {would}removed", quiet)
