"""Whether the stated error covers the true one, on random runs of every family.

    python -m benchmarks.accuracy.stated_error [--runs 2000] [--processes 2] [--families …]
                                               [--seconds S] [--first K] [--worst N]

``--first`` is the number of the first run, ``--seconds`` the most for a family, ``--worst`` how
many of the worst runs are listed.

A run at the default tolerance is held against the same at 1e-12 m, and a companion of that, nudged
by 1e-10 m, says by how much the motion amplifies a difference; runs that amplify it more than ten
times, for which no sum of errors can speak, are counted and left out.
"""

import math
import multiprocessing
import time
import warnings
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import attrs
import numpy as np

from benchmarks.reporting import Table, begin
from flocsim import Body, Swarm, System, wall
from flocsim.constants import STANDARD_GRAVITY
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.study import Study
from flocsim.errors import PlausibilityWarning
from flocsim.forces import Contact, Gravity, StokesDrag
from flocsim.integrators import Implicit, Status
from flocsim.integrators.amplification import MOST_AMPLIFIED, end_distance
from flocsim.swarms.placement import place_at_random

# Scenes made for what they show: flocs thrown at each other in water are faster than Stokes's drag.
warnings.simplefilter("ignore", PlausibilityWarning)

EXACT, NUDGE = 1e-12, 1e-10
"""Tolerance [m] of what counts as exact, and how far its companion starts from it [m]."""

UNTOUCHED = 1e-18
"""Runs that differ by less [m] differ by rounding: nothing has met."""

MOST_TRIED = 100
"""How many runs are looked at, at most, for each that counts."""

VERTICES = (8, 16, 32, 64)
MOST_STEPS = 100_000
COLLOID = {"double_layer": {"debye_length": 30e-9, "potential": 0.03}}
CONFIG = (
    'preset = "{}"\nseed = 7\nreplicates = 1\n[shapes]\nvertices = [8, 16, 32, 64]\npool = 40\n'
)


@cache
def study(preset, contact=()):
    """The study that replicates are taken from; ``contact``: (name, value) of its law."""
    changes = {"forces": COLLOID} if preset == "si" else {}
    if contact:
        changes = {"forces": {"contact": dict(contact)}}
    with TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(CONFIG.format(preset))
        return Study(load_config(path, changes))


def replicate(rng, number, preset, outcomes, longer=1.0, **contact):
    """(System, until) of a random replicate that ends in one of these outcomes; None of another."""
    found = study(preset, tuple(contact.items()))
    place = int(rng.integers(3)), int(rng.choice(VERTICES)), float(rng.random())
    row = found.run(*place, number)
    if row["outcome"] not in outcomes:
        return None
    return found.draw(*place, number).system(), longer * row["t_end"]


def departing(rng, number):
    """A collision that ends apart."""
    return replicate(rng, number, "tang2014", (1, 3))


def rolling(rng, number):
    """A collision that ends bound, and the doublet's first rolling."""
    return replicate(rng, number, "tang2014", (0, 2), longer=2.0)


def friction(rng, number):
    """Any collision with Coulomb friction."""
    return replicate(rng, number, "tang2014", (0, 1, 2, 3), friction=float(rng.choice([0.1, 0.3])))


STIFF = 2e5
"""Normal stiffness [N/m] at which weight overlaps outlines by less than 1e-12 m."""


def stiff(rng, number):
    """Any collision of bodies ten thousand times as stiff."""
    return replicate(rng, number, "tang2014", (0, 1, 2, 3), k_n=STIFF, k_t=0.1 * STIFF)


def surface_forces(rng, number):
    """Stable colloids, which pass each other on their double layers."""
    return replicate(rng, number, "si", (0, 1, 2, 3, 4, 7))


def random_shape(rng):
    """A fitted floc of the pool, of a random number of vertices and size."""
    flocs = study("tang2014").flocs
    floc = flocs[int(rng.integers(len(flocs)))]
    shape = floc.shapes[int(rng.choice(VERTICES))]
    return shape.scaled(float(rng.uniform(5e-6, 2e-5)) / shape.equivalent_radius)


