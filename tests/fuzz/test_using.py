"""What is run on forged stores works on a sound one; otherwise the attack would prove nothing."""

import shutil

import pytest

from mocapidx.store.read import open_store
from tests.fuzz.using import COMMANDS, Asked


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_that_is_run_on_forged_stores_works_on_a_sound_one(name, seeds, tmp_path):
    shutil.copytree(seeds / "forged-used.beside", tmp_path, dirs_exist_ok=True)
    store, folder = tmp_path / "take.store", tmp_path / "results"
    folder.mkdir()
    with open_store(store) as snapshot:
        names = [placed.document.name for placed in snapshot.documents()]
    COMMANDS[name](Asked(store, names, folder))
