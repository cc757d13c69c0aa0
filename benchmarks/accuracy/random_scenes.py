"""Numbered random scenes that reach every part of the engine, and how each of them ends.

    python -m benchmarks.accuracy.random_scenes [--quick] [--scenes 2000] [--first 0] [--family …]
                                                [--errors]

Scene k depends on k alone, so that a number names it for good. The families take turns: any
seventeen numbers in a row have all of them. Scenes are short, a few hundred steps of some bodies of
5 µm in water, and share few compiled engines, so that thousands run in minutes. `constants` counts
in how many of them an outcome depends on a constant of the engine. With ``--errors`` each System
without kicks runs again at a thousandth of its tolerance, and its error is held against the stated
one; motions that amplify a difference more than tenfold are counted apart.
"""

import math
import time
import warnings
from collections import Counter
from collections.abc import Callable

import attrs
import numpy as np

from benchmarks.reporting import Table, begin
from benchmarks.stability.case import Draw
from benchmarks.stability.shapes import (
    convex,
    made,
    outline_gap,
    place_at_gap,
    placed,
    segment,
    star,
    wavy,
)
from flocsim import Body, Fluid, Sphere, Swarm, System, floor, wall
from flocsim.constants import STANDARD_GRAVITY
from flocsim.errors import PlausibilityWarning
from flocsim.forces import (
    Contact,
    DoubleLayer,
    Gravity,
    PairResistance,
    StokesDrag,
    Thermal,
    VanDerWaals,
)
from flocsim.integrators import BackwardEuler, DormandPrince54, Implicit, Status
from flocsim.integrators.amplification import MOST_AMPLIFIED, end_distance
from flocsim.swarms.placement import place_at_random

SEED = 20261128
"""Decides all scenes, with their numbers."""

WATER = Fluid(buoyancy=True)
DENSITY = 2650.0

STEP_BUDGET = 20_000
"""Steps after which a scene ends as STEP_BUDGET."""

FINER, FINEST = 1e-3, 1e-14
"""Tolerance of what counts as exact, over that of the scene, and the least [m]."""

NUDGE, UNTOUCHED = 1e-10, 1e-17
"""How far a companion starts from an exact run, and what differs by rounding [m]."""

TOGETHER = 1e-8
"""Bodies nearer than this gap [m] at the end are together: contacts are less than 1 nm deep, and
bodies that part are soon further away."""


@attrs.frozen
class End:
    """How a scene has ended: ``status``; ``together``, the pairs of bodies with a gap below
    TOGETHER; ``bonds``, what holds those of a swarm; ``steps`` tried and ``evaluations`` of the
    forces; ``position`` (n, 3) and its stated ``error`` [m]."""

    status: str
    together: tuple[tuple[int, int], ...]
    bonds: tuple[int, ...]
    steps: int
    evaluations: int
    position: np.ndarray = attrs.field(eq=False)
    error: float

    @property
    def outcome(self) -> tuple:
        """What a user would see as the result."""
        return self.status, self.together, self.bonds

    @property
    def is_right(self) -> bool:
        """True if the end time was reached with numbers."""
        return self.status == Status.FINISHED.name and bool(np.isfinite(self.position).all())


@attrs.frozen(eq=False)
class RandomScene:
    """A System or Swarm to run to a time [s]; its ``number`` and ``family``."""

    number: int
    family: str
    system: System | Swarm
    until: float

    def run(self, max_steps: int = STEP_BUDGET) -> End:
        """Run the scene to its End."""
        if isinstance(self.system, Swarm):
            return self.run_swarm(self.system, max_steps)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PlausibilityWarning)
            found = self.system.run(self.until, max_steps=max_steps, record=False)
        last = found.position[-1]
        near = together(self.system.bodies, last) if np.isfinite(last).all() else ()
        steps = found.steps + found.rejected
        return End(found.status.name, near, (), steps, found.evaluations, last, found.error)

    def run_swarm(self, swarm: Swarm, max_steps: int) -> End:
        """Run a swarm, and look at its bonds over the last tenth of the time."""
        found = swarm.run(
            self.until, times=[0.9 * self.until, self.until], max_steps=max_steps
        )  # fmt: skip
        near, bonds = found.neighbours(within=TOGETHER).pairs, found.bonds(within=TOGETHER)
        order = np.lexsort(bonds.pairs.T[::-1])
        effort = found.effort
        return End(
            found.status.name, tuple(sorted(map(tuple, near.tolist()))),
            tuple(bonds.kind[order].tolist()), effort.steps + effort.rejected, effort.evaluations,
            found.position[-1], float(found.error[-1]),
        )  # fmt: skip


