"""Files as their grammars allow them say what the model says that made them; then damaged ones."""

import contextlib
import random

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mocapidx.errors import MocapidxError
from mocapidx.formats.registry import read_recording, sources_of
from tests.fuzz.grammars import GRAMMARS
from tests.fuzz.mutants import damaged

SHORT, FULL = 300, 10_000


def read(folder, files):
    for name, data in files.items():
        (folder / name).write_bytes(data)
    path = folder / next(iter(files))
    return read_recording(path, skeleton_path=(*sources_of(path), None)[1])


def check(recording, model):
    """Compare what was read with what was written."""
    if "positions" in model:
        assert list(recording.names) == model["names"]
        np.testing.assert_allclose(recording.positions, model["positions"], rtol=1e-6, atol=1e-9)
    elif "turns" in model:
        kinds = recording.channel_kinds.tolist()
        np.testing.assert_array_equal(recording.values[:, [0, 1, 2]], model["root"])
        assert kinds[:3] == [0, 1, 2]
        for node in range(model["turns"].shape[1]):
            columns = np.flatnonzero(recording.channel_nodes == node)
            found = np.eye(3)
            for column in columns[3:] if node == 0 else columns:
                found = found @ turns_about(kinds[column] - 3, recording.values[:, column])
            np.testing.assert_allclose(found, model["turns"][:, node], atol=1e-7)
    else:
        skeleton = recording.skeleton
        assert sorted(skeleton.names) == sorted(model["names"])
        for name, offset in zip(skeleton.names, skeleton.offsets.tolist(), strict=True):
            np.testing.assert_allclose(offset, model["offsets"][name], rtol=1e-14)
        nodes, kinds = recording.channel_nodes.tolist(), recording.channel_kinds.tolist()
        found = {
            (skeleton.names[n], k): c for c, (n, k) in enumerate(zip(nodes, kinds, strict=True))
        }
        assert found.keys() == model["channels"].keys()
        for key, column in found.items():
            turns = key[1] >= 3 and model.get("degrees", True)
            expected = np.array(model["channels"][key]) * (np.pi / 180 if turns else 1.0)
            np.testing.assert_allclose(recording.values[:, column], expected, rtol=1e-14)
    for key in {"rate", "unit", "up"} & model.keys():
        value = getattr(recording, key)
        assert value == model[key] or abs(value / model[key] - 1) < 1e-6, key


def turns_about(axis, angles):
    """Matrices of turns about one axis."""
    cosines, sines = np.cos(angles), np.sin(angles)
    turns = np.zeros((len(angles), 3, 3))
    turns[:, axis, axis] = 1
    one, other = (axis + 1) % 3, (axis + 2) % 3
    turns[:, one, one] = turns[:, other, other] = cosines
    turns[:, other, one], turns[:, one, other] = sines, -sines
    return turns


@pytest.mark.parametrize("name", GRAMMARS)
def test_what_a_grammar_makes_is_read_as_it_was_meant(name, tmp_path, count, reported):
    tried, hurt = [], []

    @settings(
        max_examples=count(SHORT, FULL), database=None, deadline=None,
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    @given(st.integers(0, 2**48))
    def attack(seed):
        rng = random.Random(seed)
        files, model = GRAMMARS[name](rng)
        check(read(tmp_path, files), model)
        tried.append(seed)
        hit = rng.choice(sorted(files))
        files[hit] = damaged(files[hit], [files[hit]], rng)
        try:
            read(tmp_path, files)
        except MocapidxError as exc:
            hurt.append(str(exc))

    attack()
    assert all(message.isprintable() for message in hurt)
    for place in tmp_path.iterdir():
        with contextlib.suppress(OSError):
            place.unlink()
    reported(f"grammar {name}", len(tried), 0)
    assert len(hurt) > len(tried) // 20