def thrown_together(rng, angles, count, contact):
    """(System, until) of so many flocs that are thrown into each other in water, the first of them
    from the direction ``angles`` [rad]."""
    bodies = []
    for k in range(count):
        direction = angles + 2.0 * math.pi * k / count
        shape = random_shape(rng)
        place = 6e-5 * (1.0 + count / 6.0) * np.array([math.cos(direction), math.sin(direction)])
        velocity = -place / 6e-4 * rng.uniform(0.7, 1.3) + rng.normal(size=2) * 0.01
        bodies.append(Body(
            shape, tuple(place), float(rng.uniform(0.0, 6.0)), tuple(velocity),
            float(rng.normal() * 1e3), surface_density=2.0,
        ))  # fmt: skip
    system = System(bodies, [Gravity(), StokesDrag(), contact], Implicit())
    return system, float(rng.uniform(4e-4, 1e-3))


def several_bodies(rng, number):
    """Three to six flocs that are thrown into each other in water."""
    angles = rng.uniform(0.0, 2.0 * math.pi)
    return thrown_together(rng, angles, int(rng.integers(3, 7)), Contact())


def without_tension(rng, number):
    """Two or three flocs that are thrown into each other, with friction, and tension off."""
    angles, friction = rng.uniform(0.0, 2.0 * math.pi), float(rng.choice([0.1, 0.3, 0.6]))
    contact = Contact(friction=friction, tension=False)
    return thrown_together(rng, angles, int(rng.integers(2, 4)), contact)


def fifty_bodies(rng, number):
    """Fifty flocs in a crowd that are thrown about: run as a swarm, in islands and windows."""
    shapes = [random_shape(rng) for _ in range(50)]
    side = math.sqrt(sum(shape.area for shape in shapes) / CROWDED)
    places = place_at_random(shapes, (side, side), rng, (False, False), gap=1e-7)
    bodies = [
        Body(shape, (x, y), angle, tuple(0.02 * rng.normal(size=2)), float(rng.normal() * 3e2),
             surface_density=2.0)
        for shape, (x, y, angle) in zip(shapes, places.tolist(), strict=True)
    ]  # fmt: skip
    system = System(bodies, [Gravity(), StokesDrag(), Contact()], Implicit())
    return system, float(rng.uniform(1e-4, 3e-4))


CROWDED = 0.12
"""Area fraction of the crowd."""


def free_flight(rng, number):
    """Two flocs that bounce once or more in nothing, and fly on for a few of their sizes."""
    height, speed = 4e-5, float(rng.uniform(0.01, 0.1))
    bodies = [
        Body(random_shape(rng), (side * height, float(rng.normal() * 5e-6)),
             float(rng.uniform(0.0, 6.0)), (-side * speed, 0.0), float(rng.normal() * 1e3),
             surface_density=2.0)
        for side in (-1.0, 1.0)
    ]  # fmt: skip
    damping = float(rng.choice([0.0, 1e5]))
    return System(bodies, [Contact(damping_n=damping)], Implicit()), float(
        rng.uniform(1.0, 4.0)
    ) * height / speed


def bouncing(rng, number):
    """A floc that falls onto a floor in nothing, and bounces some times."""
    shape, height = random_shape(rng), float(rng.uniform(1e-6, 2e-5))
    start = shape.bounding_radius + height
    body = Body(shape, (0.0, start), float(rng.uniform(0.0, 6.0)), surface_density=2.0)
    ground = wall((-1e-3, -1e-5), (1e-3, -1e-5), radius=1e-5)
    contact = Contact(damping_n=float(rng.choice([0.0, 1e4, 1e5])))
    fall = math.sqrt(2.0 * start / STANDARD_GRAVITY)
    return System([body, ground], [Gravity(), contact], Implicit()), rng.uniform(1.0, 4.0) * fall


