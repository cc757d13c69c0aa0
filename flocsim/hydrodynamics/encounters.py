"""Collision efficiency of two spheres in water, without inertia: the fraction of encounters that
touch.

Trajectories are those of sphere 2 relative to sphere 1, in ln gap and in the unit vector n of the
line of centres. Many are integrated at once by the classical Runge–Kutta method of order 4. Each
has its own step, a share of the time in which its gap or its direction would change by its own
size. The largest initial offset that still leads to contact is found by scanning offsets from
outside in, and by repeated subdivision.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.errors import UsageError
from flocsim.hydrodynamics.pair import Relative, SpherePair

STEP = 0.1
"""Step as a share of that time; a fifth of it changes efficiencies by less than 2e-3."""

SMOOTHNESS = 0.3 * STEP
"""Largest change of ln gap or n by which the rates may differ within a step; else it is repeated
with a quarter of its size."""

MOST_STEPS = 4000
"""Steps after which a pair counts as staying at a distance: some ten times as many as a passing
trajectory takes."""

NODES_A_DECADE = 25
"""Table nodes per decade of the gap, interpolated by cubic splines."""

SETTLING_FAR, FLOW_FAR, BENDING_END = 100.0, 40.0, 1000.0
"""Initial distances over r₁ + r₂, in settling and in a flow, and the distance up to which the
bending of trajectories before that is integrated; beyond that it decays as 1/distance."""

WIDEST, NARROWEST, OFFSETS_TRIED = 4.0, 1e-4, 60
"""Largest offset over r₁ + r₂ that is tried, the smallest over the largest, and their number."""

SUBDIVISIONS, ROUNDS = 20, 2
"""SUBDIVISIONS: offsets tried between one that touches and the next one that does not; ROUNDS:
repetitions."""

AZIMUTHS = 12
"""Nodes of Gauss's rule over the azimuth of an offset in a flow, over a quarter turn."""

FLOWS = {
    "shear": np.array([[0.0, 0.5, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.0]]),
    "extension": np.diag([1.0, -1.0, 0.0]),
}
"""Rate-of-strain tensor of each flow at the rate 1/s; shear also rotates, clockwise at half its
rate."""

Force = Callable[[np.ndarray], np.ndarray]
"""Type of a repulsion [N] of two spheres at gaps (k,) [m]."""

