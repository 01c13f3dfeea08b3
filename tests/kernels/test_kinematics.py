"""The compiled forward kinematics gives the bits of NumPy, whatever the skeleton."""

import numpy as np
import pytest

from mocapidx.formats.registry import read_recording
from mocapidx.skeleton import kinematics
from mocapidx.skeleton.kinematics import node_positions
from tests.made_recordings import random_recording

KERNEL = pytest.importorskip("mocapidx.kernels._kinematics", reason="the kernels weren't built")


class AtLevel:
    """The kernel, held to one set of instructions."""

    def __init__(self, level):
        self.level = level

    def place_nodes(self, *arguments):
        """Place the nodes."""
        KERNEL.place_nodes(*arguments, self.level)


def both_ways(recording, nodes, positions="add", level=None):
    found = []
    for kernel in (AtLevel(level), None):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(kinematics, "compiled", lambda name, kernel=kernel: kernel)
            found.append(node_positions(recording, nodes, positions))
    return found


def assert_same_bits(one, other):
    np.testing.assert_array_equal(one.view(np.uint64), other.view(np.uint64))


@pytest.mark.parametrize("level", KERNEL.levels())
@pytest.mark.parametrize("turned_by", ["own", "parent"])
@pytest.mark.parametrize("seed", range(20))
def test_any_tree_is_the_same_bits_as_in_numpy(seed, turned_by, level):
    recording = random_recording(seed, turned_by, frames=(1, 5, 64, 65, 200)[seed % 5])
    count = len(recording.skeleton.names)
    nodes = np.random.default_rng(seed).integers(-1, count, count + 2).tolist()
    for positions in ("add", "replace"):
        assert_same_bits(*both_ways(recording, nodes, positions, level))


@pytest.mark.parametrize("wanted", [[], [-1], [-1, -1]])
def test_where_nothing_is_wanted_nothing_is_known(wanted):
    for found in both_ways(random_recording(1, "own"), wanted):
        assert found.shape == (5, len(wanted), 3)
        assert np.isnan(found).all()


def test_infinite_angles_give_no_points_on_both_paths():
    recording = random_recording(2, "own")
    recording.values[1:3] = np.inf
    with np.errstate(invalid="ignore"):
        compiled, numpy = both_ways(recording, range(len(recording.skeleton.names)))
    np.testing.assert_array_equal(np.isnan(compiled), np.isnan(numpy))


def test_real_files_are_the_same_bits_on_both_paths(real_data):
    for path in sorted(p for p in real_data.rglob("*") if p.suffix in (".amc", ".bvh"))[::41]:
        recording = read_recording(path)
        assert_same_bits(*both_ways(recording, range(len(recording.skeleton.names))))


def arrays(**changes):
    """What places two nodes, the second one turned about x, over four frames."""
    given = {
        "nodes": np.array([[-1, -1, 1, -1], [0, 0, 2, 0]]),
        "changes": np.ones((2, 3, 3)),
        "offsets": np.ones((2, 3)),
        "bounds": np.array([0, 0, 1]),
        "axes": np.array([0]),
        "cosines": np.ones((1, 4)),
        "sines": np.zeros((1, 4)),
        "moved": np.ones((1, 3, 4)),
        "wanted": np.array([0, 1]),
        "positions": np.zeros((4, 2, 3)),
    }
    return list((given | changes).values())


def test_the_arrays_of_the_next_test_are_right():
    KERNEL.place_nodes(*arrays())


@pytest.mark.parametrize(
    "changes",
    [
        {"nodes": np.array([[-1, -1, 1, -1], [1, 0, 2, 0]])},  # its own parent
        {"nodes": np.array([[-2, -1, 1, -1], [0, 0, 2, 0]])},
        {"nodes": np.array([[-1, -1, 1, -1], [0, 2, 2, 0]])},  # turned by a later one
        {"nodes": np.array([[-1, -1, 3, -1], [0, 0, 2, 0]])},
        {"nodes": np.array([[-1, -1, 1, -1], [0, 0, 2, 1]])},  # moved by a row that isn't there
        {"nodes": np.array([[-1, -1, 1], [-1, 0, 0]])},
        {"changes": np.ones((1, 3, 3))},
        {"offsets": np.ones(3)},
        {"bounds": np.array([0, 1])},
        {"bounds": np.array([0, 2, 1])},
        {"bounds": np.array([0, 0, 2])},
        {"axes": np.array([3])},
        {"axes": np.array([-1])},
        {"axes": np.array([0, 1])},
        {"cosines": np.ones((1, 3))},
        {"sines": np.ones((2, 4))},
        {"moved": np.ones((1, 3, 5))},
        {"wanted": np.array([0, 2])},
        {"wanted": np.array([0, -2])},
        {"positions": np.zeros((4, 2, 2))},
    ],
    ids=str,
)
def test_arrays_that_do_not_fit_each_other_are_refused(changes):
    with pytest.raises(ValueError, match="don't fit"):
        KERNEL.place_nodes(*arrays(**changes))


@pytest.mark.parametrize(
    "changes",
    [
        {"nodes": np.zeros((2, 4))},
        {"offsets": np.ones((2, 3), dtype=np.float32)},
        {"positions": np.zeros((4, 2, 3), dtype=np.int64)},
    ],
    ids=str,
)
def test_arrays_of_another_type_are_refused(changes):
    with pytest.raises(TypeError, match="wrong type"):
        KERNEL.place_nodes(*arrays(**changes))