FAMILIES = {each.__name__: each for each in (
    departing, rolling, friction, stiff, surface_forces, several_bodies, without_tension,
    free_flight, bouncing, fifty_bodies,
)}  # fmt: skip


def ended_swarm(system, until):
    """(places at the end (n, 3), stated error [m]) of the bodies of a system run as a swarm; None
    where it does not come to its end."""
    found = Swarm(system.bodies, system.forces, system.integrator, system.fluid).run(until)
    if found.status != Status.FINISHED:
        return None
    return found.position[-1], float(found.error[-1])


def ended(system, until):
    """The run of a system; None where it does not come to its end."""
    found = system.run(until, max_steps=MOST_STEPS, record=False)
    return found if found.status == Status.FINISHED else None


def judge(family, tolerance, number):
    """(true error, stated error [m], amplification) of one run, or why there is none."""
    drawn = FAMILIES[family](np.random.default_rng([number, 11]), number)
    if drawn is None:
        return "another outcome"
    system, until = drawn
    exact = attrs.evolve(system, integrator=Implicit(EXACT))
    own, best = attrs.evolve(system, integrator=Implicit(tolerance)), None
    if family == "fifty_bodies":
        found = ended_swarm(own, until)
    else:
        one = ended(own, until)
        found = None if one is None else (one.position[-1], one.error)
    if found is None or (best := ended(exact, until)) is None:
        return "did not end"
    (places, stated), there = found, best.position[-1]
    true = end_distance(system.bodies, places, there)
    if true < UNTOUCHED:
        return "nothing met"
    growth = exact.amplification(until, there, MOST_STEPS, nudge=NUDGE)
    return true, stated, growth


def judged(family, tolerance, runs, processes, seconds, first=0):
    """(runs that count as (true/stated, number, true, stated, amplification), amplified, not
    ended, the number after the last): the first of them from a number on, for any number of
    processes; fewer where time is up."""
    until = time.monotonic() + seconds
    shares, left, failed = [], 0, 0
    context = multiprocessing.get_context("spawn")
    with context.Pool(processes) as pool:
        results = pool.imap(
            partial(judge, family, tolerance), range(first, first + MOST_TRIED * runs)
        )
        for number, found in enumerate(results, first):
            if isinstance(found, str):
                failed += found == "did not end"
            elif not found[2] < MOST_AMPLIFIED:
                left += 1
            else:
                shares.append((found[0] / found[1], number, *found))
            if len(shares) == runs or time.monotonic() > until:
                break
        pool.terminate()
    return shares, left, failed, number + 1


def main():
    """Print the table."""
    families = {"nargs": "+", "choices": FAMILIES, "default": list(FAMILIES)}
    arguments = begin(
        __doc__, runs=2000, tolerance=1e-9, families=families, processes=1, first=0,
        seconds=math.inf, worst=0,
    )  # fmt: skip
    runs = 20 if arguments.quick else arguments.runs
    columns = ("family", "numbers", "runs", "amplified", "not ended", "covered [%]",
               "median true/stated", "99th percentile", "largest")  # fmt: skip
    table = Table(f"True error over stated error at {arguments.tolerance:g} m", columns)
    for family in arguments.families:
        shares, left, failed, following = judged(
            family, arguments.tolerance, runs, arguments.processes, arguments.seconds,
            arguments.first,
        )  # fmt: skip
        values = np.array([each[0] for each in shares])
        table.add(
            family, f"{arguments.first} to {following - 1}", len(shares), left, failed,
            100.0 * np.mean(values <= 1.0),
            float(np.median(values)), float(np.quantile(values, 0.99)), float(values.max()),
        )  # fmt: skip
        for each in sorted(shares, reverse=True)[: arguments.worst]:
            print(family, *(f"{value:.3g}" for value in each))
    table.print()


if __name__ == "__main__":
    main()
