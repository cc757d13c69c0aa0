"""Claim 26: several collisions are a sequence of binary ones, of the first touches in swarms."""

import csv

from flocsim.io.confidence import proportion

from .verdicts import FAILS, HOLDS, UNDECIDED, MissingData, Part

RARELY, MOSTLY = 0.1, 0.9
"""Up to which share a third floc may touch during a collision for durations to count as much
smaller than the time between collisions; from which on outcomes count as those of pairs alone."""


def read_touches(path):
    """Rows {column: number} of what several.py wrote, none without."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]


def share(what, count, trials, least, most):
    """Whether a probability lies between two levels."""
    value, low, high = (float(each) for each in proportion(count, trials))
    verdict = HOLDS if least <= low and high <= most else UNDECIDED
    if high < least or low > most:
        verdict = FAILS
    return Part(what, value, low, high, verdict, f"{count} of {trials}")


def sequence(rows):
    """(26) A third floc rarely touches during a collision; where one does, the two come to what
    they come to alone. Collisions without a third one show what the comparison itself is worth."""
    for fraction in sorted({row["area fraction"] for row in rows}):
        mine = [row for row in rows if row["area fraction"] == fraction]
        thirds = sum(row["third"] > 0.0 for row in mine)
        yield share(f"a third floc touches meanwhile, area fraction {fraction:g}", thirds,
                    len(mine), 0.0, RARELY)  # fmt: skip
    for third, what in ((0.0, "no third floc"), (1.0, "a third floc")):
        mine = [row for row in rows if row["third"] == third]
        alike = sum(row["together"] == row["alone"] for row in mine)
        if not mine:
            raise MissingData(f"there is no collision with {what}")
        yield share(f"ends as the pair alone does, collisions with {what}", alike, len(mine),
                    MOSTLY, 1.0)  # fmt: skip
