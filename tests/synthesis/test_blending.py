import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.synthesis.blending import blend, blend_at, blend_times
from mocapidx.synthesis.bodies import joint_points
from mocapidx.synthesis.carrying import body_difference, carried
from mocapidx.synthesis.registration import Registration
from tests.made_motions import examples_of, load_clip, placed_elsewhere, registered, slower


def clips(fixtures_dir, label):
    return sorted((fixtures_dir / "clips" / label).glob("*.amc"))


@pytest.fixture(scope="module")
def kicks(fixtures_dir):
    return examples_of(clips(fixtures_dir, "kickFrontRight"))


def alone(examples, number):
    return np.eye(len(examples.movements))[number]


def standing_alike(points):
    """Positions with the first frame's root over the origin, hips along X."""
    flat = points[..., 2] + 1j * points[..., 0]
    flat = flat - flat[0, 0]
    across = flat[0, 1] - flat[0, 5]  # left hip, right hip
    flat = flat * (1j * np.abs(across) / across)
    return np.stack((flat.imag, points[..., 1], flat.real), axis=-1)


@pytest.mark.parametrize("number", range(4))
def test_all_the_weight_on_one_example_gives_it_back(kicks, number):
    movement = kicks.movements[number]
    made = blend(kicks, alone(kicks, number), movement.rate)
    assert len(made.times) == len(movement.places)
    expected = standing_alike(joint_points(kicks.body, movement))
    found = standing_alike(joint_points(kicks.body, made.movement))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_bodies_and_movements_say_where_the_joints_of_a_file_are(fixtures_dir):
    for path in (*clips(fixtures_dir, "squat")[:2], *(fixtures_dir / "bvh/squat").glob("*.bvh")):
        body, movement, positions = load_clip(path)
        np.testing.assert_allclose(joint_points(body, movement), positions, atol=1e-9)


def test_bones_of_another_body_point_where_they_pointed(fixtures_dir):
    one, other = (load_clip(path) for path in clips(fixtures_dir, "squat")[::3])
    points = joint_points(other[0], carried(one[1], one[0], other[0]))
    before = joint_points(one[0], one[1])
    for joint, parent in ((2, 1), (3, 2), (17, 16)):  # shin and thigh, upper arm
        bones = [p[:, joint] - p[:, parent] for p in (points, before)]
        bones = [b / np.linalg.norm(b, axis=1, keepdims=True) for b in bones]
        np.testing.assert_allclose(bones[0], bones[1], atol=1e-9)
    np.testing.assert_allclose(
        np.diff(points[:, 0], axis=0),
        np.diff(before[:, 0], axis=0) * other[0].leg / one[0].leg,
        atol=1e-9,
    )


def test_other_hierarchies_are_told_apart(fixtures_dir):
    amc = load_clip(clips(fixtures_dir, "squat")[0])
    bvh = load_clip(next((fixtures_dir / "bvh/squat").glob("*.bvh")))
    assert body_difference(amc[0], amc[0]) is None
    assert "BVH" in body_difference(amc[0], bvh[0])
    with pytest.raises(ParameterError, match="BVH"):
        carried(amc[1], amc[0], bvh[0])


@settings(max_examples=15, deadline=None)
@given(
    st.floats(-3, 3),
    st.floats(-5, 5),
    st.floats(-5, 5),
    st.lists(st.floats(0.1, 1), min_size=3, max_size=3),
)
def test_equal_examples_blend_to_themselves_wherever_they_stand(squat, angle, east, north, parts):
    body, movement = squat
    examples = registered(
        body,
        [
            movement,
            placed_elsewhere(movement, angle, east, north),
            placed_elsewhere(movement, -2 * angle, north, east),
        ],
    )
    weights = np.array(parts) / np.sum(parts)
    made = blend(examples, weights, movement.rate)
    expected = standing_alike(joint_points(body, movement))
    found = joint_points(body, made.movement)
    np.testing.assert_allclose(standing_alike(found), expected, atol=1e-6)
    # in the frame of the registration it stands over the origin, whatever its own place was
    np.testing.assert_allclose(found[0, 0, [0, 2]], 0, atol=1e-9)
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.fixture(scope="module")
def squat(fixtures_dir):
    return load_clip(clips(fixtures_dir, "squat")[0])[:2]


def test_a_blend_of_two_tempos_has_the_one_between(squat):
    body, movement = squat
    examples = registered(body, [movement, slower(movement, 1.5)])
    times = blend_times(examples.registration, np.array([0.5, 0.5]))
    assert times[-1] == pytest.approx(1.25 * (len(movement.places) - 1) / movement.rate)
    made = blend(examples, np.array([0.5, 0.5]), movement.rate)
    before = joint_points(body, movement)
    at = made.times / 1.25 * movement.rate
    expected = np.stack(
        [np.interp(at, np.arange(len(before)), before[:, joint, 1]) for joint in range(24)], axis=1
    )
    np.testing.assert_allclose(joint_points(body, made.movement)[..., 1], expected, atol=5e-3)


@given(st.integers(0, 10**6), st.floats(0, 1))
def test_time_always_goes_on(seed, extrapolation):
    random = np.random.default_rng(seed)
    times = np.cumsum(random.random((20, 3)) ** 4 + 1e-4, axis=0)
    registration = Registration(
        np.linspace(0, 1, 20), times - times[0], np.zeros((20, 3)), np.zeros((20, 3), complex)
    )
    weights = np.array([1 + extrapolation, -extrapolation, 0.0])
    found = blend_times(registration, weights)
    assert found[0] == 0
    assert (np.diff(found) > 0).all()


def test_a_blend_at_moments_is_the_blend_at_their_times(kicks):
    weights = np.array([0.4, 0.3, 0.2, 0.1])
    made = blend(kicks, weights, 120.0)
    again = blend_at(kicks, weights, made.moments)
    np.testing.assert_allclose(again.times, made.times, atol=1e-9)
    np.testing.assert_allclose(
        joint_points(kicks.body, again.movement), joint_points(kicks.body, made.movement)
    )


@pytest.mark.parametrize("label", ["kickFrontRight", "walk", "jog", "hopBothLegs"])
def test_blends_move_as_smoothly_as_their_examples(fixtures_dir, label):
    examples = examples_of(clips(fixtures_dir, label))
    speeds = [
        np.linalg.norm(np.diff(joint_points(examples.body, m), axis=0), axis=2).max()
        for m in examples.movements
    ]
    weights = np.array([0.45, -0.1, 0.35, 0.3])
    points = joint_points(examples.body, blend(examples, weights, 120.0).movement)
    assert np.linalg.norm(np.diff(points, axis=0), axis=2).max() < 1.5 * max(speeds)
    bones = np.linalg.norm(points[:, 2] - points[:, 1], axis=1)
    assert np.ptp(bones) < 1e-9


def test_a_blend_of_walks_goes_as_far_as_the_walks_on_average(fixtures_dir):
    examples = examples_of(clips(fixtures_dir, "walk"))

    def distance(weights):
        places = blend(examples, weights, 120.0).movement.places
        return np.hypot(*(places[-1] - places[0])[[0, 2]])

    alone_distances = [distance(alone(examples, n)) for n in range(4)]
    half = distance(np.array([0.5, 0.5, 0, 0]))
    assert half == pytest.approx(np.mean(alone_distances[:2]), rel=0.05)


@pytest.mark.parametrize("weights", [[0.5, 0.5], [0.5, 0.5, 0.5, 0.5]])
def test_weights_that_are_none_are_refused(kicks, weights):
    with pytest.raises(ParameterError, match="weights"):
        blend(kicks, np.array(weights), 120.0)
