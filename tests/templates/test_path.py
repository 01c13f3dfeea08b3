import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.features.words import pack_words
from mocapidx.templates.path import (
    SWITCH_PRICE,
    UNKNOWN_COST,
    annotate_words,
    find_path,
    loop_bank,
    occurrences,
    surprise_tables,
)
from tests import naive_loops as naive


def surprise(matrix):
    """Costs of zeros and ones, entry by entry, by the definition."""
    likely = [[min(max(x, 0.05), 0.95) for x in row] for row in matrix]
    zeros = [[-math.log(1 - p) / len(row) for p in row] for row in likely]
    ones = [[-math.log(p) / len(row) for p in row] for row in likely]
    return zeros, ones


def pattern(seed, length=24, features=39):
    """A movement: features that change now and then."""
    rng = np.random.default_rng(seed)
    return rng.random((length // 4, features)).repeat(4, axis=0) < 0.5


@given(st.integers(0, 10**6), st.booleans())
@settings(max_examples=25, deadline=None)
def test_path_is_as_cheap_as_the_best_of_all_pairs_of_states(seed, fill):
    rng = np.random.default_rng(seed)
    matrices = [rng.random((n, 7)) for n in rng.integers(1, 6, size=2)]
    words = rng.integers(0, 1 << 7, size=12, dtype=np.uint64)
    unknown = None if fill else UNKNOWN_COST
    price = SWITCH_PRICE / 30  # as cheap as jumps are at 1 Hz
    path = find_path(words, loop_bank(matrices, ["a", "b"], rate=1.0), unknown_cost=unknown)
    zeros, ones = zip(*map(surprise, matrices), strict=True)
    case = zeros, ones, price, math.inf if fill else UNKNOWN_COST
    bits = [int(word) for word in words]
    best = naive.best_total(bits, *case)
    assert naive.path_total(bits, path.columns, path.jumps, *case) == pytest.approx(best, abs=1e-4)
    jumps = path.jumps[1:].sum() * price
    assert path.costs.sum() + jumps == pytest.approx(best, abs=1e-4)


def test_surprise_of_sure_grey_and_violated_entries():
    tables = surprise_tables(np.full((1, 39), 0.0))
    assert tables[:, 0, 0].sum() == pytest.approx(-math.log(0.95))
    assert tables[0, 1, 0] - tables[0, 0, 0] == pytest.approx(math.log(0.95 / 0.05) / 39)
    grey = surprise_tables(np.full((1, 39), 0.5))
    assert grey[:, 0, 0].sum() == pytest.approx(math.log(2))


def test_features_that_cannot_be_trusted_do_not_count():
    matrix = np.array([[0.0, 1.0, 0.3]])
    trusted = surprise_tables(matrix, trusted=0b101)
    expected = surprise_tables(matrix[:, [0, 2]])
    for word, squeezed in ((0b000, 0b00), (0b011, 0b01), (0b110, 0b10), (0b111, 0b11)):
        assert trusted[0, word, 0] == pytest.approx(expected[0, squeezed, 0])
    assert not surprise_tables(matrix, trusted=0).any()


def test_classes_follow_one_another_and_their_repetitions_are_counted():
    jump, squat = pattern(1), pattern(2, length=36)
    motion = np.concatenate([jump] * 5 + [squat] * 3 + [jump[:12]])
    bank = loop_bank([jump.astype(float), squat.astype(float)], ["jump", "squat"])
    found = annotate_words(pack_words(motion), bank, unknown_cost=None)
    assert [(o.label, o.start, o.end) for o in found] == [
        ("jump", 0, 120),
        ("squat", 120, 228),
        ("jump", 228, 240),
    ]
    assert [o.repetitions for o in found] == pytest.approx([5, 3, 0.5], abs=0.1)
    assert [o.cost for o in found] == pytest.approx([-math.log(0.95)] * 3)


@pytest.mark.parametrize("slowness", [0.6, 1.0, 1.9])
def test_repetitions_are_counted_at_any_tempo(slowness):
    movement = pattern(3, length=40)
    frames = np.arange(int(4 * 40 * slowness)) / slowness
    motion = movement[frames.astype(int) % 40]
    found = annotate_words(pack_words(motion), loop_bank([movement.astype(float)], ["walk"]))
    assert len(found) == 1
    assert found[0].repetitions == pytest.approx(4, abs=0.1)


def test_unknown_motion_is_left_out_unless_every_frame_is_to_be_labelled():
    known, other = pattern(4), pattern(5)
    words = pack_words(np.concatenate([known] * 4 + [other] * 4 + [known] * 4))
    bank = loop_bank([known.astype(float)], ["known"])
    found = [(o.start, o.end) for o in annotate_words(words, bank)]
    assert found == [(0, 96), (192, 288)]
    filled = annotate_words(words, bank, unknown_cost=None)
    assert [(o.start, o.end) for o in filled] == [(0, 288)]


def test_templates_of_one_class_make_one_stretch():
    slow, quick = pattern(6), pattern(7)
    motion = pack_words(np.concatenate([slow] * 4 + [quick] * 4))
    bank = loop_bank([slow.astype(float), quick.astype(float)], ["run", "run"])
    (found,) = annotate_words(motion, bank)
    assert (found.start, found.end) == (0, len(motion))
    assert found.repetitions == pytest.approx(8, abs=0.2)


def test_nothing_known_is_an_empty_annotation():
    bank = loop_bank([pattern(8).astype(float)], ["known"])
    path = find_path(pack_words(pattern(9)), bank)
    assert occurrences(path, bank) == []
    assert (path.columns == -1).all()


def test_labels_and_templates_must_agree_in_number():
    with pytest.raises(ParameterError, match="1 templates have 2 labels"):
        loop_bank([np.zeros((3, 4))], ["a", "b"])
