import numpy as np
import pytest

from mocapidx.errors import ParameterError
from mocapidx.synthesis.bodies import joint_points
from mocapidx.synthesis.registration import register, timewarp_between
from tests.made_motions import load_clip, placed_elsewhere, registered, slower


@pytest.fixture(scope="module")
def clip(fixtures_dir):
    path = sorted((fixtures_dir / "clips/kickFrontRight").glob("*.amc"))[0]
    return load_clip(path)[:2]


def test_curves_increase_and_lead_from_first_frames_to_last(clip):
    body, movement = clip
    examples = registered(body, [movement, slower(movement, 2.0)])
    registration = examples.registration
    assert (np.diff(registration.times, axis=0) > 0).all()
    duration = (len(movement.places) - 1) / movement.rate
    np.testing.assert_allclose(registration.times[0], 0)
    np.testing.assert_allclose(registration.times[-1], [duration, 2 * duration])


def test_a_copy_elsewhere_is_laid_upon_the_first(clip):
    body, movement = clip
    other = placed_elsewhere(movement, 2.0, 3.0, -4.0)
    registration = registered(body, [movement, other]).registration
    points = [joint_points(body, m)[[0, -1], 0] for m in (movement, other)]
    laid = []
    for number, place in enumerate(points):
        turn, shift = registration.turns[[0, -1], number], registration.shifts[[0, -1], number]
        laid.append(np.exp(1j * turn) * (place[:, 2] + 1j * place[:, 0]) + shift)
    np.testing.assert_allclose(laid[0], laid[1], atol=1e-9)
    np.testing.assert_allclose(laid[0][0], 0, atol=1e-9)


def moving(durations, bends):
    """Made-up motions: one joint circles, late or early; the others stand."""
    poses = []
    for duration, bend in zip(durations, bends, strict=True):
        phase = np.linspace(0, 1, round(duration * 30) + 1) ** bend
        pose = np.zeros((len(phase), 24, 3))
        pose[:, 1, 0], pose[:, 5, 0] = 0.1, -0.1
        pose[:, 8] = np.stack(
            (np.sin(2 * np.pi * phase), 1 + np.cos(2 * np.pi * phase), 0 * phase), axis=1
        )
        poses.append(pose)
    return poses


def test_a_timewarp_finds_what_was_done_to_time():
    one, other = moving((3.0, 4.0), (1.0, 1.5))
    curve = timewarp_between(one, other)
    shares = curve(np.arange(len(one)).astype(float)) / (len(other) - 1)
    expected = np.linspace(0, 1, len(one)) ** (1 / 1.5)
    np.testing.assert_allclose(shares[10:], expected[10:], atol=0.03)


def test_alignments_go_along_the_cheapest_way(monkeypatch):
    from mocapidx.synthesis import registration

    poses = moving((2.0, 2.2, 2.4), (1.0, 1.2, 1.4))
    aligned = []
    plain = registration.timewarp_between

    def watched(one, other):
        aligned.append(tuple(next(n for n, p in enumerate(poses) if len(p) == len(each))
                             for each in (one, other)))  # fmt: skip
        return plain(one, other)

    monkeypatch.setattr(registration, "timewarp_between", watched)
    ties = [(0, 1, 0.1), (1, 2, 0.1), (0, 2, 0.3)]
    found = register(poses, [2.0, 2.2, 2.4], ties, [0, 2], list("abc"), 61)
    assert aligned == [(0, 1), (1, 2)]
    assert found.times.shape == (61, 2)
    expected = 2.4 * np.linspace(0, 1, 61) ** (1 / 1.4)
    np.testing.assert_allclose(found.times[10:, 1], expected[10:], atol=0.12)


def test_what_no_way_leads_to_or_lasts_too_long_is_named():
    poses = moving((1.0, 1.0, 4.0), (1.0, 1.0, 1.0))
    with pytest.raises(ParameterError, match="no way from a to c"):
        register(poses, [1.0, 1.0, 4.0], [(0, 1, 0.1)], [0, 1, 2], list("abc"), 31)
    with pytest.raises(ParameterError, match=r"c lasts 4\.00 s and a 1\.00 s.*3 times"):
        register(poses, [1.0, 1.0, 4.0], [(0, 2, 0.1)], [0, 2], list("abc"), 31)
