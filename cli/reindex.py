"""The command `reindex`."""

from pathlib import Path

import click

from .options import complete_file, lock_options, quiet_option
from .progress import Bar
from .rows import note

__all__ = ["reindex"]


@click.command()
@click.argument("old", metavar="STORE", type=click.Path(path_type=Path))
@click.option(
    "--store",
    required=True,
    type=click.Path(path_type=Path),
    metavar="NEW",
    help="The new store, a folder; STORE itself is only read.",
)
@click.option(
    "--feature-set",
    required=True,
    metavar="NAME|FILE",
    shell_complete=complete_file,
    help="Relational features: a shipped set or a TOML file.",
)
@click.option(
    "--no-poses",
    "poses",
    flag_value=False,
    default=True,
    help="Keep no joint positions in the new store.",
)
@lock_options
@quiet_option
def reindex(
    old: Path,
    store: Path,
    feature_set: str,
    poses: bool,
    lock_timeout: float,
    use_lock: bool,
    quiet: bool,
) -> None:
    """Make a store of another feature set from the poses in STORE; no source file is read.

    Documents keep their names and sources, so `index` can bring the new store up to date later.

    \b
    Example:
      mocapidx reindex takes.store --store hands.store --feature-set hands.toml
    """
    from mocapidx.tasks.reindex import reindex_store

    with Bar("doc", quiet) as bar:
        summary = reindex_store(
            old,
            store,
            feature_set,
            poses=poses,
            lock_timeout=lock_timeout,
            use_lock=use_lock,
            progress=lambda step: bar.show(step.done, step.total, step.frames),
        )
    note(
        f"{store}: {summary.written} written, {summary.unchanged} unchanged; "
        f"{summary.frames} frames in {summary.seconds:.1f} s",
        quiet,
    )
