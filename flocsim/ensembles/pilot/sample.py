"""Which replicates a pilot runs: spread over all conditions, and no more than the study can bear.

An index does nothing but name random numbers, so that any choice that does not look at them is a
random sample of the replicates.
"""

import math
from typing import NamedTuple

from flocsim.ensembles.config.schema import Config, StopConfig

MOST = 900
"""Replicates of a pilot."""

SHARE = 0.1
"""Of what the study costs, for the whole pilot."""

LADDER = 6.0
"""What all settings that a pilot tries on a replicate cost, over what the study spends on one: a
hundred times tighter a reference 3, the chosen setting 1, those before and beside it 2."""

LEAST = 10
"""Replicates of a type: with fewer a pilot would see nothing, and is not run."""

GOLDEN = 0.6180339887498949


class Task(NamedTuple):
    """One replicate: place of the collision type, N, share of δ_max, index."""

    condition: int
    vertices: int
    delta: float
    replicate: int


def expected_replicates(replicates: int, stop: StopConfig) -> int:
    """Replicates of each condition that a study is likely to have: with a rule that ends it early,
    those that narrow the interval of a probability of ½ to what the rule wants."""
    if stop.half_width is None:
        return replicates
    wanted = math.ceil((0.98 / stop.half_width) ** 2)
    return min(replicates, max(wanted, stop.least))


def pilot_size(config: Config) -> int:
    """Replicates of each type that a pilot of the config runs; 0: the study is too small for one.

    All types together at most MOST, and so many that the ladder costs SHARE of the study.
    """
    types = len(config.scene.names)
    cells = len(config.shapes.vertices) * len(config.scene.delta)
    replicates = expected_replicates(config.replicates, config.stop)
    found = int(min(MOST / types, SHARE * cells * replicates / LADDER))
    return found if found >= LEAST else 0


def sample_of(config: Config, size: int | None = None) -> list[list[Task]]:
    """The Tasks of a pilot, or of ``size`` replicates of each type: a list for each type.

    The first few of a list are spread over all N and δ as evenly as all of them, and no two are the
    same replicate of the same condition.
    """
    vertices, deltas = config.shapes.vertices, config.scene.delta
    cells = [(n, delta) for n in vertices for delta in deltas]
    stride = stride_through(len(cells))
    # After so many tasks a cell would meet the same indices again.
    period = math.lcm(len(cells), config.replicates)
    size = pilot_size(config) if size is None else min(size, len(cells) * config.replicates)
    return [
        [
            Task(
                condition,
                *cells[place * stride % len(cells)],
                (place + place // period) % config.replicates,
            )
            for place in range(size)
        ]
        for condition in range(len(config.scene.names))
    ]


def stride_through(count: int) -> int:
    """A step through so many places in a ring that comes to all of them, and soon everywhere."""
    wanted = max(round(GOLDEN * count), 1)
    return min(
        (step for step in range(1, count + 1) if math.gcd(step, count) == 1),
        key=lambda step: (abs(step - wanted), step),
    )
