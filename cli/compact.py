"""The command `compact`."""

from pathlib import Path

import click

from mocapidx.printable import count

from .options import lock_options, quiet_option, store_argument
from .rows import note

__all__ = ["compact"]


@click.command()
@store_argument
@lock_options
@quiet_option
def compact(store: Path, lock_timeout: float, use_lock: bool, quiet: bool) -> None:
    """Merge the segment files of STORE and drop what was removed.

    `index` adds segment files and merges small ones by itself when there are many; documents that
    were removed or changed keep their place on disk until then; the files that were merged go with
    the next command that writes, as readers may have them open. Nothing that is found changes. One
    file is left, or one for each 155 hours (at 30 Hz); a run that is stopped goes on with the next.

    \b
    Example:
      mocapidx compact takes.store
    """
    from mocapidx.tasks.compact import compact_store

    before, after = compact_store(store, lock_timeout=lock_timeout, use_lock=use_lock)
    note(f"{store}: {count(before, 'segment file')} before, {after} now", quiet)
