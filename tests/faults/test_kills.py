"""Commands that are killed at random moments; what they said is on disk is there."""

import random
import signal

import pytest

from tests.faults.killing import LONG_RUNS

SIGNALS = (signal.SIGKILL, signal.SIGTERM)
KILLED = [name for name in LONG_RUNS if name.startswith(("index", "learn", "compact", "web"))]
SHORT, FULL = 100, 10_000
WITH_WORKERS = 0.03  # part of the runs: starting workers takes longer than all else
STARTED = ("index-new", "learn-new", "compact", "web-new")  # as the program that is installed
STARTED_SHORT, STARTED_FULL = 4, 400


def attacked(found, kills, share):
    wrong = found.attack(kills, SIGNALS, share)
    return wrong, f"{len(wrong)} of {kills}:\n" + "\n".join(wrong[:5])


@pytest.mark.parametrize("name", KILLED)
def test_what_a_killed_command_acknowledged_is_there(name, course, is_full, reported):
    kills = -(-(FULL if is_full else SHORT) // len(KILLED))
    found = course(name, random.Random(name))
    wrong, told = attacked(found, kills, WITH_WORKERS)
    reported(f"kills {name}, slowest {found.slowest:.2f} s", kills, len(wrong))
    assert not wrong, told


@pytest.mark.parametrize("name", STARTED)
def test_a_killed_program_loses_nothing(name, course, is_full, reported):
    kills = (STARTED_FULL if is_full else STARTED_SHORT) // len(STARTED)
    found = course(name, random.Random(name), program=True)
    wrong, told = attacked(found, kills, share=0.2 if is_full else 0.0)
    reported(f"kills program {name}, slowest {found.slowest:.2f} s", kills, len(wrong))
    assert not wrong, told
