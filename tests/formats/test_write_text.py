from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mocapidx.errors import ParameterError
from mocapidx.formats.amc import read_amc
from mocapidx.formats.asf import read_asf
from mocapidx.formats.bvh import read_bvh
from mocapidx.formats.decimals import decimal, degrees
from mocapidx.formats.text import Limits
from mocapidx.formats.write_amc import amc_text
from mocapidx.formats.write_bvh import bvh_text
from mocapidx.model import Recording, Skeleton
from tests.small_files import AMC, ASF, BVH, PERSON, person_rows
from tests.small_files import bvh_text as small_bvh


def read_back(tmp_path, recording, rate=None):
    path = tmp_path / "written.bvh"
    path.write_bytes(bvh_text(recording, rate))
    return read_bvh(path, Limits())


def small(tmp_path, text=BVH):
    path = tmp_path / "take.bvh"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    return read_bvh(path, Limits())


def same(found, expected):
    assert found.skeleton.names == expected.skeleton.names
    np.testing.assert_array_equal(found.skeleton.parents, expected.skeleton.parents)
    np.testing.assert_array_equal(found.skeleton.offsets, expected.skeleton.offsets)
    np.testing.assert_array_equal(found.channel_nodes, expected.channel_nodes)
    np.testing.assert_array_equal(found.channel_kinds, expected.channel_kinds)
    np.testing.assert_array_equal(found.values, expected.values)
    assert found.rate == expected.rate


@pytest.mark.parametrize("text", [BVH, BVH.replace("knee", "Bip01 L Th\udcfcgh")])
def test_what_was_read_from_bvh_is_written_and_read_back_alike(tmp_path, text):
    recording = small(tmp_path, text)
    same(read_back(tmp_path, recording), recording)


def test_a_person_keeps_every_value(tmp_path):
    rows = person_rows(4)
    table = np.random.default_rng(0).normal(0, 50, (4, len(rows[0]))).round(6)
    text = small_bvh(PERSON, table.tolist(), channels="Yrotation Xrotation Zrotation")
    recording = small(tmp_path, text)
    same(read_back(tmp_path, recording), recording)


@pytest.mark.parametrize("rate", [24.0, 25.0, 29.97, 59.94, 60.0, 119.88, 120.0, 480.0])
def test_rates_read_back_to_the_last_bit_or_its_neighbour(tmp_path, rate):
    found = read_back(tmp_path, small(tmp_path), rate).rate
    assert found == rate if rate.is_integer() else abs(found - rate) <= np.spacing(rate)


@given(st.floats(-1e3, 1e3))
def test_any_angle_reads_back_to_the_last_bit_or_its_neighbour(value):
    found = degrees(np.array([value]))[0] * (np.pi / 180)
    assert abs(found - value) <= np.spacing(abs(value))
    assert float(decimal(value)) == value


@given(st.floats(-1e4, 1e4))
def test_angles_given_in_degrees_read_back_as_the_same_radians(value):
    radians = np.array([value]) * (np.pi / 180)
    np.testing.assert_array_equal(degrees(radians) * (np.pi / 180), radians)


def test_angles_with_few_decimals_keep_their_digits():
    given = np.array([90.25, -0.0, 12.345678, -179.999, 1e-4])
    assert degrees(given * (np.pi / 180)).tolist() == given.tolist()


def test_joints_may_come_in_any_order_and_lack_channels_or_good_names(tmp_path):
    skeleton = Skeleton(
        names=("a {b}\n", "left", "right", "tip/End", "left/End", "", " "),
        parents=np.array([-1, 0, 0, 2, 1, 2, 2]),
        offsets=np.arange(21.0).reshape(7, 3) / 7,
        turned_by="parent",
    )
    values = np.arange(8.0).reshape(2, 4)
    recording = Recording(
        skeleton, np.array([2, 0, 2, 0]), np.array([4, 1, 3, 5]), values, None, None
    )
    found = read_back(tmp_path, recording, 25.0)
    names = ("a _b__", "left", "left/End", "right", "tip_End", "joint", "joint_2")
    assert found.skeleton.names == names
    order = [0, 1, 4, 2, 3, 5, 6]
    np.testing.assert_array_equal(found.skeleton.offsets, skeleton.offsets[order])
    assert found.rate == 25.0
    channels = list(zip(found.channel_nodes.tolist(), found.channel_kinds.tolist(), strict=True))
    columns = [channels.index(c) for c in ((3, 4), (0, 1), (3, 3), (0, 5))]
    np.testing.assert_allclose(found.values[:, columns], values, rtol=1e-15)
    assert not np.delete(found.values, columns, axis=1).any()


@pytest.mark.parametrize("rate", [None, 0.0, -1.0, float("nan")])
def test_without_a_rate_there_is_no_bvh(tmp_path, rate):
    recording = replace(small(tmp_path), rate=rate)
    with pytest.raises(ParameterError, match="needs a rate"):
        bvh_text(recording)


def test_gaps_and_acclaim_bones_are_refused(tmp_path):
    recording = small(tmp_path)
    with pytest.raises(ParameterError, match="NaN"):
        bvh_text(replace(recording, values=recording.values * np.nan))
    with pytest.raises(ParameterError, match="bones"):
        bvh_text(replace(recording, skeleton=replace(recording.skeleton, turned_by="own")))


def acclaim_pair(tmp_path):
    (tmp_path / "small.asf").write_text(ASF)
    (tmp_path / "small.amc").write_text(AMC)
    return (
        read_amc(tmp_path / "small.amc", None, Limits()),
        read_asf(tmp_path / "small.asf", Limits()),
    )


@pytest.mark.parametrize("rate", [None, 120.0, 59.94])
def test_what_was_read_from_amc_is_written_and_read_back_alike(tmp_path, rate):
    recording, acclaim = acclaim_pair(tmp_path)
    (tmp_path / "again.amc").write_bytes(amc_text(recording, acclaim, rate))
    found = read_amc(tmp_path / "again.amc", tmp_path / "small.asf", Limits())
    same(found, replace(recording, rate=rate))


def test_an_amc_of_other_bones_is_refused(tmp_path):
    recording, acclaim = acclaim_pair(tmp_path)
    with pytest.raises(ParameterError, match="other bones"):
        amc_text(small(tmp_path), acclaim)
    few = replace(
        recording,
        channel_nodes=recording.channel_nodes[1:],
        channel_kinds=recording.channel_kinds[1:],
        values=recording.values[:, 1:],
    )
    with pytest.raises(ParameterError, match="bone root lacks"):
        amc_text(few, acclaim)
