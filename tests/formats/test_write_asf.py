from dataclasses import replace

import numpy as np
import pytest

from mocapidx.errors import ParameterError
from mocapidx.formats.asf import read_asf
from mocapidx.formats.text import Limits
from mocapidx.formats.write_asf import asf_text
from mocapidx.model import Skeleton
from mocapidx.units import ACCLAIM, INCH

BONES = Skeleton(
    names=("root", "thigh", "shank", "stump", "other"),
    parents=np.array([-1, 0, 1, 2, 0]),
    offsets=np.array([[0, 0, 0], [0.1, -7, 0.3], [0, -6.5, 1], [0, 0, 0], [1, 0, 0.0]]),
    turned_by="own",
)


@pytest.mark.parametrize("unit", [ACCLAIM, INCH, 0.01, 1.0])
def test_bones_read_back_where_they_were(tmp_path, unit):
    path = tmp_path / "s.asf"
    path.write_bytes(asf_text(BONES, unit, "blend"))
    found = read_asf(path, Limits())
    order = [found.skeleton.names.index(name) for name in BONES.names]
    np.testing.assert_allclose(found.skeleton.offsets[order], BONES.offsets, atol=1e-12)
    parents = [found.skeleton.names[p] if p >= 0 else "" for p in found.skeleton.parents[order]]
    assert parents == ["", "root", "thigh", "shank", "root"]
    assert found.unit == pytest.approx(unit)
    np.testing.assert_allclose(found.skeleton.axes, np.broadcast_to(np.eye(3), (5, 3, 3)))
    assert found.columns[1:] == ((3, 4, 5),) * 4


def test_joints_and_gaps_are_refused():
    with pytest.raises(ParameterError, match="bones"):
        asf_text(replace(BONES, turned_by="parent"), 1.0, "x")
    with pytest.raises(ParameterError, match="NaN"):
        asf_text(replace(BONES, offsets=BONES.offsets * np.nan), 1.0, "x")
