"""How far people differ: the shipped table, and what is measured on a store."""

import numpy as np
import pytest

from mocapidx.features.featureset import load_feature_set, parse_feature_set
from mocapidx.features.words import pack_words
from mocapidx.templates.sigma import Sample, estimate_sigma, usual_sigma

F39 = load_feature_set("f39")


def sample(values, untrusted=0):
    """A document whose features are on where their values are above 0."""
    values = values.copy()
    values[:, [bit for bit in range(values.shape[1]) if untrusted >> bit & 1]] = np.nan
    return Sample(pack_words(values > 0), values, np.abs(values), untrusted)


def people_doing_gestures(sigma, rng, gestures=6, people=8):
    """Each gesture done by many people, whose values differ by `sigma` throughout."""
    frames = np.arange(45)[:, np.newaxis]
    shapes = [
        3 * np.sin(frames / rng.uniform(3, 9, len(sigma)) + rng.uniform(0, 7, len(sigma)))
        for _ in range(gestures)
    ]
    return [shape + rng.normal(0, sigma, len(sigma)) for _ in range(people) for shape in shapes]


def test_the_shipped_table_fits_its_set_and_both_sides():
    sigma = usual_sigma(F39)
    assert sigma.shape == (39,)
    assert (sigma > 0).all()
    np.testing.assert_array_equal(sigma, sigma[F39.mirror])
    # Geometric means of the two databases: 1.05, 1.04 and 1.37, 1.40 hl/s; 5.16 and 4.45 degrees.
    assert sigma[0] == pytest.approx(1.2, abs=0.01)
    assert sigma[31] == pytest.approx(4.79, abs=0.01)


def test_sets_of_other_features_get_what_is_usual_for_the_unit():
    sigma = usual_sigma(load_feature_set("f31"))
    assert sigma.shape == (31,)
    assert (sigma > 0).all()


def test_the_same_value_with_other_thresholds_has_the_same_deviation():
    text = F39.text.replace("on = 1.8", "on = 1.9")
    assert text != F39.text
    other = parse_feature_set(text)
    assert other.digest != F39.digest
    np.testing.assert_array_equal(usual_sigma(other), usual_sigma(F39))


def test_the_deviation_between_people_is_found_without_labels():
    rng = np.random.default_rng(1)
    sigma = np.linspace(0.1, 0.6, 39)
    measured = estimate_sigma(
        [sample(values) for values in people_doing_gestures(sigma, rng)], F39, 30.0
    )
    expected = (sigma + sigma[F39.mirror]) / 2
    np.testing.assert_allclose(measured, expected, rtol=0.35)
    assert np.corrcoef(measured, expected)[0, 1] > 0.95
    np.testing.assert_array_equal(measured, measured[F39.mirror])


def test_what_no_document_can_tell_is_not_measured():
    rng = np.random.default_rng(2)
    values = people_doing_gestures(np.full(39, 0.3), rng, gestures=2, people=3)
    everywhere, somewhere = 1 << 8, 1 << 30
    samples = [sample(v, everywhere | somewhere * (n % 2)) for n, v in enumerate(values)]
    measured = estimate_sigma(samples, F39, 30.0)
    assert np.isnan(measured[8])
    assert np.isfinite(np.delete(measured, 8)).all()


@pytest.mark.parametrize("count", [0, 1])
def test_too_little_motion_measures_nothing_wrong(count):
    values = np.random.default_rng(3).normal(0, 1, (60, 39))
    if count:
        measured = estimate_sigma([sample(values)], F39, 30.0)
        assert (measured > 0).all()  # the plain standard deviation
    short = estimate_sigma([sample(values[:5]), sample(values[:7])], F39, 30.0)
    assert np.isfinite(short).all()


def test_equal_samples_give_equal_numbers():
    rng = np.random.default_rng(4)
    samples = [sample(v) for v in people_doing_gestures(np.full(39, 0.3), rng, 2, 3)]
    once, again = (estimate_sigma(samples, F39, 30.0) for _ in range(2))
    assert once.tobytes() == again.tobytes()
