"""The command `verify`."""

import os
import sys
from pathlib import Path

import click

from mocapidx.errors import StoreError
from mocapidx.printable import count, shown

from .options import lock_options, quiet_option, store_argument
from .rows import note

__all__ = ["verify"]


@click.command()
@store_argument
@click.option("--quick", is_flag=True, help="Compare sizes and digests of whole files only.")
@click.option(
    "--repair",
    is_flag=True,
    help="Rebuild damaged indexes, set damaged files aside, name what to index again.",
)
@lock_options
@quiet_option
def verify(
    store: Path, quick: bool, repair: bool, lock_timeout: float, use_lock: bool, quiet: bool
) -> int:
    """Check every byte of STORE; repair what can be rebuilt.

    The exit code is 4 where damage was found, or what was lost with it is not indexed again yet;
    0 where there is none or all was rebuilt. The motion files that have to be indexed again are
    printed, one a line; the same `index` as before, with its INPUT and --root, takes them again.

    \b
    Example:
      mocapidx verify takes.store
      mocapidx verify takes.store --repair
    """
    from mocapidx.tasks.verify import verify_store

    report = verify_store(
        store, quick=quick, repair=repair, lock_timeout=lock_timeout, use_lock=use_lock
    )
    for problem in report.problems:
        note(problem, quiet)
    for path in report.rebuilt:
        note(f"{path}: rebuilt", quiet)
    for path in report.set_aside:
        note(f"{path}: set aside", quiet)
    for path in report.lost:
        # byte by byte for other programs, but not to a terminal
        click.echo(shown(path, None) if sys.stdout.isatty() else os.fsencode(path))
    if report.problems and not repair:
        found = count(len(report.problems), "problem")
        price = ""
        if report.at_stake:
            documents = count(report.at_stake, "document")
            price = f" and takes out {documents} of damaged files, to be indexed again"
        raise StoreError(
            f"{store}: {found}; 'mocapidx verify {store} --repair' mends what can be rebuilt{price}"
        )
    if report.lost:
        lost = count(len(report.lost), "document")
        when = "" if report.set_aside else " in an earlier repair"
        forget = "" if report.set_aside else ", or remove what segments/damaged-* holds of them"
        raise StoreError(
            f"{store}: {lost} lost{when}; run 'mocapidx index' again as you ran it before{forget}"
        )
    if not report.problems:
        megabytes = report.size / 1e6
        note(f"{store}: sound; {count(report.documents, 'document')}, {megabytes:.1f} MB", quiet)
    else:
        note(f"{store}: repaired", quiet)
    return 0
