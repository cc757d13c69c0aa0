"""Two spheres that meet in water, without inertia: how many of those that could meet touch.

A way is that of sphere 2 against sphere 1: ln gap and the direction n of the line of centres. Many
are followed at once, each by steps of its own (Runge and Kutta's of order 4), which are a share of
the time in which its gap or its direction would change by all of itself. Which offset still leads
to touching is narrowed down from outside in.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.errors import UsageError
from flocsim.hydrodynamics.pair import Relative, SpherePair

STEP = 0.1
"""Of a way, as that share: a fifth of it changes efficiencies by less than 2e-3 of themselves."""

SMOOTH = 0.3 * STEP
"""What the rates of a step may change ln gap or n by; else it is taken anew, a quarter as long."""

MOST_STEPS = 4000
"""Behind them, some ten times as many as a way past takes, a pair stays at a distance."""

NODES_A_DECADE = 25
"""Of the gap, in tables between which cubic splines run."""

SETTLING_FAR, FLOW_FAR, LAST = 100.0, 40.0, 1000.0
"""Distances over r₁ + r₂ from which ways are followed in settling and in a flow, and up to which
what water does in settling beforehand is added up; from there on it falls with the distance."""

WIDEST, NARROWEST, TRIED = 4.0, 1e-4, 60
"""The largest offset over r₁ + r₂ that is looked at, the least over it, and how many."""

OFFSETS, ROUNDS = 20, 2
"""How many are tried at once between one that touches and the next that does not; how often."""

AZIMUTHS = 12
"""Directions of offsets in a flow, Gauss's over a quarter turn."""

FLOWS = {
    "shear": np.array([[0.0, 0.5, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.0]]),
    "extension": np.diag([1.0, -1.0, 0.0]),
}
"""The strain of each at the rate 1/s; shear turns by half its rate, clockwise."""

Force = Callable[[np.ndarray], np.ndarray]
"""Repulsion [N] of two spheres at gaps (k,) [m]."""

