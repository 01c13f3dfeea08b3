"""Pieces of a store that another process reads: the client's commit, or an error."""

import copy
from dataclasses import replace

import numpy as np
import pytest

from mocapidx.errors import StoreError
from mocapidx.store.read import open_store
from mocapidx.tasks import store_words
from mocapidx.tasks.index import IndexOptions, index_files
from mocapidx.tasks.query_files import answer_of_file, file_piece
from mocapidx.tasks.segment_sources import document_groups, segment_source, store_feature_set
from mocapidx.tasks.store_pieces import word_pieces
from mocapidx.tasks.store_words import store_batches


@pytest.fixture(scope="module")
def store(fixtures_dir, tmp_path_factory):
    """Three segment files, of a class each."""
    store = tmp_path_factory.mktemp("pieces") / "s.store"
    for name in ("jog", "squat", "walk"):
        clips = fixtures_dir / "clips"
        index_files([clips / name], store, IndexOptions(root=clips))
    return store


@pytest.mark.parametrize("frames", [1 << 19, 100])
def test_pieces_give_the_batches_of_the_store(store, monkeypatch, frames):
    monkeypatch.setattr(store_words, "BATCH_FRAMES", frames)
    with open_store(store) as snapshot:
        whole = list(store_batches(snapshot))
        pieces = [copy.deepcopy(piece) for piece in word_pieces(snapshot)]
    batches = [batch for piece in pieces for batch in piece.batches()]
    assert len(pieces) >= 3
    assert [batch.documents for batch in batches] == [batch.documents for batch in whole]
    for one, other in zip(batches, whole, strict=True):
        np.testing.assert_array_equal(one.words, other.words)
        np.testing.assert_array_equal(one.bounds, other.bounds)
        assert one.untrusted == other.untrusted


def test_pieces_weigh_what_is_read_of_them_and_name_their_file(store):
    with open_store(store) as snapshot:
        pieces = list(word_pieces(snapshot))
    assert sum(piece.weight for piece in pieces) == sum(
        batch.weight for piece in pieces for batch in piece.batches()
    )
    assert all(piece.path.is_file() for piece in pieces)
    assert not any(piece.place.file.documents for piece in pieces)


def test_a_segment_file_answers_elsewhere_as_it_does_here(store):
    def lengths(source, groups):
        return source.lengths.tolist(), [group.documents.tolist() for group in groups]

    with open_store(store) as snapshot:
        feature_set = store_feature_set(snapshot)
        for file in snapshot.files:
            groups = document_groups(file)
            piece = copy.deepcopy(file_piece(snapshot, file, feature_set, groups))
            here = lengths(segment_source(snapshot, file, feature_set), groups)
            assert answer_of_file(lengths, piece) == here
            assert piece.path.is_file()
            assert piece.weight > 0


def test_a_piece_that_is_gone_is_one_line(store, tmp_path):
    with open_store(store) as snapshot:
        piece = next(word_pieces(snapshot))
    moved = replace(piece, place=replace(piece.place, store=tmp_path))
    with pytest.raises(StoreError) as caught:
        list(moved.batches())
    assert "\n" not in str(caught.value)
    assert str(tmp_path) in str(caught.value)
