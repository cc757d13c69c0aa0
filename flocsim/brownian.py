"""Two bodies that meet by thermal motion: how likely they touch before they have escaped.

Of two spheres, as integrals over their interaction: the probability P(r) to come to the centre
distance R = r_i + r_j before the distance b solves P'' + ((d − 1)/r − V'/k_B T) P' = 0 in d
dimensions, so that

    P(r) = ∫_r^b e^(V/k_B T) s^(1−d) ds / ∫_R^b e^(V/k_B T) s^(1−d) ds.

With the water between the spheres, both integrands have D_∞/D(s), too, D being their relative
diffusion.

Of any two, by letting them go near each other and running them until they touch or have escaped,
again and again.

Source: Gardiner (2009), Stochastic Methods, section 5.5.
"""

import math
from collections.abc import Callable, Sequence

import attrs
import numpy as np

from flocsim import hooks
from flocsim.body import Body, Fluid
from flocsim.constants import BOLTZMANN
from flocsim.errors import UsageError
from flocsim.fields import above_zero, check_whole, is_number
from flocsim.forces.base import Force, PairForce
from flocsim.forces.body_forces import random_key, thermal_forces
from flocsim.forces.check import kernel_arguments, reach_of
from flocsim.forces.codegen import laws_of
from flocsim.forces.outline import needs_both_shapes, refuse_outlines
from flocsim.forces.pair_resistance import Lubrication, PairResistance
from flocsim.geometry.contact.near_pairs import gap_between
from flocsim.geometry.shapes.shape import Sphere
from flocsim.hydrodynamics.pair import SpherePair
from flocsim.integrators.base import Integrator, Status
from flocsim.integrators.implicit import Overdamped
from flocsim.integrators.loop.kicks import seen_escape
from flocsim.integrators.parts import evaluate_as_they_lie
from flocsim.integrators.rhs.views import centre_line
from flocsim.io.confidence import wilson
from flocsim.run import Run
from flocsim.state.bodies import ANGLE, X
from flocsim.state.views import PairView
from flocsim.state.work import NOW, work_of
from flocsim.system import System

NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)

LEAST_GAP, PANELS_A_DECADE = 1e-13, 40
"""[m] End of the first panel, and panels of quadrature for a factor of ten in the gap."""

FAR = 1e6
"""Distance, in r_i + r_j, up to which W is integrated as it stands; beyond, V counts as none."""

TOUCHED, ESCAPED = 1, 2
"""Codes of the observer."""

ESCAPE = 0
"""Place in ``observed``: the centre distance at which bodies have escaped [m]."""

MOST_STEPS = 10_000_000
"""Steps of a run unless given."""


def repulsion(
    forces: Sequence[Force], radii: tuple[float, float], fluid: Fluid
) -> Callable[[np.ndarray], np.ndarray]:
    """A function of gaps (k,) [m] that gives the force between two spheres at rest [N].

    Forces along outlines are those of their circles, as deep as bodies are that have no depth of
    their own.  UsageError for forces that ask how bodies are turned.
    """
    along = [f for f in forces if isinstance(f, PairForce) and needs_both_shapes(f)]
    refuse_outlines(
        [force for force in along if force.acts_on != "outlines"], "an encounter of two spheres"
    )
    if along:
        return repulsion_of_circles(
            [each for each in forces if isinstance(each, PairForce)], radii, fluid
        )
    present = laws_of(forces, fluid).used.values()
    between = [force for force in present if isinstance(force, PairForce)]
    kernels = [force.kernel_in(fluid) for force in between]
    calls = [
        (kernel, kernel_arguments(force, fluid, kernel), limit_of(force))
        for force, kernel in zip(between, kernels, strict=True)
    ]
    r_i, r_j = radii
    reduced = r_i * r_j / (r_i + r_j)

    def found(gaps):
        total = np.zeros(len(gaps))
        for kernel, arguments, limit in calls:
            for k in np.flatnonzero(gaps < limit):
                gap = float(gaps[k])
                view = PairView(0.0, gap, 0.0, gap + r_i + r_j, r_i, r_j, reduced, 1.0)
                total[k] += kernel(view, *arguments)
        return total

    return found


