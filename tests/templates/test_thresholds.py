import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.features.words import pack_words
from mocapidx.templates.learn import learn_template
from mocapidx.templates.match import distance_function
from mocapidx.templates.template import MotionTemplate
from mocapidx.templates.thresholds import (
    RIVAL_SLACK,
    Clip,
    Threshold,
    background_cost,
    beaten_by_rivals,
    held_out_costs,
    learn_threshold,
    lowest_in_clips,
    own_threshold,
)


def movement(seed, frames=20, features=12):
    return np.random.default_rng(seed).random((frames // 4, features)).repeat(4, axis=0) < 0.5


def variants(seed, count, noise=0.05):
    rng = np.random.default_rng(seed + 100)
    one = movement(seed)
    return [one ^ (rng.random(one.shape) < noise) for _ in range(count)]


def clips(matrices):
    return [Clip(pack_words(matrix)) for matrix in matrices]


def learner(matrices):
    return lambda numbers: learn_template([matrices[number] for number in numbers]).matrix


def lowest(matrix, clip):
    template = MotionTemplate("x", matrix, "", 30.0)
    return distance_function(template, clip.words, untrusted=clip.untrusted).min()


def test_lowest_costs_are_those_of_the_distance_functions():
    matrix = learn_template(variants(1, 5)).matrix
    rng = np.random.default_rng(0)
    some = [
        Clip(rng.integers(0, 1 << 12, size=n, dtype=np.uint64), mask)
        for n, mask in ((30, 0), (5, 0), (80, 0b111), (1, 0), (40, 0b111))
    ]
    found = lowest_in_clips(matrix, 0.1, some)
    np.testing.assert_array_equal(found, [lowest(matrix, clip) for clip in some])


def test_examples_are_matched_without_their_group():
    examples = variants(2, 5)
    groups = ["ann", "bob", "ann", "cleo", "bob"]
    costs = held_out_costs(0.1, clips(examples), groups, learner(examples))
    for number, clip in enumerate(clips(examples)):
        rest = [m for m, g in zip(examples, groups, strict=True) if g != groups[number]]
        assert costs[number] == pytest.approx(lowest(learn_template(rest).matrix, clip))


def test_examples_of_one_group_are_left_out_one_by_one():
    examples = variants(3, 4)
    costs = held_out_costs(0.1, clips(examples), ["ann"] * 4, learner(examples))
    for number, clip in enumerate(clips(examples)):
        rest = examples[:number] + examples[number + 1 :]
        assert costs[number] == pytest.approx(lowest(learn_template(rest).matrix, clip))


def test_a_threshold_lies_between_own_and_other_motion():
    examples, others = variants(4, 6), variants(5, 3) + variants(6, 3)
    matrix = learn_template(examples).matrix
    groups = list("aabbcc")
    found = learn_threshold(
        matrix, 0.1, clips(examples), groups, clips(others), [], learner(examples)
    )
    held_out = held_out_costs(0.1, clips(examples), groups, learner(examples))
    assert found.positive_cost == pytest.approx(np.median(held_out))
    assert found.background_cost == pytest.approx(min(lowest(matrix, c) for c in clips(others)))
    assert found.tau == pytest.approx(0.3 * found.positive_cost + 0.7 * found.background_cost)
    assert found.positive_cost < found.tau < found.background_cost
    assert found.separation == pytest.approx(found.positive_cost / found.background_cost)


def test_a_few_occurrences_in_the_background_do_no_harm():
    examples = variants(7, 4)
    matrix = learn_template(examples).matrix
    elsewhere = [movement(seed) for seed in range(20, 120)]
    clean = background_cost(matrix, 0.1, [], clips(elsewhere))
    mixed = background_cost(matrix, 0.1, [], clips([*elsewhere, examples[0]]))
    assert mixed == pytest.approx(clean, rel=0.2)
    other = clips(variants(8, 1))
    both = background_cost(matrix, 0.1, other, clips(elsewhere))
    assert both == pytest.approx(min(clean, lowest(matrix, other[0])))


def test_without_other_motion_or_a_second_example_there_is_no_threshold():
    examples = variants(9, 2)
    matrix = learn_template(examples).matrix
    alone = learn_threshold(matrix, 0.1, clips(examples), ["a", "b"], [], [], learner(examples))
    assert alone.positive_cost is not None
    assert alone.background_cost is None
    assert alone.tau is None
    assert alone.separation is None
    single = learn_threshold(
        matrix, 0.1, clips(examples[:1]), ["a"], clips(variants(10, 2)), [], learner(examples)
    )
    assert single.positive_cost is None
    assert single.background_cost is not None
    assert single.tau is None
    assert Threshold(0.1, 0.0, 0.03).separation == math.inf


hits = st.lists(
    st.tuples(st.integers(0, 60), st.integers(1, 25), st.integers(0, 5), st.integers(0, 2)),
    max_size=25,
)


@given(hits)
def test_rivals_are_those_of_the_definition(rows):
    starts, lengths, levels, classes = np.array(rows, dtype=np.int64).reshape(-1, 4).T
    ends = starts + lengths
    found = beaten_by_rivals(starts, ends, levels / 5, classes)
    for i in range(len(rows)):
        expected = any(
            classes[j] != classes[i]
            and levels[j] < levels[i]
            and 2 * (min(ends[i], ends[j]) - max(starts[i], starts[j]))
            > min(lengths[i], lengths[j])
            for j in range(len(rows))
        )
        assert found[i] == expected


def test_a_learned_threshold_is_wider_where_rivals_decide_too():
    template = MotionTemplate("x", np.ones((4, 2)), "", 30.0)
    assert own_threshold(template, rivals=True) == template.threshold  # none was learned
    learned = replace(template, tau=0.05)
    assert own_threshold(learned, rivals=False) == 0.05
    assert own_threshold(learned, rivals=True) == pytest.approx(0.05 * RIVAL_SLACK)


def test_clips_that_tell_next_to_nothing_set_no_threshold():
    examples = variants(1, 4)
    matrix = learner(examples)(range(4))
    other = clips([movement(9, 60)])
    leg = [Clip(clip.words, (1 << 12) - 2) for clip in clips(examples)]
    expected = background_cost(matrix, 0.1, other)
    assert background_cost(matrix, 0.1, [*other, *leg], leg) == expected
    assert background_cost(matrix, 0.1, leg, leg) is None