def together(bodies, position):
    """Return the pairs of bodies, not both fixed, whose outlines are nearer than TOGETHER."""
    found = []
    for j, later in enumerate(bodies):
        for i, earlier in enumerate(bodies[:j]):
            reach = earlier.shape.bounding_radius + later.shape.bounding_radius + TOGETHER
            apart = np.hypot(*(position[j, :2] - position[i, :2]))
            if apart < reach and not (earlier.fixed and later.fixed):
                gap = outline_gap(earlier.shape, position[i], later.shape, position[j])
                if gap < TOGETHER:
                    found.append((i, j))
    return tuple(found)


# What scenes are made of.


def between(draw, least, largest):
    """Draw a number, evenly in the logarithm."""
    return float(np.exp(draw.uniform(math.log(least), math.log(largest))))


def sphere(draw):
    """Draw a sphere of 2 to 8 µm."""
    return Sphere(between(draw, 2e-6, 8e-6))


def polygon(draw, most=12):
    """Draw a convex, star-shaped or wavy polygon, or a rod."""
    kind, radius = draw.pick(convex, convex, star, wavy, segment), between(draw, 2e-6, 8e-6)
    if kind is segment:
        return made(draw, segment, radius)
    count = 24 if kind is wavy else int(draw.rng.integers(3, most + 1))
    return made(draw, kind(count), radius)


def shape(draw):
    """Draw a polygon, or a sphere in a quarter of all cases."""
    return sphere(draw) if draw.rng.random() < 0.25 else polygon(draw)


def implicit(draw):
    """Draw a tolerance for the default method."""
    return Implicit(tolerance=between(draw, 1e-11, 3e-9))


def contact(draw, least=2.0, largest=200.0, **more):
    """Draw a contact law with or without bounce, tension and tangential springs."""
    k_n = between(draw, least, largest)
    law = {
        "k_n": k_n,
        "k_t": draw.pick(0.0, 0.1, 0.3) * k_n,
        "tension": draw.pick(True, False),
    } | more
    if draw.rng.random() < 0.5:
        law["restitution"] = draw.uniform(0.2, 0.95)
        law["damping_n"] = None
    return Contact(**law)


def rubbing(draw, **more):
    """Draw a contact law with a Coulomb limit, which the tangential springs need."""
    return contact(draw, k_t=draw.uniform(0.5, 5.0), friction=between(draw, 0.03, 1.0), **more)


def oscillation(law, bodies):
    """Return the time [s] that a contact of two bodies lasts."""
    mass = 1.0 / sum(0.0 if body.fixed else 1.0 / body.mass for body in bodies)
    return math.pi * math.sqrt(mass / law.k_n)


def thrown(draw, shapes, speed, spin=True, aside=0.6):
    """Return two bodies near each other, of which the second flies into the first, and the time
    [s] until it gets there."""
    one, other = (Body(each, density=DENSITY) for each in shapes)
    at, direction = (0.0, 0.0, draw.angle()), draw.angle()
    gap = between(draw, 1e-9, 2e-6)
    place = place_at_gap(one.shape, at, other.shape, draw.angle(), direction, gap)
    course = direction + draw.uniform(-aside, aside)
    velocity = -speed * math.cos(course), -speed * math.sin(course)
    turning = draw.uniform(-2.0, 2.0) * speed / other.shape.bounding_radius if spin else 0.0
    return [placed(one, at), placed(other, place, velocity, turning)], gap / speed


def settling_time(radius, distance):
    """Return the time [s] in which a sphere settles by a distance [m] in water."""
    excess = DENSITY - WATER.density
    return distance * 4.5 * WATER.viscosity / (excess * STANDARD_GRAVITY * radius**2)


