"""TRC: blanks, NaN in any spelling, and what a person can mend."""

import numpy as np
import pytest

from mocapidx.errors import FormatError
from mocapidx.formats.text import Limits
from mocapidx.formats.trc import read_trc
from tests.made_points import trc_text

NAMES = ["R.ASIS", "L.ASIS", "V.Sacral"]


def read(tmp_path, text):
    path = tmp_path / "x.trc"
    path.write_bytes(text.encode())
    return read_trc(path, Limits())


def some_points(frames=5):
    points = np.random.default_rng(2).normal(0, 500, (frames, 3, 3)).round(3)
    points[1:3, 1] = np.nan
    return points


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("blank", ["", " ", "NaN", "nan", "NAN", "-nan"])
def test_what_was_not_seen_is_nan_however_it_is_written(tmp_path, newline, blank):
    found = read(tmp_path, trc_text(NAMES, some_points(), 60.0, "m", newline, blank))
    np.testing.assert_allclose(found.positions, some_points(), atol=1e-6)
    assert (found.names, found.rate, found.unit) == (tuple(NAMES), 60.0, 1.0)


def test_commas_do_as_well_as_tabs(tmp_path):
    text = trc_text(NAMES, some_points()).replace("\t", ",")
    np.testing.assert_allclose(read(tmp_path, text).positions, some_points(), atol=1e-6)


def test_a_marker_with_a_coordinate_missing_was_not_seen(tmp_path):
    text = trc_text(NAMES, some_points())
    cell = f"{some_points()[0, 0, 1]:.6f}"
    assert np.isnan(read(tmp_path, text.replace(cell, "")).positions[0, 0]).all()


def test_rows_are_counted_and_a_remark_tells_of_another_number(tmp_path):
    text = trc_text(NAMES, some_points()).replace("\t5\t3\tmm", "\t900\t3\tmm")
    found = read(tmp_path, text)
    assert len(found.positions) == 5
    assert found.remarks == ("its header says 900 frames, it has 5: is it cut off?",)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("PathFileType", "HIERARCHY", "not a TRC file"),
        ("DataRate", "Rate", r"x\.trc:2: expected DataRate"),
        ("100.00", "0", r"x\.trc:3: DataRate is '0'"),
        ("\t3\tmm", "\t7\tmm", r"x\.trc:4: names 3 markers, line 3 says 7"),
        ("\n3\t", "\n4\t", r"x\.trc:9: frame 4 after 2"),
        ("\n3\t0.020000\t", "\n3\t0.020000\tabc", r"x\.trc:9: column 3 is 'abc"),
        ("\n3\t0.020000\t", "\n3\t0.020000\t1 2\t", r"x\.trc:9: column 3 holds two numbers"),
        ("\n3\t0.020000\t", "\n3\t0.020000\t1\t2\t", r"x\.trc:9: has 13 values, expected 11"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path, old, new, message):
    text = trc_text(NAMES, some_points())
    assert old in text
    with pytest.raises(FormatError, match=message) as caught:
        read(tmp_path, text.replace(old, new))
    assert "\n" not in str(caught.value)


def test_of_several_faults_the_first_is_told_and_speaks_of_its_own_line(tmp_path):
    text = trc_text(NAMES, some_points())
    lines = text.replace("\n3\t0.020000\t", "\n3\t0.020000\t1\t2\t").splitlines()
    with pytest.raises(FormatError, match=r"x\.trc:9: has 13 values, expected 11"):
        read(tmp_path, "\n".join([*lines, lines[-1] + "\t1" * 9, "4\tabc"]))


def test_a_header_alone_has_no_motion(tmp_path):
    text = trc_text(NAMES, some_points())
    with pytest.raises(FormatError, match="has no frames"):
        read(tmp_path, "\n".join(text.split("\n")[:6]))
    with pytest.raises(FormatError, match="ends within its header"):
        read(tmp_path, "\n".join(text.split("\n")[:2]))


def test_real_files_are_read(real_data):
    shapes = {
        "dataWithNaNsOfDifferentCases": (5, 14),
        "exampleFormat": (5, 3),
        "gait10dof18musc_walk_CRLF_line_ending": (10, 41),
        "pyomeca_markers": (93, 51),
        "walk_free_01": (73, 41),
    }
    for name, shape in shapes.items():
        found = read_trc(real_data / "trc" / f"{name}.trc", Limits())
        assert found.positions.shape[:2] == shape, name
    blanks = read_trc(real_data / "trc" / "exampleFormat.trc", Limits()).positions
    assert np.isnan(blanks[0, 0]).all()
    assert np.isnan(blanks[2, 1]).all()
    assert np.isfinite(blanks[1]).all()
