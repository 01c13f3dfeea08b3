"""Give jobs to a process with limits, start another one where it ends, and gather what it finds."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


class Attacker:
    """A process that reads damaged files, and its successors."""

    def __init__(self, seeds, work):
        self.seeds, self.work = seeds, work
        self.process = None

    def start(self):
        with (self.work / "stderr").open("wb") as stderr:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "tests.fuzz.limited", self.seeds, self.work],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=stderr,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
                cwd=ROOT,
                text=True,
            )

    def attack(self, name, count, first=0):
        """Have so many mutants read; give what was wrong, by the number of the mutant."""
        wrong, end, number = {}, first + count, first
        while number < end:
            if self.process is None:
                self.start()
            self.process.stdin.write(json.dumps([name, number, end - number]) + "\n")
            self.process.stdin.flush()
            number = first - 1
            for line in self.process.stdout:
                said = json.loads(line)
                if said == "done":
                    return wrong
                if isinstance(said, int):
                    number = said
                else:
                    wrong[number] = said
            code = self.process.wait()
            self.process.stdin.close()
            self.process.stdout.close()
            stderr = (self.work / "stderr").read_text(errors="replace")[-2000:]
            self.process = None
            wrong[number] = f"ended the process ({code}): {stderr}"
            if number < first:
                return wrong
            number += 1
        return wrong

    def close(self):
        if self.process is not None:
            self.process.stdin.close()
            self.process.wait()
            self.process.stdout.close()