def slowing(
    forces: Sequence[Force], radii: tuple[float, float], gaps: np.ndarray
) -> np.ndarray:  # fmt: skip
    """Return D_∞/D of two spheres towards each other at gaps (k,) [m]: 1 without the water between
    them; UsageError for a force that knows only the nearest part of it."""
    if any(isinstance(force, Lubrication) for force in forces):
        raise UsageError(
            "the diffusion of two spheres needs all of the water between them: give PairResistance "
            "in the place of Lubrication"
        )
    nearest = [force.h_min for force in forces if isinstance(force, PairResistance)]
    if not nearest:
        return np.ones(len(gaps))
    pair = SpherePair(radii)
    # The relative velocity by two opposite forces, over that of each sphere alone.
    mobilities = [
        motion.along[:, 1] - motion.along[:, 0]
        for motion in (pair.alone(gaps), pair.relative(np.maximum(gaps, nearest[0])))
    ]
    return mobilities[0] / mobilities[1]


def limit_of(force: PairForce) -> float:
    """Return the gap [m] up to which a force between two spheres counts.

    The engine leaves flocsim's own forces out where they are negligible against their value at
    contact; their energy there may still be more than k_B T. So they count up to their ``cut``, if
    they have one, and forces of one's own up to their ``reach``.
    """
    if hasattr(force, "cut"):
        return math.inf if force.cut is None else float(force.cut)
    return reach_of(force)


def repulsion_of_circles(
    forces: Sequence[Force], radii: tuple[float, float], fluid: Fluid
) -> Callable[[np.ndarray], np.ndarray]:
    """The same of forces along outlines and others that keep to a pair, by the engine's own sum."""
    total = sum(radii)
    bodies = [
        Body(Sphere(radius), (place, 0.0), surface_density=1.0)
        for radius, place in zip(radii, (0.0, 2.0 * total), strict=True)
    ]
    system = System(bodies, forces, fluid=fluid)
    scene = system.scene()
    push = system.compose(entry=pushes)

    def found(gaps):
        work, forces_at = work_of(scene, *system.motion()), np.empty(len(gaps))
        # One pair fits in any list.
        push(scene, work, total, np.asarray(gaps, dtype=float), forces_at)
        return forces_at

    return found


def pushes(scene, work, total, gaps, found):
    """The force on the second of two spheres away from the first, at each gap, into ``found``."""
    for k in range(gaps.shape[0]):
        work.place[NOW, 1, X] = total + gaps[k]
        evaluate_as_they_lie(scene, work)
        found[k] = work.force[NOW, 1, X]


class Profile:
    """V/k_B T of two spheres on panels of their gap, from touching to ``far`` [m]; V(far) = 0."""

    def __init__(
        self, forces: Sequence[Force], radii: tuple[float, float], temperature: float,
        fluid: Fluid, far: float, marks: Sequence[float] = (),
    ) -> None:  # fmt: skip
        decades = math.log10(max(far, 10.0 * LEAST_GAP) / LEAST_GAP)
        ends = np.geomspace(LEAST_GAP, far, max(2, round(PANELS_A_DECADE * decades)))
        # Where a law has a kink a panel ends.
        kinks = [getattr(force, "d_min", None) or far for force in forces]
        limits = [limit_of(force) for force in forces if isinstance(force, PairForce)]
        kept = [each for each in (*kinks, *limits, *marks) if 0.0 < each < far]
        self.ends = np.unique(np.concatenate([[0.0], ends, kept]))
        self.half = 0.5 * np.diff(self.ends)[:, None]
        self.gaps = self.ends[:-1, None] + self.half * (NODES + 1.0)
        self.total = sum(radii)
        force = repulsion(forces, radii, fluid)(self.gaps.ravel()).reshape(self.gaps.shape)
        force = force / (BOLTZMANN * temperature)
        # From values at the nodes to integrals from −1 up to each node.
        degrees = np.arange(1, 13)
        rising = (NODES[:, None] ** degrees - (-1.0) ** degrees) / degrees
        within = self.half * (force @ (rising @ np.linalg.inv(np.vander(NODES, increasing=True))).T)
        whole = (self.half * force) @ WEIGHTS
        behind = np.concatenate([np.cumsum(whole[::-1])[::-1], [0.0]])
        self.potential = behind[:-1, None] - within
        self.slowing = slowing(forces, radii, self.gaps.ravel()).reshape(self.gaps.shape)

    def integral(self, begin: float, end: float, dimensions: int) -> float:
        """∫ e^(V/k_B T) (D_∞/D) s^(1−d) ds between two gaps that are ends of panels [m^(2−d)]."""
        rows = (self.ends[:-1] >= begin) & (self.ends[1:] <= end)
        distance = self.gaps[rows] + self.total
        inner = np.exp(self.potential[rows]) * self.slowing[rows] * distance ** (1.0 - dimensions)
        return float(np.sum((self.half[rows] * inner) @ WEIGHTS))


