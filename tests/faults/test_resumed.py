"""Commands that are stopped and run again, until they make what one clean run makes."""

import random
import signal

import pytest

from tests.faults.killing import LONG_RUNS

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
SHORT, FULL = 10, 1000  # of all commands together
MOST_STOPS = 4
WITH_WORKERS = 0.03


@pytest.mark.parametrize("name", LONG_RUNS)
def test_stopped_and_run_again_equals_one_clean_run(name, course, is_full, reported):
    chance = random.Random(name)
    found = course(name, chance)
    tried, wrong = (FULL if is_full else SHORT) // len(LONG_RUNS), []
    for number in range(tried):
        stops = chance.randint(1, MOST_STOPS)
        wrong += found.attack(stops, SIGNALS, WITH_WORKERS)
        try:
            found.finish(2 if chance.random() < WITH_WORKERS else 1)
        except AssertionError as exc:
            wrong.append(f"after {stops} stops, number {number}: {exc}")
        found.start_again()
    reported(f"resumed {name}", tried, len(wrong))
    assert not wrong, f"{len(wrong)} of {tried}:\n" + "\n".join(wrong[:5])
