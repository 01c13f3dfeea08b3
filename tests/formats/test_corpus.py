"""What fuzzing learnt of the readers, which sanitizers watch where they watch these tests."""

import pytest

from tests.fuzz.entries import replay


@pytest.mark.parametrize("name", ["scanner", "bvh", "amc"])
def test_no_file_of_the_corpus_breaks_a_scanner(name, tmp_path):
    replay(name, tmp_path)