def splitting_probability(
    forces: Sequence[Force], radii: tuple[float, float], release: float | str,
    escape: float | str, *, temperature: float = 298.15, dimensions: int = 2,
    fluid: Fluid | None = None,
) -> float:  # fmt: skip
    """Probability that two spheres touch before their centres are ``escape`` apart [m].

    ``forces``: those between them (others are of no matter); ``radii`` (r_i, r_j) [m];
    ``release``: their centres' distance at first [m]; ``dimensions`` 2, as in a System, or 3.
    UsageError unless r_i + r_j ≤ release ≤ escape.
    """
    r_i, r_j = (above_zero(each, "m", "radii") for each in radii)
    near, far = above_zero(release, "m", "release"), above_zero(escape, "m", "escape")
    check_conditions(temperature, dimensions)
    touch = r_i + r_j
    if not touch <= near <= far or not touch < far:
        raise UsageError(
            f"release must lie between r_i + r_j = {touch:g} m and escape = {far:g} m, found "
            f"{near:g} m"
        )
    begin, end = near - touch, far - touch
    profile = Profile(forces, (r_i, r_j), temperature, fluid or Fluid(), end, [begin])
    outside = profile.integral(begin, end, dimensions)
    return outside / profile.integral(0.0, end, dimensions)


def stability_ratio(
    forces: Sequence[Force], radii: tuple[float, float], *, temperature: float = 298.15,
    fluid: Fluid | None = None,
) -> float:  # fmt: skip
    """W: by how much the interaction of two spheres slows down their coagulation by diffusion.

    W = R ∫_R^∞ e^(V/k_B T) s⁻² ds with R = r_i + r_j, 1 without forces; the rate is 4π D R n/W for
    a relative diffusion D.  Source: Fuchs (1934), as in Russel, Saville and Schowalter (1989),
    Colloidal Dispersions, section 8.4.
    """
    r_i, r_j = (above_zero(each, "m", "radii") for each in radii)
    check_conditions(temperature, 3)
    touch = r_i + r_j
    end = FAR * touch
    profile = Profile(forces, (r_i, r_j), temperature, fluid or Fluid(), end)
    return touch * (profile.integral(0.0, end, 3) + 1.0 / (touch + end))


def check_conditions(temperature: float, dimensions: int) -> None:
    """UsageError for no temperature, or no space, to diffuse in."""
    if not is_number(temperature) or not temperature > 0.0:
        raise UsageError(f"temperature must be above 0 K, found {temperature!r}")
    if dimensions not in (2, 3):
        raise UsageError(f"dimensions must be 2 or 3, found {dimensions!r}")


def always(observed):
    """A touch ends a step of any method."""
    return True


def watch_meeting(scene, work, observed, time):
    """The observer: 0 to go on, TOUCHED or ESCAPED."""
    _, _, distance = centre_line(scene, work, NOW, 1, 0)
    if distance >= observed[ESCAPE]:
        return ESCAPED
    return TOUCHED if gap_between(scene, work, 1, 0) <= 0.0 else 0


