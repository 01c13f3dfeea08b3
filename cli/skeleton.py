"""The command `skeleton`."""

from pathlib import Path
from typing import Any

import click

from .options import read_options, reading_options
from .rows import print_rows, row_options

__all__ = ["skeleton"]


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--nodes", is_flag=True, help="Show the file's own nodes or points instead of the 24 joints."
)
@reading_options
@row_options
def skeleton(file: Path, nodes: bool, row_format: str, output: Path, **reading: Any) -> None:
    """Show how FILE's skeleton is understood: unit, axes, joints, and the evidence for each.

    FILE is a motion file; for ASF skeletons, name an AMC file that moves them. Joints are real,
    made up because the rig lacks them, or missing. Lengths are from the parent joint.

    \b
    Example:
      mocapidx skeleton walk.bvh
      mocapidx skeleton walk.bvh --unit 0.01 --up z
    """
    from mocapidx.tasks.skeleton_records import guesses, joint_records, node_records
    from mocapidx.tasks.skeleton_report import skeleton_report

    report = skeleton_report(file, read_options(reading))
    records = node_records(report) if nodes else joint_records(report)
    above = [*guesses(report), ""] if row_format == "table" else []
    print_rows(records, row_format, output, list(records[0]), above=above)
