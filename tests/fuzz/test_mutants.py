"""Damaged files of every kind: at worst one line, soon, in little memory; never a wrong answer."""

import pytest

from tests.fuzz.forging import files_of
from tests.fuzz.limited import Attack
from tests.fuzz.targets import TARGETS


@pytest.mark.parametrize("name", TARGETS)
def test_a_damaged_file_gives_one_line_or_what_it_holds(name, attacker, count, reported, tmp_path):
    target = TARGETS[name]
    bits = 8 * sum(path.stat().st_size for path in files_of(attacker.seeds / "take.store"))
    tried = count(target.short, target.full or bits)
    wrong = attacker.attack(name, tried)
    reported(name, tried, len(wrong))
    for number, what in wrong.items():
        _, place = Attack(target, attacker.seeds, tmp_path / name).make(number)
        pytest.fail(f"{len(wrong)} of {tried}, the first is number {number}, {place}:\n{what}")
