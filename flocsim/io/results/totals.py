"""Sums over the table of replicates of a results file, which may be larger than the memory."""

import attrs
import numpy as np

from flocsim.io.results.file import opened
from flocsim.io.results.schema import OUTCOMES

BLOCK = 262_144
"""Replicates of a condition that are read together."""


@attrs.define
class Totals:
    """How many replicates had each outcome and each reason, and what steps they took."""

    outcomes: np.ndarray
    failures: np.ndarray
    count: int = 0
    steps: int = 0
    most_steps: int = 0
    rejected: int = 0

    def add(self, outcome, failure, steps, rejected):
        """Take in a block of replicates."""
        self.outcomes += np.bincount(outcome, minlength=len(self.outcomes))
        self.failures += np.bincount(failure, minlength=len(self.failures))
        self.count += outcome.size
        self.steps += int(steps.sum())
        self.most_steps = max(self.most_steps, int(steps.max(initial=0)))
        self.rejected += int(rejected.sum())


def replicate_totals(path):
    """The Totals of a results file; FileError as `flocsim.io.results.file.read_results`."""
    with opened(path) as file:
        rows = file["replicates"]
        reasons = len(rows["failure"].attrs["flag_meanings"].split())
        totals = Totals(np.zeros(len(OUTCOMES), int), np.zeros(reasons, int))
        *shape, count = rows["outcome"].shape
        for place in np.ndindex(*shape):
            for first in range(0, count, BLOCK):
                part = (*place, slice(first, first + BLOCK))
                columns = (rows[name][part] for name in ("outcome", "failure", "steps", "rejected"))
                totals.add(*columns)
        return totals
