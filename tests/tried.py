"""Print what was tried, from the lines that `reported` wrote: ``python -m tests.tried FILE``."""

import sys
from collections import defaultdict
from pathlib import Path


def main():
    rows = defaultdict(lambda: [0, 0, 0])
    for line in Path(sys.argv[1]).read_text().splitlines():
        name, *numbers = line.split("\t")
        for place, number in enumerate(numbers):
            rows[name][place] += int(number)
    rows["all together"] = [sum(column) for column in zip(*rows.values(), strict=True)]
    width = max(map(len, rows))
    print(f"{'what':{width}}{'tried':>10}{'wrong':>8}{'seconds':>10}")
    for name, (tried, wrong, seconds) in rows.items():
        print(f"{name:{width}}{tried:>10,}{wrong:>8,}{seconds:>10,}")


if __name__ == "__main__":
    main()
