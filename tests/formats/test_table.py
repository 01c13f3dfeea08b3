import tracemalloc

import numpy as np
import pytest

from mocapidx.formats import table
from mocapidx.formats.amc import read_amc
from mocapidx.formats.table import FrameTable
from mocapidx.formats.text import Limits
from tests.small_files import AMC, ASF


@pytest.fixture(params=[1, 1 << 15])
def step(request, monkeypatch):
    """Room for two frames at first, or for all."""
    monkeypatch.setattr(table, "STEP", request.param)


@pytest.mark.usefixtures("step")
def test_frames_are_scaled_and_put_in_the_order_of_the_channels():
    numbers = np.random.default_rng(0).normal(size=(50, 3))
    frames = FrameTable(np.array([2, 0, 1]), np.array([1.0, 2.0, 0.5]))
    for part in np.array_split(numbers, 7):
        frames.extend(part)
    assert frames.frames == 50
    np.testing.assert_array_equal(frames.finish(), numbers[:, [1, 2, 0]] * [2.0, 0.5, 1.0])


@pytest.mark.usefixtures("step")
def test_a_reader_goes_on_where_room_had_run_out():
    text = b"".join(b"%d\n" % i for i in range(100)) + b"x\n5\n"

    def read(text, at, first, targets, scales, values, row):
        """Read one number a line from `first` on, as the kernel reads frames."""
        count = 0
        while row + count < len(values) and text[at : at + 1].isdigit():
            end = text.index(b"\n", at)
            number = int(text[at:end])
            assert number == first + count
            values[row + count] = number * scales
            at, count = end + 1, count + 1
        return count, at, count

    frames = FrameTable(np.array([0]), np.array([1.0]))
    assert frames.scan(read, text, 0, 0) == (text.index(b"x"), 100)
    assert frames.finish()[:, 0].tolist() == list(range(100))


@pytest.mark.parametrize(("done", "size"), [(10, 1000), (10, 10), (0, 0), (1000, 10), (1, 1 << 20)])
@pytest.mark.usefixtures("step")
def test_what_is_expected_changes_nothing_but_the_room(done, size):
    frames = FrameTable(np.arange(2), np.ones(2))
    frames.extend(np.ones((5, 2)))
    frames.expect(done, size)
    frames.extend(np.full((40, 2), 2.0))
    assert frames.finish().tolist() == [[1.0, 1.0]] * 5 + [[2.0, 2.0]] * 40


def test_a_long_take_needs_hardly_more_memory_than_its_values(tmp_path):
    head, frame = AMC[: AMC.index("1\n")], AMC[AMC.index("1\n") + 2 : AMC.index("2\n")]
    path = tmp_path / "take.amc"
    path.write_text(head + "".join(f"{i}\n{frame}" for i in range(1, 300_001)))
    (tmp_path / "small.asf").write_text(ASF)
    read_amc(path, None, Limits())
    tracemalloc.start()
    values = read_amc(path, None, Limits()).values
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert values.nbytes == 24e6
    assert peak < 1.2 * values.nbytes + 16e6
