"""Writers that are killed: at every step of a commit, and at random moments."""

import os
import random
import shutil
import signal
import time
from functools import partial

import pytest

from mocapidx.store import schema
from mocapidx.store.read import open_store
from mocapidx.store.write import writing
from tests.made_store import SETTINGS, make_batch, names_of, read_everything

# The children only write a store and die, and need none of the test runner's threads.
pytestmark = pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")

ROUNDS = 200
STEPS = ("open", "write", "fsync", "rename", "unlink", "mkdir")


def in_child(work):
    """Run `work` in a copy of this process and give how it ended; nothing of it is cleaned up."""
    child = os.fork()
    if not child:
        try:
            work()
            os._exit(0)
        except BaseException:
            os._exit(99)
    return child


def ending(child):
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def check_no_debris(store):
    """After a writer has been there, the folder holds what the manifest names and nothing else."""
    with open_store(store) as snapshot:
        named = {name for file in snapshot.files for name in file.names}
    assert {place.name for place in (store / "segments").iterdir()} == named
    assert {place.name for place in store.iterdir()} == {"MANIFEST", "LOCK", "segments"}


def dying_before(step, work):
    """Do `work`, and end without a word just before the given call to the system."""
    steps = 0

    def counting(real):
        def call(*args, **kwargs):
            nonlocal steps
            steps += 1
            if steps > step:
                os._exit(9)
            return real(*args, **kwargs)

        return call

    for name in STEPS:
        setattr(os, name, counting(getattr(os, name)))
    work()


def two_commits(store):
    with writing(store, command="test") as writer:
        writer.commit(make_batch({"new": 10}), remove=["c.bvh"])
        writer.commit(None, remove=["new"])


def first_commit(store):
    with writing(store, command="test", create=SETTINGS) as writer:
        writer.commit(make_batch({"a": 5}))


def test_a_writer_killed_before_any_step_leaves_one_of_the_states(made_store, tmp_path):
    before = names_of(made_store)
    after = sorted({*before} - {"c.bvh"})
    states = [before, sorted([*after, "new"]), after]
    reached, step, code = [], 0, 9
    while code:
        store = shutil.copytree(made_store, tmp_path / f"{step}.store")
        code = ending(in_child(partial(dying_before, step, partial(two_commits, store))))
        assert code in (0, 9)
        read_everything(store)
        reached.append(states.index(names_of(store)))
        with writing(store, command="test"):
            check_no_debris(store)
        step += 1
    assert reached == sorted(reached)
    assert set(reached) == {0, 1, 2}
    assert step > 25


def test_the_first_commit_of_a_store_is_there_or_not(tmp_path):
    found, step, code = [], 0, 9
    while code:
        store = tmp_path / f"{step}.store"
        code = ending(in_child(partial(dying_before, step, partial(first_commit, store))))
        assert code in (0, 9)
        found.append((store / schema.MANIFEST).exists())
        first_commit(store)
        with writing(store, command="test"):
            check_no_debris(store)
        assert names_of(store) == ["a"]
        step += 1
    assert found == sorted(found)
    assert set(found) == {False, True}


def commit_for_ever(store, ready):
    """Replace a document by a longer one, again and again; say so after each commit."""
    with writing(store, command="test", create=SETTINGS, lock_timeout=5) as writer:
        length = writer.documents()[0].frames if writer.manifest.files else 0
        while True:
            length += 1
            writer.commit(make_batch({"growing": length}))
            os.write(ready, b".")


def test_killed_at_random_two_hundred_times(tmp_path):
    store, chance = tmp_path / "takes.store", random.Random(1)
    begin = time.perf_counter()
    ending(in_child(partial(first_commit, tmp_path / "clock.store")))
    longest = min(2 * (time.perf_counter() - begin), 0.1)
    length = 0
    for _ in range(ROUNDS):
        heard, ready = os.pipe()
        child = in_child(partial(commit_for_ever, store, ready))
        os.close(ready)
        time.sleep(chance.uniform(0.0, longest))
        os.kill(child, signal.SIGKILL)
        assert ending(child) == -signal.SIGKILL
        said = 0
        while data := os.read(heard, 4096):
            said += len(data)
        os.close(heard)
        if (store / schema.MANIFEST).exists():
            read_everything(store)
            with open_store(store) as snapshot:
                (entry,) = snapshot.documents()
            # What was reported is there, and at most the one commit that was under way besides.
            assert length + said <= entry.document.frames <= length + said + 1
            length = entry.document.frames
        else:
            assert said == 0
    with writing(store, command="test"):
        check_no_debris(store)
    assert length > 0
