"""The command `template` and what it does with template files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from mocapidx.printable import count

from .options import NewFile, NumberRange
from .rows import note, print_rows, row_options

__all__ = ["template"]

Command = TypeVar("Command", bound=Callable[..., Any])

FILE = NewFile()
templates_argument = click.argument("templates", type=click.Path(path_type=Path))
class_option = click.option("--class", "label", required=True, metavar="NAME", help="The class.")
result_option = click.option(
    "--output",
    type=NewFile(may_be="templates"),
    required=True,
    help="Template file for the result, with all other templates; may be TEMPLATES itself.",
)
copy_option = click.option(
    "--as",
    "new_label",
    metavar="NAME",
    help="Keep the class as it is and add the result under this name.",
)


@click.group()
def template() -> None:
    """Look at motion templates and change them by hand.

    \b
    Example:
      mocapidx template list templates.h5
      mocapidx template show templates.h5 --class squat --picture squat.png
      mocapidx template mask templates.h5 --class squat --features upper --output templates.h5
    """


@template.command("list", short_help="List templates with costs and thresholds.")
@templates_argument
@row_options
def list_templates(templates: Path, row_format: str, output: Path) -> None:
    """List the templates in TEMPLATES, with their costs and thresholds.

    \b
    Example:
      mocapidx template list templates.h5 --format jsonl
    """
    from mocapidx.tasks.template import template_records
    from mocapidx.tasks.template_records import LIST_COLUMNS

    print_rows(template_records(templates), row_format, output, LIST_COLUMNS)


@template.command(short_help="Show a class as text or picture, and how well it is separated.")
@templates_argument
@class_option
@click.option(
    "--picture",
    type=FILE,
    metavar="FILE",
    help="Draw it too: PNG or SVG by suffix; of several templates, each with its number.",
)
@click.option(
    "--width",
    type=click.IntRange(min=60),
    default=100,
    show_default=True,
    metavar="COLUMNS",
    help="Characters in a line.",
)
@row_options
def show(
    templates: Path, label: str, picture: Path | None, width: int, row_format: str, output: Path
) -> None:
    """Show a class: what is consistent, what is undecided, and how well it is separated.

    Rows are features, columns are frames. Formats other than `table` give the facts only.

    \b
    Example:
      mocapidx template show templates.h5 --class squat
      mocapidx template show templates.h5 --class squat --picture squat.png
    """
    from mocapidx.tasks.records import save_text
    from mocapidx.tasks.template import shown_template
    from mocapidx.tasks.template_records import LIST_COLUMNS, draw_text, template_facts

    found, feature_set = shown_template(templates, label)
    if picture is not None:
        from mocapidx.tasks.plot import draw_templates

        for path in draw_templates(found, feature_set, picture):
            note(f"{path}: written", quiet=False)
    if row_format != "table":
        print_rows([template_facts(each) for each in found], row_format, output, LIST_COLUMNS)
        return
    lines: list[str] = []
    for each in found:
        lines += (
            ["", *draw_text(each, feature_set, width)]
            if lines
            else draw_text(each, feature_set, width)
        )
    if str(output) == "-":
        click.echo("\n".join(lines))
    else:
        save_text(lines, output)


@template.command(short_help="Add the mirror image of a class.")
@templates_argument
@class_option
@click.option("--as", "new_label", required=True, metavar="NAME", help="The mirrored class.")
@result_option
def mirror(templates: Path, label: str, new_label: str, output: Path) -> None:
    """Add the mirror image of a class: left and right features change places.

    \b
    Example:
      mocapidx template mirror t.h5 --class cartwheelLeft --as cartwheelRight --output t.h5
    """
    from mocapidx.tasks.template import mirror_class

    mirror_class(templates, label, new_label, output)


@template.command(short_help="Add one class that covers several.")
@templates_argument
@click.option(
    "--class",
    "labels",
    multiple=True,
    required=True,
    metavar="NAME",
    help="A class; say it twice or more.",
)
@click.option("--as", "new_label", required=True, metavar="NAME", help="The combined class.")
@result_option
def combine(templates: Path, labels: tuple[str, ...], new_label: str, output: Path) -> None:
    """Add one class that covers several: what tells them apart becomes undecided.

    \b
    Example:
      mocapidx template combine t.h5 --class armFwd --class armBwd --as arm --output t.h5
    """
    from mocapidx.tasks.template import combine_classes

    combine_classes(templates, labels, new_label, output)


@template.command(short_help="Make features of a class undecided.")
@templates_argument
@class_option
@click.option(
    "--features",
    default="all",
    show_default=True,
    metavar="FEATURES",
    help="Ids such as F27,F28 or the sets upper, lower, mix, all.",
)
@click.option(
    "--start", type=NumberRange(min=0), metavar="SECONDS", help="From here.  [default: 0]"
)
@click.option(
    "--end",
    type=NumberRange(min=0, min_open=True),
    metavar="SECONDS",
    help="Up to here.  [default: end of the template]",
)
@copy_option
@result_option
def mask(
    templates: Path,
    label: str,
    features: str,
    start: float | None,
    end: float | None,
    new_label: str | None,
    output: Path,
) -> None:
    """Make features of a class undecided, over all of it or from START to END.

    Masked entries have no say in a match any more. The threshold of the class was measured with
    them, so it is dropped.

    \b
    Example:
      mocapidx template mask t.h5 --class squat --features upper,F27,F28,F33,F34 --output t.h5
    """
    from mocapidx.tasks.template import mask_class

    mask_class(
        templates,
        label,
        output,
        features=features,
        start=start,
        end=end,
        new_label=new_label,
    )


@template.command(short_help="Keep of a class what separates it from others.")
@templates_argument
@class_option
@click.option(
    "--from",
    "others",
    multiple=True,
    required=True,
    metavar="NAME",
    help="A class that it is mistaken for; may be repeated.",
)
@copy_option
@result_option
def subtract(
    templates: Path, label: str, others: tuple[str, ...], new_label: str | None, output: Path
) -> None:
    """Emphasise what separates a class from others: what they share becomes undecided.

    \b
    Example:
      mocapidx template subtract t.h5 --class throw --from grab --as throwNotGrab --output t.h5
    """
    from mocapidx.tasks.template import subtract_classes

    subtract_classes(templates, label, others, output, new_label)


@template.command(short_help="Choose the keyframes of a class by hand.")
@templates_argument
@class_option
@click.argument("frames", nargs=-1, type=click.IntRange(min=0))
@click.option(
    "--tolerance",
    type=click.IntRange(min=0, max=64),
    default=0,
    show_default=True,
    metavar="N",
    help="Entries of a keyframe that may disagree.",
)
@result_option
def keyframes(
    templates: Path, label: str, frames: tuple[int, ...], tolerance: int, output: Path
) -> None:
    """Choose the keyframes of a class by hand: FRAMES of the template, from 0; none: no keyframes.

    \b
    Example:
      mocapidx template keyframes t.h5 --class squat 4 22 --tolerance 2 --output t.h5
    """
    from mocapidx.tasks.template import keyframe_class

    keyframe_class(templates, label, frames, tolerance, output)


@template.command(short_help="Change templates as a TOML file says.")
@templates_argument
@click.argument("design", type=click.Path(path_type=Path))
@result_option
def edit(templates: Path, design: Path, output: Path) -> None:
    """Change templates as the TOML file DESIGN says; docs/template-editing.md has its form.

    \b
    Example:
      mocapidx template edit templates.h5 changes.toml --output templates.h5
    """
    from mocapidx.tasks.template import edit_templates

    labels = edit_templates(templates, design, output)
    note(f"{output}: {count(len(labels), 'class', 'classes')} changed or added", quiet=False)


@template.command(short_help="Make templates without any training.")
@click.argument("design", type=click.Path(path_type=Path))
@click.option("--output", type=FILE, required=True, help="The template file to be made.")
def new(design: Path, output: Path) -> None:
    """Make templates without any training, as the TOML file DESIGN says.

    \b
    Example:
      mocapidx template new sweeping.toml --output sweeping.h5
    """
    from mocapidx.tasks.template import design_templates

    labels = design_templates(design, output)
    note(f"{output}: {count(len(labels), 'class', 'classes')}", quiet=False)
