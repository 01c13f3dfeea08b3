"""The command `index`."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mocapidx.printable import count, shown

if TYPE_CHECKING:
    from mocapidx.tasks.index import IndexSummary

from .options import (
    NumberRange,
    complete_file,
    jobs_option,
    lock_options,
    quiet_option,
    read_options,
    reading_options,
    scheduler_option,
    spread,
)
from .progress import Bar
from .rows import note, warn

__all__ = ["index"]

SKIPPED = 5  # exit code: done, but some inputs were skipped


@click.command()
@click.argument(
    "inputs", nargs=-1, required=True, metavar="INPUT...", type=click.Path(path_type=Path)
)
@click.option(
    "--store",
    required=True,
    type=click.Path(path_type=Path),
    metavar="STORE",
    help="The store, a folder; made if there is none.",
)
@click.option(
    "--rate",
    type=NumberRange(1, 1000),
    metavar="HZ",
    help="Frames a second.  [default: the store's, 30 in a new one]",
)
@click.option(
    "--feature-set",
    metavar="NAME|FILE",
    shell_complete=complete_file,
    help="Features: f39, f31 or a TOML file.  [default: the store's, f39 in a new one]",
)
@click.option(
    "--no-poses",
    "poses",
    flag_value=False,
    default=True,
    help="Keep no joint positions: less than a tenth of the size.",
)
@click.option(
    "--prune",
    is_flag=True,
    help="Drop documents whose file is gone from a folder that is there and not empty.",
)
@click.option(
    "--skip-bad", is_flag=True, help="Pass over files that can't be used; the exit code is then 5."
)
@click.option(
    "--root",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    metavar="FOLDER",
    help="Name documents by their path below this folder.",
)
@click.option(
    "--name-pattern",
    metavar="REGEX",
    help="Take facts for --where from names, by named groups; give it at every run.",
)
@reading_options
@jobs_option
@scheduler_option
@lock_options
@click.option("--verbose", is_flag=True, help="Warn of each odd file, not only of the first.")
@quiet_option
def index(
    inputs: tuple[Path, ...],
    store: Path,
    rate: float | None,
    feature_set: str | None,
    poses: bool,
    prune: bool,
    skip_bad: bool,
    root: Path | None,
    name_pattern: str | None,
    jobs: int,
    scheduler: str | None,
    lock_timeout: float,
    use_lock: bool,
    verbose: bool,
    quiet: bool,
    **reading: Any,
) -> int:
    """Read motion files and folders into a store.

    Folders are searched all the way down for motion files: AMC with their ASF skeletons, BVH, C3D,
    TRC, and npz, npy, CSV and JSON files that hold positions; hidden ones are left alone.
    What is new or has changed since the last run is read, what is unchanged is left alone; a run
    that was cut off goes on where it stopped.

    A document is named by its path below the INPUT that it was found in, so always name the
    same INPUT, or the same --root.

    \b
    Example:
      mocapidx index takes/ --store takes.store
      mocapidx index takes/ --store takes.store --skip-bad --prune --quiet
    """
    from mocapidx.tasks.index import IndexOptions, index_files

    options = IndexOptions(
        feature_set=feature_set,
        rate=rate,
        poses=poses,
        prune=prune,
        skip_bad=skip_bad,
        read=read_options(reading),
        root=root,
        name_pattern=name_pattern,
        jobs=jobs,
        lock_timeout=lock_timeout,
        use_lock=use_lock,
    )
    with Bar("doc", quiet) as bar, spread(scheduler) as map_fn:
        summary = index_files(
            inputs,
            store,
            options,
            progress=lambda step: bar.show(step.done, step.total, step.frames),
            map_fn=map_fn,
        )
    for refused in summary.refused:
        warn(refused.message)
    for folder, number in summary.kept.items():
        documents = count(number, "document")
        warn(
            f"{shown(folder)}: is empty or can't be listed, so {documents} from there stay; is a "
            "disk missing? Remove the folder to have them dropped"
        )
    if summary.not_merged:
        warn(f"all is saved, but small segment files were not merged: {summary.not_merged}")
    for warning in () if quiet else warnings(summary, inputs, verbose):
        warn(warning)
    note(sentence(summary, store), quiet)
    return SKIPPED if summary.refused else 0


def warnings(summary: "IndexSummary", inputs: tuple[Path, ...], verbose: bool) -> Iterator[str]:
    """Say what a person should look at after a run of `index`."""
    if not (summary.added or summary.changed or summary.unchanged or summary.refused):
        places = ", ".join(shown(path) for path in inputs)
        yield f"no motion file below {places}: is it the right folder?"
    if summary.assumed_rate:
        files = count(len(summary.assumed_rate), "AMC file")
        all_named = verbose or len(summary.assumed_rate) == 1
        names = "; ".join(shown(name) for name in summary.assumed_rate[: None if verbose else 1])
        yield (
            f"nothing says the rate of {files}, taken as 120 Hz (--source-rate HZ says "
            f"otherwise){': ' if all_named else ', such as '}{names}"
        )
    if summary.doubled:
        files, (first, second) = count(len(summary.doubled), "file"), summary.doubled[0]
        yield (
            f"{files} in the store under two names, such as '{shown(first)}' and "
            f"'{shown(second)}': name the same INPUT at every run, or the same --root"
        )
    if verbose:
        yield from summary.oddities
    elif len(summary.oddities) == 1:
        yield f"{summary.oddities[0]} ('mocapidx skeleton FILE' shows more)"
    elif summary.oddities:
        yield (
            f"{len(summary.oddities)} things look odd (--verbose shows all, 'mocapidx skeleton "
            f"FILE' more), such as {summary.oddities[0]}"
        )


def sentence(summary: "IndexSummary", store: Path) -> str:
    """Say in one line what a run of `index` did."""
    parts = [
        f"{summary.added} added",
        f"{summary.changed} changed",
        f"{summary.unchanged} unchanged",
        f"{summary.removed} removed",
    ]
    if summary.refused:
        parts.append(f"{len(summary.refused)} could not be used")
    if summary.passed_over:
        files = count(summary.passed_over, "file")
        parts.append(f"{files} of other kinds passed over")
    if summary.gaps_filled or summary.gaps_left:
        parts.append(f"gaps: {summary.gaps_filled} filled, {summary.gaps_left} left open")
    minutes = summary.frames / summary.rate / 60
    read = "nothing to read"
    if summary.frames:
        read = f"{minutes:.1f} minutes of motion read in {summary.seconds:.1f} s"
    return f"{shown(store)}: {', '.join(parts)}; {read}"