Rates = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""From the columns of a table (columns, k) and n (k, 3) to the rates of ln gap and n; linear in the
columns."""


@attrs.frozen
class Meeting:
    """Two spheres of a ``pair`` and the ``force`` between them.

    They touch at the gap ``touch`` [m], where attraction has taken over. ``water``: whether one
    moves the water around the other. ``passed`` [m]: where water passes through what is outermost,
    by how much the sum of the radii is larger than that of the ``pair``, which are those of solid
    spheres with the same drag; gaps are those of what is outermost.
    """

    pair: SpherePair
    force: Force
    touch: float
    water: bool = True
    passed: float = 0.0

    def __attrs_post_init__(self) -> None:
        if not 0.0 < self.touch < 0.1 * self.reach:
            raise UsageError(
                "two spheres touch at a gap above 0 m and below a tenth of the sum of their radii, "
                f"{self.reach:g} m, found {self.touch:g} m"
            )

    @property
    def reach(self) -> float:
        """r₁ + r₂ [m]."""
        return sum(self.pair.radii) + self.passed

    def motion(self, gap: np.ndarray) -> Relative:
        """How they move against each other."""
        gap = gap + self.passed
        return self.pair.relative(gap) if self.water else self.pair.alone(gap)

    def spline(self, columns: Callable[[np.ndarray, Relative], list[np.ndarray]]) -> Any:
        """Columns of (gap, motion), and that of d ln gap/dt by the force, by ln gap."""
        from scipy.interpolate import CubicSpline

        nearest, farthest = 0.5 * self.touch, 1.1 * LAST * self.reach
        count = math.ceil(NODES_A_DECADE * math.log10(farthest / nearest))
        gaps = np.geomspace(nearest, farthest, count)
        motion, force = self.motion(gaps), np.broadcast_to(self.force(gaps), gaps.shape)
        if not np.isfinite(force).all():
            where = gaps[np.argmin(np.isfinite(force))]
            raise UsageError(
                f"the force between two spheres gives no number at a gap of {where:.3g} m: bound "
                "what it divides by, or takes a root, power or logarithm of"
            )
        # Mobility against each other: a pull on one is a push on the other.
        driven = (motion.along[:, 1] - motion.along[:, 0]) * force / gaps
        table = CubicSpline(np.log(gaps), np.column_stack([*columns(gaps, motion), driven]))
        # A step that overshoots the touch ends the way whatever it is told.
        return lambda log: table(np.clip(log, table.x[0], table.x[-1])).T

    def touches(
        self, table: Any, rates: Rates, distance: float, directions: np.ndarray
    ) -> np.ndarray:
        """Whether the ways from a distance [m] in ``directions`` (k, 3) end in touching (k,)."""
        log, n = np.full(len(directions), math.log(distance - self.reach)), directions
        end, away = math.log(self.touch), math.log(1.05 * distance)
        found, left = np.zeros(len(directions), bool), np.arange(len(directions))
        share = np.ones(len(directions))
        for _ in range(MOST_STEPS):
            first = rates(table(log), n)
            pace = np.abs(first[0]) + np.linalg.norm(first[1], axis=1)
            h = STEP * share / np.maximum(pace, np.finfo(float).tiny)
            second = rates(table(log + 0.5 * h * first[0]), n + 0.5 * h[:, None] * first[1])
            third = rates(table(log + 0.5 * h * second[0]), n + 0.5 * h[:, None] * second[1])
            fourth = rates(table(log + h * third[0]), n + h[:, None] * third[1])
            of_log, of_n = (
                a + 2.0 * b + 2.0 * c + d
                for a, b, c, d in zip(first, second, third, fourth, strict=True)
            )
            # Where it all but stands still, against a repulsion say, its rates may change at once.
            strays = np.abs(h * (third[0] - first[0])) > SMOOTH
            strays |= h * np.linalg.norm(third[1] - first[1], axis=1) > SMOOTH
            share = np.where(strays, 0.25 * share, np.minimum(2.0 * share, 1.0))
            log = np.where(strays, log, log + h / 6.0 * of_log)
            n = np.where(strays[:, None], n, n + h[:, None] / 6.0 * of_n)
            n = n / np.linalg.norm(n, axis=1)[:, None]
            found[left[log < end]] = True
            going = (log >= end) & (log <= away)
            if not going.any():
                break
            log, n, left, share = log[going], n[going], left[going], share[going]
        return found

    def between(
        self, hits: Callable[[np.ndarray], np.ndarray], count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """The least and the largest offset (count,) over r₁ + r₂ of ways that touch, 0 where none
        does; ``hits``: from offsets (count, m) [m] to whether they do.

        In shear those nearest to the middle come round before they meet.
        """
        tried = np.append(0.0, WIDEST * np.geomspace(NARROWEST, 1.0, TRIED))
        found = hits(np.tile(self.reach * tried[1:], (count, 1)))
        first, last = np.argmax(found, axis=1), TRIED - np.argmax(found[:, ::-1], axis=1)
        any_, all_in = found.any(axis=1), first == 0
        # Where each of the two lies between a way that touches and the next that does not.
        low = self.edge(hits, tried[first + 1], tried[first])
        high = self.edge(hits, tried[last], tried[np.minimum(last + 1, TRIED)])
        return np.where(any_ & ~all_in, low, 0.0), np.where(any_, high, 0.0)

    def edge(self, hits: Any, touching: np.ndarray, passing: np.ndarray) -> np.ndarray:
        """Where between offsets that touch and such as do not (count,) ways cease to."""
        shares = np.arange(1, OFFSETS + 1) / (OFFSETS + 1)
        for _ in range(ROUNDS):
            wide = passing - touching
            found = hits(self.reach * (touching[:, None] + wide[:, None] * shares))
            inside = np.where(found.all(axis=1), OFFSETS, np.argmin(found, axis=1))
            passing = touching + wide * (inside + 1) / (OFFSETS + 1)
            touching = touching + wide * inside / (OFFSETS + 1)
        return 0.5 * (touching + passing)

    def settling(self, weights: tuple[float, float]) -> float:
        """The share of π (r₁ + r₂)² from which settling spheres come to touch, (b_c/(r₁ + r₂))².

        ``weights``: buoyant ones of both [N]. UsageError where they settle alike.
        """
        loads = np.array(weights)
        alone = loads / np.array(self.pair.radii)
        if alone[0] == alone[1]:
            raise UsageError("two spheres that settle at the same speed never meet")
        if alone[1] < alone[0]:
            # What comes to 2 comes to 1 as well, seen from there.
            other = SpherePair(self.pair.radii[::-1], self.pair.viscosity)
            return attrs.evolve(self, pair=other).settling(weights[::-1])
        table = self.spline(
            lambda gap, motion: [
                motion.along @ loads / gap,
                motion.across @ loads / (gap + self.reach),
            ]
        )
        down = np.array([1.0, 0.0, 0.0])

        def rates(columns, n):
            radial, sideways, driven = columns
            fall = n[:, 0]
            return radial * fall + driven, sideways[:, None] * (down - fall[:, None] * n)

        start = SETTLING_FAR * self.reach

        def hits(offsets):
            sine = offsets[0] / start
            directions = np.column_stack([-np.sqrt(1.0 - sine**2), sine, 0.0 * sine])
            return self.touches(table, rates, start, directions)[None]

        before = bend(self.pair, alone, start) if self.water else 0.0
        low, high = self.between(hits, 1)
        return float((high[0] ** 2 - low[0] ** 2) * math.exp(2.0 * before))

    def in_flow(self, flow: str, rate: float) -> float:
        """The share of the rectilinear kernel, 4/3 G (r₁ + r₂)³ or 8/3 s (r₁ + r₂)³, of spheres
        that come to touch in a flow.

        ``flow``: "shear", u = (G y, 0, 0), or "extension", u = (s x, −s y, 0); ``rate``: G or s
        [1/s]. UsageError for others.
        """
        nodes, weights = np.polynomial.legendre.leggauss(AZIMUTHS)
        angle, weight = 0.25 * math.pi * (nodes + 1.0), 0.25 * math.pi * weights
        low, high = self.widths(flow, rate, angle)
        if flow == "shear":
            # 4 ∫∫ G |y| dy dz over 4/3 G.
            return float(np.sum(weight * np.cos(angle) * (high**3 - low**3)))
        # Of x y and z 2 · 4 ∫∫ s d(x y) dz over 8/3 s; d(x y) = ½ (r₁ + r₂) d(first).
        return float(np.sum(weight * 0.75 * (high**2 - low**2)))

    def widths(self, flow: str, rate: float, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The least and the largest offset over r₁ + r₂ (k,) of those that come to touch in a flow,
        of offsets that lie at an ``angle`` (k,) from the plane of shear, or of extension."""
        if flow not in FLOWS or not rate > 0.0:
            raise UsageError(
                f"flow must be one of {', '.join(FLOWS)}, at a rate above 0, found {flow!r} at "
                f"{rate!r}"
            )
        is_shear = flow == "shear"
        strain, spin = rate * FLOWS[flow], -0.5 * rate * is_shear
        table = self.spline(
            lambda gap, motion: [
                (1.0 - motion.stretch) * (gap + self.reach) / gap, 1.0 - motion.shear,
            ]
        )  # fmt: skip

        def rates(columns, n):
            radial, sideways, driven = columns
            stretched = n @ strain
            along = np.sum(stretched * n, axis=1)
            turned = np.column_stack([-spin * n[:, 1], spin * n[:, 0], np.zeros(len(n))])
            across = sideways[:, None] * (stretched - along[:, None] * n)
            return radial * along + driven, turned + across

        start = FLOW_FAR * self.reach

        def hits(offsets):
            first, second = offsets * np.cos(angle)[:, None], offsets * np.sin(angle)[:, None]
            if is_shear:
                rest = np.sqrt(start**2 - first**2 - second**2)
                places = np.stack([-rest, first, second], axis=-1)
            else:
                # x y = first (r₁ + r₂)/2, as far as the ways of that least distance.
                rest = np.sqrt(start**2 - second**2)
                across = 0.5 * first * self.reach / rest
                places = np.stack([across, np.sqrt(rest**2 - across**2), second], axis=-1)
            directions = places.reshape(-1, 3)
            directions = directions / np.linalg.norm(directions, axis=1)[:, None]
            return self.touches(table, rates, start, directions).reshape(offsets.shape)

        return self.between(hits, len(angle))


def bend(pair: SpherePair, speeds: Sequence[float] | np.ndarray, distance: float) -> float:
    """By how much the logarithm of the offset of two settling spheres falls from far away until
    they are a ``distance`` [m] apart, where that is small; ``speeds``: of both alone."""
    reach = sum(pair.radii)
    log = np.linspace(math.log(distance - reach), math.log(max(LAST * reach, 4.0 * distance)), 400)
    gap = np.exp(log)
    motion = pair.relative(gap)
    loads = np.array(speeds) * pair.radii
    # ln(r sin φ) changes by (1 − sideways/radial)/r dr; from the last on it falls with 1/r.
    change = gap / (gap + reach) * (1.0 - (motion.across @ loads) / (motion.along @ loads))
    return float(np.trapezoid(change, log) + change[-1])