def stack(draw, below, shapes, gap=1e-7, lean=0.2):
    """Return bodies one above the other on the last of some bodies."""
    bodies = list(below)
    for each in shapes:
        *others, last = bodies
        place = None
        # The outline of the last body alone is sure to be free.
        while place is None or any(gap_to(one, each, place) <= 0.0 for one in others):
            upwards = 0.5 * math.pi + draw.uniform(-lean, lean)
            at = *last.position, last.angle
            place = place_at_gap(
                last.shape, at, each, draw.angle(), upwards, between(draw, 0.1, 1.0) * gap
            )  # fmt: skip
        bodies.append(placed(Body(each, density=DENSITY), place))
    return bodies


def gap_to(body, shape, place):
    """Return the gap [m] between a body and a shape at a place (x, y, θ)."""
    return outline_gap(body.shape, (*body.position, body.angle), shape, place)


def level(width):
    """Return a floor about the origin."""
    return wall((-0.5 * width, 0.0), (0.5 * width, 0.0), 0.5e-6)


# The families: each returns a System or Swarm, and the time [s] to which it runs.


def impact(draw, shapes, law, forces=(), integrator=None, fluid=None):
    """Let one body fly into another, and both go on for some lengths of a contact."""
    bodies, flight = thrown(draw, shapes, between(draw, 1e-3, 0.3))
    until = flight + between(draw, 1.0, 100.0) * oscillation(law, bodies)
    method = integrator or implicit(draw)
    return System(bodies, [*forces, law], method, fluid or WATER), until


def spheres_with_friction(draw):
    return impact(draw, [sphere(draw), sphere(draw)], rubbing(draw), [Gravity(), StokesDrag()])


def polygons_with_friction(draw):
    return impact(draw, [shape(draw), polygon(draw)], rubbing(draw), [Gravity(), StokesDrag()])


def without_drag(draw):
    return impact(draw, [shape(draw), polygon(draw)], contact(draw), fluid=Fluid())


def stiff_contacts(draw):
    law = rubbing(draw, least=1e3, largest=1e6)
    return impact(draw, [shape(draw), polygon(draw)], law, [Gravity(), StokesDrag()])


def explicit_method(draw):
    method = DormandPrince54(tolerance=between(draw, 1e-11, 1e-9))
    shapes = [shape(draw), polygon(draw)]
    return impact(draw, shapes, contact(draw), [Gravity(), StokesDrag()], method)


def walls(draw):
    """Drop a body onto a floor, on which it comes to rest."""
    body, law = shape(draw), rubbing(draw)
    bodies = stack(draw, [level(2e-4)], [body], gap=1e-6)
    until = settling_time(body.equivalent_radius, between(draw, 1e-7, 1e-5))
    return System(bodies, [Gravity(), StokesDrag(), law], implicit(draw), WATER), until


def inclines(draw):
    """Let a body roll or slide down a slope."""
    tilt, body, law = draw.uniform(0.1, 1.2), shape(draw), rubbing(draw)
    along = np.array([math.cos(tilt), math.sin(tilt)])
    slope = wall(tuple(-2e-4 * along), tuple(2e-4 * along), 0.5e-6)
    lower = (*slope.position, slope.angle)
    upwards = tilt + 0.5 * math.pi
    place = place_at_gap(slope.shape, lower, body, draw.angle(), upwards, between(draw, 1e-9, 1e-7))
    bodies = [slope, placed(Body(body, density=DENSITY), place)]
    until = settling_time(body.equivalent_radius, between(draw, 1e-7, 1e-5))
    return System(bodies, [Gravity(), StokesDrag(), law], implicit(draw), WATER), until


def along_outlines(draw):
    """Let a polygon settle towards another one under forces along both outlines."""
    shapes = [polygon(draw, most=8), polygon(draw, most=8)]
    attraction = VanDerWaals(between(draw, 1e-21, 1e-18), 1e-9, law="outline")
    repulsion = DoubleLayer(
        between(draw, 5e-3, 5e-2), between(draw, 4e-8, 1e-7), law="outline",
        boundary=draw.pick("superposition", "potential"),
    )  # fmt: skip
    forces = [Gravity(), StokesDrag(), attraction, repulsion]
    bodies = stack(draw, [Body(shapes[0], density=DENSITY)], shapes[1:], gap=3e-8, lean=0.6)
    bodies[0] = attrs.evolve(bodies[0], fixed=True)
    until = settling_time(shapes[1].equivalent_radius, between(draw, 1e-9, 3e-8))
    return System(bodies, [*forces, contact(draw)], implicit(draw), WATER), until


