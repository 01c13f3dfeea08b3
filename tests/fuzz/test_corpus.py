"""What fuzzing guided by coverage learnt, read again: a file for each branch of the readers."""

import pytest

from tests.fuzz.entries import CORPUS, ENTRIES, replay

MOST = 300_000  # bytes
LARGEST = 4096


@pytest.mark.parametrize("name", ENTRIES)
def test_no_file_of_the_corpus_breaks_a_reader(name, tmp_path):
    replay(name, tmp_path)


@pytest.mark.parametrize("name", ENTRIES)
def test_there_are_files_for_each_reader(name):
    assert any((CORPUS / name).iterdir())


def test_the_corpus_stays_small():
    sizes = [path.stat().st_size for path in CORPUS.glob("*/*")]
    assert max(sizes) <= LARGEST
    assert sum(sizes) <= MOST
