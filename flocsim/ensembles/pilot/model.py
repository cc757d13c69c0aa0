"""How many outcomes flip at a tolerance, from the few that were seen to.

An error of size e flips what comes within about e of another outcome, and motion amplifies errors
by factors that scatter over many decades. So the rate of flips falls with a small power of the
tolerance, and levels off where the tolerance comes near the scene's length, as steps are then kept
short by other things: at rung s (tolerance over that length) it is q g(s), with
g(s) = sᵝ (1 + b)/(sᵝ + b), b = LEVEL to the power β, so that g(1) = 1. β is one for all types of a
study, q belongs to a type; a reference at s₀ is off by itself, and adds q g(s₀).

Flips seen are Poisson distributed around n q (g(s) + g(s₀)). Before anything is seen q has a gamma
distribution of mean FLIPS and shape SHAPE, β a normal one, of those that the scenes of
benchmarks/accuracy/auto.py have. What is then known of a rate is a mixture of gamma distributions
over β. Few flips thus leave a wide distribution, and none at
all the width of what was there before and of how many were run.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flocsim.ensembles.collision.checking import Z

FLIPS = 0.025
"""Share of outcomes that flip where the tolerance is the scene's length, before any is seen."""

SHAPE = 1.0
"""Of the gamma distribution of q before any is seen: as wide as its mean."""

LEVEL = 0.1
"""Rung at which the rate of flips begins to level off."""

EXPONENTS = np.linspace(0.25, 0.85, 25)
EXPONENT, EXPONENT_SPREAD = 0.5, 0.1
"""The exponents that are weighed, and their normal distribution before any flip is seen."""


def falls(rung: float) -> np.ndarray:
    """g of a rung for each of EXPONENTS: the rate of flips over that at rung 1."""
    power, level = rung**EXPONENTS, LEVEL**EXPONENTS
    return power * (1.0 + level) / (power + level)


class Seen(NamedTuple):
    """How many of so many runs at a rung flip, held against a reference at another."""

    rung: float
    reference: float
    runs: int
    flips: int


class Belief(NamedTuple):
    """What is known of the q of one type: gamma distributions of ``shape`` and ``rates`` (k,), of
    the ``weights`` (k,) that EXPONENTS have."""

    shape: float
    rates: np.ndarray
    weights: np.ndarray

    def expected(self, rung: float) -> float:
        """Mean rate of flips at a rung."""
        return float(np.sum(self.weights * self.shape / self.rates * falls(rung)))

    def bound(self, rung: float, confidence: float) -> float:
        """What the rate of flips at a rung stays below with that probability."""
        from scipy.optimize import brentq
        from scipy.special import gammainc

        scaled, high = self.rates / falls(rung), 1.0

        def beyond(rate):
            return float(np.sum(self.weights * gammainc(self.shape, scaled * rate))) - confidence

        while beyond(high) < 0.0:
            high *= 2.0
        return float(brentq(beyond, 0.0, high, xtol=1e-15))


def beliefs(seen: Sequence[Sequence[Seen]]) -> list[Belief]:
    """What is known of every type after these have been Seen of it."""
    logs = -0.5 * ((EXPONENTS - EXPONENT) / EXPONENT_SPREAD) ** 2
    shapes, rates = [], []
    for each in seen:
        shape, rate = SHAPE, np.full(len(EXPONENTS), SHAPE / FLIPS)
        for rung, reference, runs, flips in each:
            power = falls(rung) + falls(reference)
            shape, rate = shape + flips, rate + runs * power
            logs = logs + flips * np.log(power)
        logs = logs - shape * np.log(rate)
        shapes.append(shape)
        rates.append(rate)
    weights = np.exp(logs - np.max(logs))
    weights /= np.sum(weights)
    return [Belief(*each, weights) for each in zip(shapes, rates, strict=True)]


def sampling_half_width(count: int) -> float:
    """Half of Wilson's 95 % interval of a probability of ½ seen in so many replicates."""
    return 0.5 * Z / math.sqrt(count + Z * Z)
