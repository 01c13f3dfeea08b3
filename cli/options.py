"""Options with one meaning in every command."""

import math
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

    from mocapidx.tasks.read import ReadOptions

__all__ = [
    "NewFile",
    "NumberRange",
    "complete_file",
    "jobs_option",
    "lock_options",
    "quiet_option",
    "read_options",
    "reading_options",
    "scheduler_option",
    "spread",
    "store_argument",
]

Command = TypeVar("Command", bound=Callable[..., Any])


click.IntRange.name = "whole number"  # what messages call it where it is none


class NumberRange(click.FloatRange):
    """A number between bounds; NaN, which no comparison keeps out, is none."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Read the number as click does, and refuse NaN."""
        number = super().convert(value, param, ctx)
        if math.isnan(number):
            self.fail(f"{value!r} is not a number.", param, ctx)
        return number


class NewFile(click.Path):
    """A file to be written; a wrong folder is told now and not after hours of work.

    Parameters
    ----------
    allow_dash : bool
        ``-`` is the standard output.
    is_motion : bool
        Motion is written there, so what is there may be motion.
    may_be : str, optional
        The parameter whose file may be changed in place.
    """

    def __init__(
        self, *, allow_dash: bool = False, is_motion: bool = False, may_be: str | None = None
    ) -> None:
        super().__init__(dir_okay=False, path_type=Path, allow_dash=allow_dash)
        self.is_motion = is_motion
        self.may_be = may_be

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Take the path, and refuse one in a folder that is not there or may not be written."""
        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if str(path) != "-":
            from mocapidx.tasks.safe_names import check_place

            check_place(path, is_motion=self.is_motion)
        return path


class WaryContext(click.Context):
    """Compares what a command would write with what it would read, before it runs."""

    def invoke(self, callback: Any, /, *args: Any, **kwargs: Any) -> Any:
        """Refuse an output that is one of the inputs; else run the command."""
        outputs = {
            param: Path(os.fsdecode(self.params[param.name]))
            for param in self.command.params
            if param.name in self.params and is_output(param)
            if self.params[param.name] not in (None, Path("-"))
        }
        if outputs:
            from mocapidx.tasks.outputs import check_output

            for param, path in outputs.items():
                inputs = list(files_in(self, getattr(param.type, "may_be", None)))
                others = [(spelled(p), place) for p, place in outputs.items() if p is not param]
                check_output(spelled(param), path, inputs, others)
        return super().invoke(callback, *args, **kwargs)


click.Command.context_class = WaryContext  # every command's, so that none can forget to look


def is_output(param: click.Parameter) -> bool:
    """Whether a parameter names what is written."""
    return isinstance(param.type, NewFile) or param.name == "output"


def files_in(ctx: click.Context, without: str | None) -> Iterator[tuple[str, str]]:
    """List the values that may be files to be read: those that a shell completes as files."""
    root = ctx.find_root()
    for level in (ctx, root):
        for param in level.command.params:
            if (
                is_output(param)
                or param.name == without
                or not any(item.type in ("file", "dir") for item in param.shell_complete(level, ""))
            ):
                continue
            value = level.params.get(param.name or "")
            for each in value if isinstance(value, tuple) else (value,):
                if isinstance(each, (str, Path)) and str(each) != "-":
                    yield spelled(param), str(each)
    if (settings := getattr(root.obj, "path", None)) is not None:
        yield "the settings", str(settings)


def spelled(param: click.Parameter) -> str:
    """Name a parameter as the help does."""
    return max(param.opts, key=len) if param.opts[0][:1] == "-" else param.human_readable_name


def complete_file(
    ctx: click.Context, param: click.Parameter, incomplete: str
) -> "list[CompletionItem]":
    """Let a shell complete files where a value is a file, or something else."""
    from click.shell_completion import CompletionItem

    return [CompletionItem(incomplete, type="file")]


store_argument = click.argument("store", type=click.Path(path_type=Path))
quiet_option = click.option("--quiet", is_flag=True, help="Say nothing but errors.")
jobs_option = click.option(
    "--jobs",
    type=click.IntRange(min=1),
    default=lambda: len(os.sched_getaffinity(0)),
    metavar="N",
    help="Worker processes.  [default: all cores]",
)


scheduler_option = click.option(
    "--scheduler",
    metavar="ADDRESS|local:N",
    help="Work on a Dask cluster instead, or on one of N processes here.",
)


def spread(scheduler: str | None) -> AbstractContextManager[Any]:
    """Give the map function of a cluster, or None for the command's own processes."""
    if scheduler is None:
        return nullcontext()
    from mocapidx.tasks.cluster import cluster_mapping

    return cluster_mapping(scheduler)


