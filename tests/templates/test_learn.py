import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.alignment.dtw import align
from mocapidx.errors import ParameterError
from mocapidx.templates import learn
from mocapidx.templates.learn import average, learn_template, unwarp, warp
from tests import naive_alignment as naive


def stretched(rng, pattern):
    """A performance of a pattern: every frame lasts one to three frames."""
    return np.repeat(pattern, rng.integers(1, 4, len(pattern)), axis=0)


@given(st.integers(0, 2**32))
def test_warping_matches_exact_fractions(seed):
    rng = np.random.default_rng(seed)
    reference, matrix = rng.random((6, 2)) < 0.5, rng.random((9, 2)) < 0.5
    weights = rng.integers(1, 4, 9) / 2
    _, path = naive.dtw(reference.tolist(), matrix.tolist())
    rows, columns = map(np.array, zip(*path, strict=True))
    warped, new_weights = warp(matrix.astype(np.float64), weights, rows, columns)
    expected, expected_weights = naive.warp(matrix.astype(int).tolist(), weights.tolist(), path)
    np.testing.assert_allclose(warped, np.array(expected, dtype=np.float64), atol=1e-12)
    np.testing.assert_allclose(new_weights, np.array(expected_weights, dtype=np.float64))
    assert new_weights.sum() == pytest.approx(weights.sum())


@given(
    st.lists(
        st.tuples(st.integers(0, 4), st.fractions("1/8", 4, max_denominator=8)),
        min_size=1,
        max_size=9,
    )
)
def test_unwarping_matches_exact_integration(columns):
    values, weights = zip(*columns, strict=True)
    matrix, lengths = unwarp(
        np.array(values, dtype=np.float64)[:, None], np.array(weights, dtype=np.float64)
    )
    expected, expected_lengths = naive.unwarp([[value] for value in values], list(weights))
    np.testing.assert_allclose(matrix, np.array(expected, dtype=np.float64), atol=1e-9)
    np.testing.assert_allclose(lengths, np.array(expected_lengths, dtype=np.float64))
    assert lengths.sum() == pytest.approx(float(sum(weights)))


@pytest.mark.parametrize(
    ("values", "weights", "expected", "last"),
    [
        ([0, 1, 2, 3, 4], [0.5, 0.5, 1, 2, 0.25], [0.5, 2, 3, 3, 4], 0.25),
        ([0, 1, 2, 3], [0.3, 0.3, 0.3, 2.6], [1.2, 3, 3, 3], 0.5),
        ([0, 1, 2, 3], [1.5, 0.7, 0.7, 0.1], [0, 0.5, 1.9], 1.0),
    ],
)
def test_unwarping_contracts_duplicates_and_averages_in_part(values, weights, expected, last):
    matrix, lengths = unwarp(np.array(values, float)[:, None], np.array(weights, float))
    np.testing.assert_allclose(matrix[:, 0], expected)
    assert lengths[-1] == pytest.approx(last)


def test_performances_of_one_pattern_at_other_speeds_keep_its_steps_and_their_order():
    rng = np.random.default_rng(3)
    learned = learn_template([stretched(rng, np.eye(8, dtype=bool)) for _ in range(5)])
    clearest = learned.matrix.argmax(axis=0)
    assert (learned.matrix.max(axis=0) > 0.5).all()
    assert (np.diff(clearest) > 0).all()
    assert max(learned.spread) < 0.1


def test_a_feature_that_varies_is_grey_all_the_time():
    rng = np.random.default_rng(4)
    steps = np.eye(6, dtype=bool)
    examples = []
    for example in range(8):
        matrix = stretched(rng, np.hstack((steps, steps)))
        accident = np.full((len(matrix), 1), example % 2 == 0)
        examples.append(np.hstack((matrix, accident)))
    grey = learn_template(examples).matrix[:, -1]
    assert 0.2 < grey.min() <= grey.max() < 0.8


def test_the_length_is_the_mean_length_rounded_up():
    rng = np.random.default_rng(5)
    examples = [rng.random((length, 4)) < 0.5 for length in (10, 12, 15)]
    learned = learn_template(examples)
    assert learned.mean_length == pytest.approx(37 / 3)
    assert len(learned.matrix) == 13
    assert learned.matrix.min() >= 0
    assert learned.matrix.max() <= 1


def test_one_example_is_its_own_template():
    example = np.random.default_rng(6).random((7, 3)) < 0.5
    learned = learn_template([example])
    np.testing.assert_array_equal(learned.matrix, example)
    assert learned.passes == 0
    assert learned.spread == (0.0,)


def test_equal_examples_give_the_example_after_two_passes():
    example = np.random.default_rng(7).random((7, 3)) < 0.5
    learned = learn_template([example, example, example])
    np.testing.assert_allclose(learned.matrix, example)
    assert learned.passes == 2


def test_the_average_follows_the_definition_with_exact_fractions():
    rng = np.random.default_rng(8)
    examples = [(rng.random((n, 3)) < 0.5).astype(float) for n in (6, 8, 7)]
    matrix, weights = average(1, examples, [np.ones(len(x)) for x in examples])
    sums, totals = [[Fraction(0)] * 3 for _ in range(8)], [Fraction(0)] * 8
    for example in examples:
        _, path = naive.dtw(examples[1].tolist(), example.tolist())
        warped, own = naive.warp(example.tolist(), [1] * len(example), path)
        for k in range(8):
            totals[k] += own[k]
            sums[k] = [s + own[k] * x for s, x in zip(sums[k], warped[k], strict=True)]
    expected = [[s / t for s in row] for row, t in zip(sums, totals, strict=True)]
    np.testing.assert_allclose(matrix, np.array(expected, dtype=float), atol=1e-12)
    np.testing.assert_allclose(weights, np.array(totals, dtype=float) / 3)
    assert math.isclose(weights.sum(), 7.0)


@pytest.mark.parametrize(
    ("examples", "complaint"),
    [
        ([], "no example"),
        ([np.zeros((2, 3), dtype=bool)], "at least 3 frames, got 2"),
        ([np.zeros((3, 3)), np.zeros((3, 4))], "shape"),
    ],
)
def test_examples_that_nothing_can_be_learned_from_are_refused(examples, complaint):
    with pytest.raises(ParameterError, match=complaint):
        learn_template(examples)


def test_very_many_examples_cost_no_more_than_their_number(monkeypatch):
    rng = np.random.default_rng(5)
    pattern = rng.random((8, 5)) < 0.5
    examples = [stretched(rng, pattern) for _ in range(90)]
    calls = []

    def counted(reference, matrices):
        calls.append(len(matrices))
        return align(reference, matrices)

    monkeypatch.setattr(learn, "align", counted)
    learned = learn_template(examples)
    assert calls.count(90) == 64 + 1  # each reference once, and the spread at the end
    assert len(learned.spread) == 90
    few = learn_template(examples[:60])
    assert abs(learned.matrix.mean() - few.matrix.mean()) < 0.05
