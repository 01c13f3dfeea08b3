"""The command `info`."""

from pathlib import Path

import click

from .options import store_argument
from .rows import print_rows, row_options

__all__ = ["info"]


@click.command()
@store_argument
@click.argument("document", required=False)
@click.option("--documents", is_flag=True, help="List the documents instead.")
@click.option(
    "--where",
    metavar="CONDITION",
    help="List those documents that meet it, such as 'actor = ann and seconds > 2'.",
)
@row_options
def info(
    store: Path,
    document: str | None,
    documents: bool,
    where: str | None,
    row_format: str,
    output: Path,
) -> None:
    """Show what STORE holds, or what is known of one DOCUMENT.

    \b
    Example:
      mocapidx info takes.store
      mocapidx info takes.store --documents --format csv
      mocapidx info takes.store --where "actor = ann"
      mocapidx info takes.store squat/anna_squat_1.amc
    """
    from mocapidx.tasks.info import DOCUMENT_COLUMNS, document_info, list_documents, store_info
    from mocapidx.tasks.records import pair_records

    if documents or where is not None:
        if document is not None:
            raise click.UsageError("--documents and --where list several; leave DOCUMENT out")
        listed = list_documents(store, where)
        told = list(listed[0])[list(listed[0]).index("source") + 1 :] if listed else []
        print_rows(listed, row_format, output, (*DOCUMENT_COLUMNS, *told))
        return
    facts = store_info(store) if document is None else document_info(store, document)
    records = [facts] if row_format == "jsonl" else pair_records(facts)
    print_rows(records, row_format, output, ("what", "value"))
