from pathlib import Path

import h5py

from mocapidx.store import schema
from mocapidx.store.read import open_store

DOC = Path(__file__).parents[2] / "docs" / "schema.md"


def rows_of_the_document():
    """The table of datasets in docs/schema.md, row by row, by the dataset's name."""
    lines = [line for line in DOC.read_text().splitlines() if line.startswith("| `")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {row[0].strip("`"): row[1:] for row in cells if len(row) == 5}


def test_the_document_describes_every_dataset_as_the_schema_has_it():
    assert rows_of_the_document() == {
        column.path: [
            column.dtype.name + (", optional" if column.optional else ""),
            ", ".join([column.axes[0], *map(str, column.trailing)]),
            column.unit,
            column.doc,
        ]
        for column in schema.COLUMNS.values()
    }


def test_the_document_names_the_version_and_the_limits():
    text = DOC.read_text()
    assert f'`"version": {schema.FORMAT_VERSION}`' in text
    assert f"{schema.MANIFEST_LIMIT >> 20} MiB" in text
    assert f"{schema.BLOCK >> 20} MiB" in text


def test_a_segment_file_is_hdf5_with_the_datasets_of_the_schema(store):
    with open_store(store) as snapshot:
        for file in snapshot.files:
            with h5py.File(store / "segments" / file.names[0], "r") as image:
                for path, column in schema.COLUMNS.items():
                    dataset = image[path]
                    assert dataset.dtype == column.dtype
                    assert dataset.shape[1:] == column.trailing
                    assert dataset.chunks is None
                    assert not dataset.attrs
                    assert dataset[()].tobytes() == snapshot.array(file, path).tobytes()