Rates = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Type of a function from table columns (columns, k) and n (k, 3) to the rates of ln gap and n,
linear in the columns."""


@attrs.frozen
class Meeting:
    """Encounter of two spheres with a force between them.

    Parameters
    ----------
    pair : SpherePair
        The two spheres and the viscosity.
    force : callable
        Repulsion [N] at gaps (k,) [m].
    touch : float
        Gap [m] at which attraction has taken over, and the spheres count as touching.
    water : bool
        Whether each sphere moves the water around the other.
    passed : float
        Sum of the outermost radii minus that of the ``pair`` [m], for permeable spheres; gaps refer
        to the outermost radii, the radii of ``pair`` are those of solid spheres with the same drag.

    Raises
    ------
    UsageError
        If ``touch`` is not between 0 and a tenth of the sum of the radii.
    """

    pair: SpherePair
    force: Force
    touch: float
    water: bool = True
    passed: float = 0.0

    def __attrs_post_init__(self) -> None:
        if not 0.0 < self.touch < 0.1 * self.reach:
            raise UsageError(
                "the gap at which two spheres touch must be above 0 m and below a tenth of the sum "
                f"of their radii, {self.reach:g} m, found {self.touch:g} m"
            )

    @property
    def reach(self) -> float:
        """r₁ + r₂ [m]."""
        return sum(self.pair.radii) + self.passed

    def motion(self, gap: np.ndarray) -> Relative:
        """Return the relative mobility functions at a gap [m]."""
        gap = gap + self.passed
        return self.pair.relative(gap) if self.water else self.pair.alone(gap)

    def spline(self, columns: Callable[[np.ndarray, Relative], list[np.ndarray]]) -> Any:
        """Return an interpolant, over ln gap, of ``columns`` and of d ln gap/dt due to the
        force."""
        from scipy.interpolate import CubicSpline

        nearest, farthest = 0.5 * self.touch, 1.1 * BENDING_END * self.reach
        count = math.ceil(NODES_A_DECADE * math.log10(farthest / nearest))
        gaps = np.geomspace(nearest, farthest, count)
        motion, force = self.motion(gaps), np.broadcast_to(self.force(gaps), gaps.shape)
        if not np.isfinite(force).all():
            where = gaps[np.argmin(np.isfinite(force))]
            raise UsageError(
                f"the force between two spheres is not finite at a gap of {where:.3g} m: bound "
                "any divisor, and the argument of any root, power or logarithm"
            )
        # Relative mobility: the force acts on both spheres in opposite directions.
        driven = (motion.along[:, 1] - motion.along[:, 0]) * force / gaps
        table = CubicSpline(np.log(gaps), np.column_stack([*columns(gaps, motion), driven]))
        # Beyond contact the value does not matter, as the trajectory ends there.
        return lambda log: table(np.clip(log, table.x[0], table.x[-1])).T

    def touches(
        self, table: Any, rates: Rates, distance: float, directions: np.ndarray
    ) -> np.ndarray:
        """Return whether trajectories from a distance [m] in ``directions`` (k, 3) end in contact
        (k,)."""
        log, n = np.full(len(directions), math.log(distance - self.reach)), directions
        end, away = math.log(self.touch), math.log(1.05 * distance)
        touched, remaining = np.zeros(len(directions), bool), np.arange(len(directions))
        share = np.ones(len(directions))
        for _ in range(MOST_STEPS):
            first = rates(table(log), n)
            # Step size from the rates at its start.
            rate = np.abs(first[0]) + np.linalg.norm(first[1], axis=1)
            h = STEP * share / np.maximum(rate, np.finfo(float).tiny)
            # Classical Runge–Kutta stages.
            second = rates(table(log + 0.5 * h * first[0]), n + 0.5 * h[:, None] * first[1])
            third = rates(table(log + 0.5 * h * second[0]), n + 0.5 * h[:, None] * second[1])
            fourth = rates(table(log + h * third[0]), n + h[:, None] * third[1])
            of_log, of_n = (
                a + 2.0 * b + 2.0 * c + d
                for a, b, c, d in zip(first, second, third, fourth, strict=True)
            )
            # Near a standstill, e.g. against a repulsion, rates change abruptly: compare stages and
            # repeat the step with a quarter of its size.
            rejected = np.abs(h * (third[0] - first[0])) > SMOOTHNESS
            rejected |= h * np.linalg.norm(third[1] - first[1], axis=1) > SMOOTHNESS
            share = np.where(rejected, 0.25 * share, np.minimum(2.0 * share, 1.0))
            log = np.where(rejected, log, log + h / 6.0 * of_log)
            n = np.where(rejected[:, None], n, n + h[:, None] / 6.0 * of_n)
            n = n / np.linalg.norm(n, axis=1)[:, None]
            # Finished trajectories, in contact or far away, leave the arrays.
            touched[remaining[log < end]] = True
            going = (log >= end) & (log <= away)
            if not going.any():
                break
            log, n, remaining, share = log[going], n[going], remaining[going], share[going]
        return touched

    def between(
        self, hits: Callable[[np.ndarray], np.ndarray], count: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the smallest and the largest offset (count,) over r₁ + r₂ that lead to contact.

        0 if none does. ``hits`` maps offsets (count, m) [m] to whether they do. In shear the
        trajectories nearest to the middle turn back before they meet, hence the smallest offset.
        """
        tried = np.append(0.0, WIDEST * np.geomspace(NARROWEST, 1.0, OFFSETS_TRIED))
        found = hits(np.tile(self.reach * tried[1:], (count, 1)))
        first, last = np.argmax(found, axis=1), OFFSETS_TRIED - np.argmax(found[:, ::-1], axis=1)
        any_touches, centre_touches = found.any(axis=1), first == 0
        # Refine both limits between a touching offset and the next one that is not.
        low = self.edge(hits, tried[first + 1], tried[first])
        high = self.edge(hits, tried[last], tried[np.minimum(last + 1, OFFSETS_TRIED)])
        return np.where(any_touches & ~centre_touches, low, 0.0), np.where(any_touches, high, 0.0)

    def edge(self, hits: Any, touching: np.ndarray, passing: np.ndarray) -> np.ndarray:
        """Return the limit (count,) between offsets that touch and offsets that do not."""
        shares = np.arange(1, SUBDIVISIONS + 1) / (SUBDIVISIONS + 1)
        for _ in range(ROUNDS):
            wide = passing - touching
            found = hits(self.reach * (touching[:, None] + wide[:, None] * shares))
            inside = np.where(found.all(axis=1), SUBDIVISIONS, np.argmin(found, axis=1))
            passing = touching + wide * (inside + 1) / (SUBDIVISIONS + 1)
            touching = touching + wide * inside / (SUBDIVISIONS + 1)
        return 0.5 * (touching + passing)

    def settling(self, weights: tuple[float, float]) -> float:
        """Return the collision efficiency of two settling spheres.

        Parameters
        ----------
        weights : (float, float)
            Buoyant weights of both spheres [N].

        Returns
        -------
        float
            (b_c/(r₁ + r₂))², the fraction of the cross section π (r₁ + r₂)² from which they come
            into contact.

        Raises
        ------
        UsageError
            If both settle at the same speed.
        """
        loads = np.array(weights)
        alone = loads / np.array(self.pair.radii)
        if alone[0] == alone[1]:
            raise UsageError("two spheres that settle at the same speed never meet")
        if alone[1] < alone[0]:
            # Sphere 2 must be the faster one: exchange the two.
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
        """Return the collision efficiency of two spheres in a flow.

        Parameters
        ----------
        flow : "shear" or "extension"
            u = (G y, 0, 0), or u = (s x, −s y, 0).
        rate : float
            G or s [1/s].

        Returns
        -------
        float
            Fraction of the rectilinear kernel, 4/3 G (r₁ + r₂)³ in shear, 8/3 s (r₁ + r₂)³ in
            extension.

        Raises
        ------
        UsageError
            If the flow is unknown, or the rate is not above 0.
        """
        nodes, weights = np.polynomial.legendre.leggauss(AZIMUTHS)
        angle, weight = 0.25 * math.pi * (nodes + 1.0), 0.25 * math.pi * weights
        low, high = self.widths(flow, rate, angle)
        if flow == "shear":
            # Flux through the touching area, 4 ∫∫ G |y| dy dz, over 4/3 G (r₁ + r₂)³.
            return float(np.sum(weight * np.cos(angle) * (high**3 - low**3)))
        # Streamlines are labelled by x y and z: flux 8 ∫∫ s d(x y) dz over 8/3 s (r₁ + r₂)³, with
        # d(x y) = ½ (r₁ + r₂) d(first).
        return float(np.sum(weight * 0.75 * (high**2 - low**2)))

    def widths(self, flow: str, rate: float, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the smallest and largest offsets that lead to contact in a flow.

        Parameters
        ----------
        flow, rate
            As for `in_flow`.
        angle : (k,) float array
            Angle of the offset from the plane of shear or extension [rad].

        Returns
        -------
        low, high : (k,) float arrays
            Offsets over r₁ + r₂.

        Raises
        ------
        UsageError
            If the flow is unknown, or the rate is not above 0.
        """
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
            # Relative velocity (Batchelor and Green 1972): the strain along n and across it, each
            # reduced by its mobility function, plus the rotation of the flow.
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
                # Start on the streamline x y = first (r₁ + r₂)/2, at the distance of the start.
                rest = np.sqrt(start**2 - second**2)
                across = 0.5 * first * self.reach / rest
                places = np.stack([across, np.sqrt(rest**2 - across**2), second], axis=-1)
            directions = places.reshape(-1, 3)
            directions = directions / np.linalg.norm(directions, axis=1)[:, None]
            return self.touches(table, rates, start, directions).reshape(offsets.shape)

        return self.between(hits, len(angle))


def bend(pair: SpherePair, speeds: Sequence[float] | np.ndarray, distance: float) -> float:
    """Return the decrease of ln(offset) of two settling spheres from far away to a distance.

    Parameters
    ----------
    pair : SpherePair
    speeds : (float, float)
        Settling speeds of each sphere alone [m/s].
    distance : float
        Final distance of the centres [m], large enough for the decrease to be small.

    Returns
    -------
    float
    """
    reach = sum(pair.radii)
    log = np.linspace(
        math.log(distance - reach), math.log(max(BENDING_END * reach, 4.0 * distance)), 400
    )
    gap = np.exp(log)
    motion = pair.relative(gap)
    loads = np.array(speeds) * pair.radii
    # ln(r sin φ) changes by (1 − sideways/radial) dr/r. Beyond the last distance the integrand
    # decays as 1/r, which adds its last value.
    change = gap / (gap + reach) * (1.0 - (motion.across @ loads) / (motion.along @ loads))
    return float(np.trapezoid(change, log) + change[-1])


def bend_in_flow(pair: SpherePair, distance: float) -> tuple[float, float]:
    """Return (ln φ, ψ [m²]) of two spheres in a flow, which say how far the water between them has
    displaced a path from that of the undisturbed flow.

    Parameters
    ----------
    pair : SpherePair
    distance : float
        Distance r of the centres [m].

    Returns
    -------
    (float, float)
        In shear y² = φ² (y∞² + ψ), y across the flow; in extension x y = φ² (x y)∞.

    Notes
    -----
    ln φ = ∫ (A − B)/(1 − A) dr/r and ψ = ∫ B r/((1 − A) φ²) dr, from r to infinity: Batchelor and
    Green (1972), J. Fluid Mech. 56, 375, section 5.
    """
    reach = sum(pair.radii)
    log = np.linspace(
        math.log(distance - reach), math.log(max(BENDING_END * reach, 4.0 * distance)), 400
    )
    gap = np.exp(log)
    motion, r = pair.relative(gap), gap + reach
    step, left = np.diff(log), 1.0 - motion.stretch
    # Both decay as fast as 1/r³: beyond the last distance there is nothing to add.
    rate = (motion.stretch - motion.shear) / left * gap / r
    pieces = 0.5 * step * (rate[1:] + rate[:-1])
    logs = np.append(np.cumsum(pieces[::-1])[::-1], 0.0)
    turned = motion.shear / left * r * np.exp(-2.0 * logs) * gap
    return float(logs[0]), float(np.trapezoid(turned, log))
