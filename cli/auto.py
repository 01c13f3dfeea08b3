"""`query --select auto`: the part of the command that ranks by a one-shot template."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from .options import read_options
from .rows import note, print_rows

__all__ = ["print_auto"]


def print_auto(
    store: Path,
    example: str,
    options: Mapping[str, Any],
    reading: dict[str, Any],
    row_format: str,
    output: Path,
    quiet: bool,
    explain: bool = False,
) -> None:
    """Print the hits, and on stderr what a person should know about them."""
    from mocapidx.tasks.oneshot import auto_records, query_auto, weight_records
    from mocapidx.tasks.records import HIT_COLUMNS

    found = query_auto(store, example, read=read_options(reading), **options)
    for remark in found.remarks:
        note(f"Note: {remark}", quiet)
    print_rows(auto_records(found), row_format, output, (*HIT_COLUMNS, "sure"))
    if explain:
        for row in weight_records(found):
            share, on = row["share"], row["on"]
            click.echo(
                f"{share:.0%} of the weight: {row['feature']} ({row['name']}), on for {on:.0%}",
                err=True,
            )