def between_spheres(draw):
    """Let a body settle towards another one under forces between spheres, or surfaces."""
    gap, shapes = draw.pick("surface", "equivalent_spheres"), [sphere(draw), shape(draw)]
    forces = [
        Gravity(), StokesDrag(), VanDerWaals(between(draw, 1e-21, 1e-18), gap=gap),
        DoubleLayer(between(draw, 5e-3, 5e-2), between(draw, 1e-9, 1e-6), gap=gap),
    ]  # fmt: skip
    bodies = stack(draw, [Body(shapes[0], density=DENSITY)], shapes[1:], gap=5e-7, lean=0.6)
    bodies[0] = attrs.evolve(bodies[0], fixed=draw.pick(True, False))
    until = settling_time(shapes[1].equivalent_radius, between(draw, 1e-7, 3e-6))
    return System(bodies, [*forces, contact(draw)], implicit(draw), WATER), until


def outline(draw, least, largest):
    """Draw a star-shaped, wavy or convex polygon of 5 to 29 vertices."""
    kind = draw.pick(star, wavy, convex)
    count = 24 if kind is wavy else int(draw.rng.integers(5, 30))
    return made(draw, kind(count), between(draw, least, largest))


def sliding_pairs(draw):
    """Let a polygon slide off another one under a large weight, without tension."""
    shapes = [outline(draw, 3e-6, 12e-6) for _ in range(2)]
    bodies = stack(draw, [Body(shapes[0], density=DENSITY)], shapes[1:], gap=1e-7, lean=1.2)
    bodies[0] = attrs.evolve(bodies[0], fixed=draw.pick(True, False, False))
    weight, k_n = between(draw, 9.81, 200.0), between(draw, 0.5, 20.0)
    law = Contact(
        k_n=k_n, k_t=draw.uniform(0.1, 0.6) * k_n, friction=between(draw, 0.2, 1.0),
        tension=False, damping_n=draw.pick(0.0, 1e4, 1e5, "critical"),
    )  # fmt: skip
    until = settling_time(shapes[1].equivalent_radius, between(draw, 1e-6, 3e-5))
    method = Implicit(between(draw, 1e-10, 3e-9))
    forces = [Gravity(weight), StokesDrag(), law]
    return System(bodies, forces, method, WATER), until * STANDARD_GRAVITY / weight


def heavy_pairs(draw):
    """Let a polygon roll over another one under a very large weight: contacts unload slowly."""
    shapes = [outline(draw, 1e-6, 6e-6) for _ in range(2)]
    bodies = stack(draw, [Body(shapes[0], density=DENSITY)], shapes[1:], gap=1e-7, lean=0.6)
    weight = between(draw, 100.0, 3000.0)
    law = Contact(k_n=20.0, k_t=draw.pick(0.0, 2.0, 2.0))
    until = settling_time(shapes[1].equivalent_radius, between(draw, 1e-6, 2e-5))
    forces = [Gravity(weight), StokesDrag(), law]
    method = Implicit(between(draw, 5e-12, 1e-9))
    return System(bodies, forces, method, WATER), until * STANDARD_GRAVITY / weight


def columns(draw):
    """Stack two to four bodies on a floor, on which they lean and slide."""
    shapes = [shape(draw) for _ in range(draw.pick(2, 3, 4))]
    bodies = stack(draw, [level(4e-4)], shapes)
    until = settling_time(shapes[0].equivalent_radius, between(draw, 1e-7, 3e-6))
    return System(bodies, [Gravity(), StokesDrag(), rubbing(draw)], implicit(draw), WATER), until