OBSERVER: dict[Callable, Callable] = {hooks.awaits_touch: always, hooks.observe: watch_meeting}


@attrs.frozen
class Meetings:
    """What became of so many pairs: how many ``touched``, ``escaped``, or did neither within their
    steps (``undecided``); ``times`` (k,) [s] at which each ended, ``steps`` that all took."""

    touched: int
    escaped: int
    undecided: int
    times: np.ndarray = attrs.field(eq=attrs.cmp_using(eq=np.array_equal), repr=False)
    steps: int = attrs.field(repr=False)

    @property
    def probability(self) -> float:
        """Share of the decided that touched; NaN where none is decided."""
        decided = self.touched + self.escaped
        return self.touched / decided if decided else math.nan

    def interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """Wilson's interval of the probability."""
        low, high = wilson(self.touched, self.touched + self.escaped, confidence)
        return float(low), float(high)


def brownian_meetings(
    bodies: Sequence[Body], forces: Sequence[Force], release: float | str, escape: float | str,
    replicates: int, *, seed: int = 0, fluid: Fluid | None = None,
    integrator: Integrator | None = None, max_steps: int = MOST_STEPS, jit: bool = True,
) -> Meetings:  # fmt: skip
    """Let two bodies go with their centres ``release`` apart [m] until they touch or escape.

    Each replicate has angles and kicks of its own, by (seed, replicate) alone. ``forces`` have to
    hold a Thermal and a drag; ``integrator``: Overdamped unless given. Places and angles of
    ``bodies`` do not matter. UsageError for anything but two bodies, a Thermal force, a release
    that keeps them apart at any angle, and an escape further away.
    """
    if len(bodies) != 2:
        raise UsageError(f"a Brownian encounter needs two bodies, found {len(bodies)}")
    if not thermal_forces(forces):
        raise UsageError("a Brownian encounter needs a Thermal force with temperature above 0 K")
    check_whole(replicates, 1, "replicates")
    near, far = above_zero(release, "m", "release"), above_zero(escape, "m", "escape")
    touch = sum(body.shape.bounding_radius for body in bodies)
    if not touch < near < far:
        raise UsageError(
            f"release must be between {touch:g} m, where the bodies may touch, and escape = "
            f"{far:g} m, found {near:g} m"
        )
    one, other = bodies
    system = System(
        [attrs.evolve(one, position=(0.0, 0.0)), attrs.evolve(other, position=(0.0, near))],
        forces, integrator or Overdamped(), fluid or Fluid(), seed=seed,
    )  # fmt: skip
    observed = np.array([far])
    first = system.begin(
        math.inf, max_steps=max_steps, observer=OBSERVER, jit=jit, observed=observed
    )  # fmt: skip
    observed[ESCAPE] = seen_escape(first.scene.kicks, touch, near, far)
    codes, times, steps = [], [], 0
    for replicate in range(replicates):
        run = placed(first, near, seed, replicate)
        status = run.to_end()
        codes.append(run.code if status == Status.STOPPED else 0)
        times.append(run.time)
        steps += run.steps
    touched, escaped, neither = (codes.count(code) for code in (TOUCHED, ESCAPED, 0))
    return Meetings(touched, escaped, neither, np.array(times), steps)


def placed(first: Run, near: float, seed: int, replicate: int) -> Run:
    """A replicate's Run that has yet to take its first step."""
    run = first.copy()
    stream = np.random.SeedSequence(seed, spawn_key=(replicate,))
    numbers = 2.0 * np.pi * np.random.Generator(np.random.Philox(stream)).random(3)
    run.scene = first.scene._replace(key=random_key(seed, replicate))
    run.work.place[NOW] = run.work.velocity[NOW] = 0.0
    run.work.place[NOW, :, ANGLE] = numbers[:2]
    run.work.place[NOW, 1, :2] = near * np.cos(numbers[2]), near * np.sin(numbers[2])
    return run
