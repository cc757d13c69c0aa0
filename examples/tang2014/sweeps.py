"""Pr[A] along one parameter around the preset: runs, intervals, and where it changes over."""

import argparse
from functools import reduce
from pathlib import Path

import attrs
import numpy as np
from claims.resampling import weights
from claims.verdicts import interval_of
from scipy.optimize import isotonic_regression

from flocsim.ensembles import load_config, run
from flocsim.ensembles.config.loader import lay_over
from flocsim.io.confidence import proportion
from flocsim.io.results.schema import CLASSES

STUDY = Path(__file__).resolve().parent / "study.toml"
TYPES = ("I", "II", "III")
MISSED = 4
GIVEN_ZONE = 5.925e-6
"""The preset's zone [m]: it decides no outcome, but parameters without a root need one to run."""


@attrs.frozen(eq=False)
class Sweep:
    """Outcomes along one parameter.

    ``values`` (k,); ``decided``, ``aggregated``, ``open``: flags (k, type, replicate), ``open`` for
    collisions that are undecided or failed.
    """

    name: str
    values: np.ndarray
    decided: np.ndarray
    aggregated: np.ndarray
    open: np.ndarray

    @property
    def bands(self):
        """Pr[A] of decided collisions with its interval: three arrays (k, type)."""
        return proportion(self.aggregated.sum(axis=-1), self.decided.sum(axis=-1))

    @property
    def open_share(self):
        """Share of the collisions that were not decided, (k, type)."""
        return self.open.sum(axis=-1) / np.maximum((self.open | self.decided).sum(axis=-1), 1)


def parse_arguments(description):
    """The command line of a script that sweeps; the output folder is there afterwards."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--library", type=Path, metavar="FILE")
    parser.add_argument("--replicates", type=int, default=200)
    parser.add_argument("-o", "--output", type=Path, default=Path("tang2014"), metavar="DIR")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    return arguments


def config_of(library, replicates, *changes):
    """The study's config with few N and one δ, under changes."""
    shapes = {"vertices": [16]}
    if library:
        shapes |= {"source": "library", "file": str(library.resolve())}
    fixed = {"shapes": shapes, "replicates": replicates, "zone": {"distance": GIVEN_ZONE},
             "stop": {"failed": 1.0}, "scene": {"types": list(TYPES), "delta": [0.5]}}  # fmt: skip
    return load_config(STUDY, reduce(lay_over, changes, fixed))


def sweep(name, values, config_at):
    """Run ``config_at(value)`` for every value; a line for each."""
    outcomes = []
    for value in values:
        outcome = run(config_at(value)).replicates["outcome"][:, 0, 0]
        outcomes.append(outcome)
        counts = [
            f"{np.sum(each % 2 == 0)}/{len(each)}" for each in (o[o < MISSED] for o in outcome)
        ]
        print(name, f"{value:.3g}", *counts, int(np.sum(outcome > MISSED)), "open", flush=True)
    outcome = np.array(outcomes)
    decided = outcome < len(CLASSES)
    return Sweep(name, np.asarray(values), decided, decided & (outcome % 2 == 0), outcome > MISSED)


def curve(shares, rising):
    """The shares (k,) made monotone, by least squares."""
    return isotonic_regression(shares, increasing=rising).x


def crossing(places, shares, level):
    """Where the monotone curve through shares (k,) first comes to a share of its range; or NaN."""
    known = np.isfinite(shares)
    places, shares = places[known], shares[known]
    if len(shares) < 2:
        return np.nan
    heights = curve(shares, rising=shares[-1] > shares[0])
    span = heights[-1] - heights[0]
    if abs(span) < 0.1:
        return np.nan
    parts = np.maximum.accumulate((heights - heights[0]) / span)
    after = int(np.argmax(parts >= level))
    if after == 0:
        return float(places[0])
    low, high = parts[after - 1], parts[after]
    return float(np.interp(level, [low, high], places[after - 1 : after + 1]))


def resampled_shares(found, kind):
    """Pr[A] (k, 1 + resamples) of one type; whole replicates are drawn anew, at all values."""
    drawn = weights(found.decided.shape[-1], 200)
    with np.errstate(invalid="ignore", divide="ignore"):
        return (found.aggregated[:, kind] @ drawn) / (found.decided[:, kind] @ drawn)


def transition(found, kind, level, logarithmic=True):
    """(value, low, high) where Pr[A] of one type has made a share of its way from end to end."""
    places = np.log(found.values) if logarithmic else found.values
    samples = np.array([crossing(places, s, level) for s in resampled_shares(found, kind).T])
    at = interval_of(np.exp(samples) if logarithmic else samples)
    return at if np.isfinite(samples[0]) else (np.nan,) * 3