def kicks(draw):
    """Let two bodies diffuse near each other, which attract each other."""
    shapes = [sphere(draw), shape(draw)]
    bodies = stack(draw, [Body(shapes[0], density=DENSITY)], shapes[1:], lean=3.0)
    thermal = Thermal(kick=draw.pick("auto", 1e-3))
    forces = [StokesDrag(), thermal, VanDerWaals(between(draw, 1e-21, 1e-19), gap="surface")]
    until = between(draw, 1e-3, 3e-2)
    key = int(draw.rng.integers(2**31))
    return System([*bodies], [*forces, contact(draw)], implicit(draw), WATER, seed=key), until


def pair_hydrodynamics(draw):
    """Let two spheres settle that resist each other through the water."""
    shapes = [Sphere(draw.pick(2.5e-6, 5e-6)), Sphere(5e-6)]
    bodies = stack(draw, [Body(shapes[0], density=DENSITY)], shapes[1:], gap=1e-6, lean=0.8)
    forces = [
        Gravity(), StokesDrag(), PairResistance(h_min=between(draw, 1e-9, 1e-7)),
        VanDerWaals(between(draw, 1e-21, 1e-19), gap="surface"),
    ]  # fmt: skip
    until = settling_time(5e-6, between(draw, 1e-6, 1e-4))
    return System(bodies, [*forces, contact(draw)], implicit(draw), WATER), until


def placed_over_floor(draw, count, fraction):
    """Return a floor, bodies at random places above it, and its width [m]."""
    shapes = [shape(draw) for _ in range(count)]
    width = between(draw, 3.0, 8.0) * 2.0 * max(each.bounding_radius for each in shapes)
    area = sum(each.area for each in shapes)
    height = area / (fraction * width) + 4.0 * max(each.bounding_radius for each in shapes)
    places = place_at_random(shapes, (width, height), draw.rng, (False, False))
    bodies = [
        Body(each, (x, y + 2e-7), angle, density=DENSITY)
        for each, (x, y, angle) in zip(shapes, places.tolist(), strict=True)
    ]
    return [floor(width, beyond=1e-4, radius=0.5e-6), *bodies], width


def beds(draw):
    """Let 7 to 11 bodies come to rest in a box with two walls, by backward Euler."""
    bodies, width = placed_over_floor(draw, int(draw.rng.integers(7, 12)), 0.3)
    sides = [wall((x, -1e-5), (x, 4e-4), 0.5e-6) for x in (-0.6e-6, width + 0.6e-6)]
    method = BackwardEuler(tolerance=between(draw, 1e-9, 1e-8))
    until = settling_time(5e-6, between(draw, 3e-6, 3e-5))
    forces = [Gravity(), StokesDrag(), rubbing(draw)]
    return System([*sides, *bodies], forces, method, WATER), until


def swarms(draw):
    """Let a swarm of 4 to 12 bodies settle onto a floor."""
    bodies, _ = placed_over_floor(draw, int(draw.rng.integers(3, 12)), 0.25)
    forces = [Gravity(), StokesDrag(), rubbing(draw)]
    swarm = Swarm(bodies, forces, implicit(draw), WATER)
    return swarm, settling_time(5e-6, between(draw, 3e-6, 3e-5))


def bonds(draw):
    """Let two to four bodies that attract each other settle, meet and stick."""
    shapes = [shape(draw) for _ in range(draw.pick(2, 3, 4))]
    bodies = stack(draw, [Body(shapes[0], density=DENSITY)], shapes[1:], lean=1.5)
    attraction = VanDerWaals(between(draw, 1e-21, 1e-18), gap="surface", cut=1e-6)
    forces = [Gravity(), StokesDrag(), attraction, contact(draw)]
    swarm = Swarm(bodies, forces, implicit(draw), WATER)
    return swarm, settling_time(5e-6, between(draw, 3e-6, 3e-5))


FAMILIES: dict[str, Callable] = {
    "spheres with friction": spheres_with_friction,
    "polygons with friction": polygons_with_friction,
    "without drag": without_drag,
    "stiff contacts": stiff_contacts,
    "explicit method": explicit_method,
    "walls": walls,
    "inclines": inclines,
    "forces along outlines": along_outlines,
    "forces between spheres": between_spheres,
    "sliding pairs": sliding_pairs,
    "heavy pairs": heavy_pairs,
    "columns": columns,
    "kicks": kicks,
    "pair hydrodynamics": pair_hydrodynamics,
    "beds": beds,
    "swarms": swarms,
    "bonds": bonds,
}
"""{family: function of a Draw that returns a System or Swarm, and the time [s] to run it}."""

