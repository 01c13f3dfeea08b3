"""Damaged files of every kind: at worst one line, soon, in little memory; never a wrong answer."""

import pytest

from tests.fuzz.forging import files_of
from tests.fuzz.limited import Attack
from tests.fuzz.targets import TARGETS

PARTS = {"idx": 4, "flips": 8}  # so many that several processes share them
CASES = [(name, part) for name in TARGETS for part in range(PARTS.get(name, 1))]


@pytest.mark.parametrize(("name", "part"), CASES)
def test_a_damaged_file_gives_one_line_or_what_it_holds(
    name, part, attacker, count, reported, tmp_path
):
    target, parts = TARGETS[name], PARTS.get(name, 1)
    bits = 8 * sum(path.stat().st_size for path in files_of(attacker.seeds / "take.store"))
    wanted = count(target.short, target.full or bits)
    first, end = (wanted * number // parts for number in (part, part + 1))
    wrong = attacker.attack(name, end - first, first)
    reported(name, end - first, len(wrong))
    for number, what in wrong.items():
        _, place = Attack(target, attacker.seeds, tmp_path / name).make(number)
        pytest.fail(
            f"{len(wrong)} of {end - first}, the first is number {number}, {place}:\n{what}"
        )
