"""How faults of one kind have ended."""

import sys

import attrs

REPORTED = 25
"""Faults of a kind after which a line says how they went: the whole takes hours."""


@attrs.define
class Tally:
    """How faults of one kind have ended."""

    faults: int = 0
    right: int = 0
    hangs: int = 0
    slowest: float = 0.0
    wrong: list = attrs.Factory(list)

    def add(self, problem, seconds, hang=False):
        """Count a fault; ``problem`` is "" where nothing was lost."""
        self.faults += 1
        self.right += not problem
        self.hangs += hang
        self.slowest = max(self.slowest, seconds)
        if problem:
            self.wrong.append(problem)
            print(problem, file=sys.stderr, flush=True)
        if self.faults % REPORTED == 0:
            counted = f"{self.faults} of a kind, {len(self.wrong)} wrong, {self.hangs} hangs"
            print(f"{counted}, slowest {self.slowest:.1f} s", file=sys.stderr, flush=True)
