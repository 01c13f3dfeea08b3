"""The command `merge`."""

from pathlib import Path

import click

from mocapidx.printable import count, shown

from .options import lock_options, quiet_option
from .rows import note

__all__ = ["merge"]


@click.command()
@click.argument(
    "stores", nargs=-1, required=True, metavar="STORE...", type=click.Path(path_type=Path)
)
@click.option(
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    metavar="STORE",
    help="The store that they are added to; made if there is none.",
)
@lock_options
@quiet_option
def merge(
    stores: tuple[Path, ...], output: Path, lock_timeout: float, use_lock: bool, quiet: bool
) -> None:
    """Join STOREs that independent jobs built, without indexing again.

    Their files are linked where the file system allows, else copied; the STOREs stay as they are
    and may be deleted afterwards. A document that two of them hold alike is taken once.

    \b
    Example:
      mocapidx merge part1.store part2.store part3.store --output all.store
    """
    from mocapidx.tasks.merge import merge_stores

    merged = merge_stores(stores, output, lock_timeout=lock_timeout, use_lock=use_lock)
    note(
        f"{shown(output)}: {count(merged.added, 'document')} added, {merged.documents} in "
        f"{count(merged.files, 'segment file')}",
        quiet,
    )