def lock_options(command: Command) -> Command:
    """Give a command that writes ``--lock-timeout`` and ``--no-lock``."""
    command = click.option(
        "--no-lock",
        "use_lock",
        flag_value=False,
        default=True,
        help="Write without a lock where the file system has none; at your own risk.",
    )(command)
    return click.option(
        "--lock-timeout",
        type=NumberRange(min=0),
        default=0.0,
        show_default=True,
        metavar="SECONDS",
        help="Wait this long for another writer.",
    )(command)


def reading_options(command: Command) -> Command:
    """Give a command that reads motion files the options that say how."""
    for option in reversed(READING):
        command = option(command)
    return command


def read_options(values: dict[str, Any]) -> "ReadOptions":
    """Turn the values of `reading_options` into what the library takes."""
    from mocapidx.tasks.read import Limits, ReadOptions

    limits = {name: values.pop(name) for name in ("max_file", "max_frames", "max_joints")}
    first_frame = values.pop("first_frame")
    return ReadOptions(
        keep_first_frame=None if first_frame is None else first_frame == "motion",
        limits=Limits(**{name: limit for name, limit in limits.items() if limit is not None}),
        **values,
    )


READING = (
    click.option(
        "--skeleton",
        type=click.Path(exists=True, dir_okay=False, path_type=Path),
        metavar="FILE",
        help="Skeleton (.asf) of AMC or body model (.npz) of AMASS.  [default: found; a template]",
    ),
    click.option(
        "--source-rate",
        type=NumberRange(min=0, min_open=True),
        metavar="HZ",
        help="Rate of files that don't say.  [default: from the name; AMC: else 120]",
    ),
    click.option(
        "--joint-map",
        type=click.Path(path_type=Path),
        metavar="FILE.toml",
        help="Maps nodes or markers to the 24 joints.  [default: chosen by the names]",
    ),
    click.option(
        "--unit",
        type=NumberRange(min=0, min_open=True),
        metavar="METRES",
        help="Metres in one unit of the file.  [default: detected]",
    ),
    click.option(
        "--up",
        type=click.Choice(["x", "y", "z", "-x", "-y", "-z"]),
        help="The file's upward axis.  [default: detected]",
    ),
    click.option(
        "--root-positions",
        type=click.Choice(["add", "replace"]),
        help="Whether a BVH root's positions add to its OFFSET.  [default: detected]",
    ),
    click.option(
        "--first-frame",
        type=click.Choice(["motion", "pose"]),
        help="Whether frame 0 is motion, or a T-pose to be dropped.  [default: detected]",
    ),
    click.option(
        "--subject",
        metavar="NAME",
        help="Whose points count where a file has several subjects.  [default: the only one]",
    ),
    click.option(
        "--fill-gaps",
        type=NumberRange(0, 3600),
        default=0.2,
        show_default=True,
        metavar="SECONDS",
        help="Fill gaps of points up to this long; longer ones stay unknown.",
    ),
    click.option(
        "--max-file",
        type=click.IntRange(min=1),
        metavar="BYTES",
        help="Refuse larger files.  [default: 2 GiB]",
    ),
    click.option(
        "--max-frames",
        type=click.IntRange(min=1),
        metavar="N",
        help="Refuse takes of more frames.  [default: 1000000]",
    ),
    click.option(
        "--max-joints",
        type=click.IntRange(min=1),
        metavar="N",
        help="Refuse skeletons of more joints.  [default: 4096]",
    ),
)