NAMES = list(FAMILIES)


def family_of(number: int) -> str:
    """Return the family of a scene."""
    return NAMES[number % len(NAMES)]


def scene_of(number: int) -> RandomScene:
    """Return the scene of a number."""
    draw, family = Draw(np.random.default_rng([SEED, number])), family_of(number)
    return RandomScene(number, family, *FAMILIES[family](draw))


def error_of(scene, end):
    """Return (true error, stated error [m], amplification) of how a scene ended, the last only
    where it matters; None where there is nothing to hold it against."""
    system = scene.system
    thermal = any(isinstance(force, Thermal) for force in system.forces)
    if isinstance(system, Swarm) or thermal or not end.is_right:
        return None
    finest = max(FINER * system.integrator.tolerance, FINEST)
    exact = attrs.evolve(system, integrator=Implicit(finest))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PlausibilityWarning)
        best = exact.run(scene.until, max_steps=20 * STEP_BUDGET, record=False)
        if best.status != Status.FINISHED:
            return None
        true, growth = end_distance(system.bodies, end.position, best.position[-1]), 0.0
        if true > max(end.error, UNTOUCHED):
            growth = exact.amplification(
                scene.until, best.position[-1], 20 * STEP_BUDGET, nudge=NUDGE
            )
    return true, end.error, growth


def print_errors(found):
    """Print in how many scenes of each family the stated error covers the true one."""
    rows = []
    for name in NAMES:
        own = [error_of(scene, end) for scene, end, _ in found if scene.family == name]
        known = [each for each in own if each is not None]
        amplified = sum(growth >= MOST_AMPLIFIED for *_, growth in known)
        beyond = sum(
            true > max(stated, UNTOUCHED) and growth < MOST_AMPLIFIED
            for true, stated, growth in known
        )
        if known:
            rows.append([name, str(len(known)), str(amplified), str(beyond)])
    Table("Stated errors", ("family", "scenes", "amplified", "beyond"), rows).print()
    scenes, amplified, beyond = np.array([row[1:] for row in rows], int).sum(axis=0)
    print(f"within the stated error: {100.0 - 100.0 * beyond / (scenes - amplified):.2f} %")


def family_row(name, found):
    """Return one row of the table: how the scenes of a family ended."""
    ends = [end for _, end, _ in found]
    statuses = Counter(end.status for end in ends)
    words = ", ".join(f"{status} {count}" for status, count in statuses.most_common())
    touching = sum(bool(end.together) for end in ends) / len(ends)
    return [
        name, str(len(ends)), words, f"{touching:.2f}",
        f"{np.median([end.steps for end in ends]):.0f}", str(max(end.steps for end in ends)),
        f"{sum(spent for *_, spent in found):.2g}",
    ]  # fmt: skip


def main():
    """Print how the scenes of each family end, and those that do not reach their time."""
    options = begin(
        __doc__, scenes=2000, first=0, family={"choices": NAMES}, errors={"action": "store_true"}
    )
    count = 150 if options.quick else options.scenes
    numbers = range(options.first, options.first + count)
    found = []
    for number in numbers:
        if options.family in (None, family_of(number)):
            scene, began = scene_of(number), time.process_time()
            found.append((scene, scene.run(), time.process_time() - began))
    columns_ = ("family", "scenes", "ends", "together", "median steps", "most", "CPU [s]")
    rows = [[each for each in found if each[0].family == name] for name in NAMES]
    table = [family_row(name, row) for name, row in zip(NAMES, rows, strict=True) if row]
    Table("Random scenes", columns_, table).print()
    for scene, end, _ in found:
        if not end.is_right:
            print(f"- scene {scene.number}, {scene.family}: {end.status} after {end.steps} steps")
    print()
    if options.errors:
        print_errors(found)


if __name__ == "__main__":
    main()
