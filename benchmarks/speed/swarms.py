"""What a swarm costs: a body and step, flocs for 10 s, beds, pairs, threads, memory, Verlet.

    python -m benchmarks.speed.swarms [--quick] [--parts cost flocs bed pile pairs threads …]

Swarms are those of studies (`[scene] kind = "swarm"`, preset `si`, van der Waals cut at 1 um). CPU
time of this process, compiled code warm. ``--seconds``: CPU time of a run at most.
"""

import gc
import math
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.reporting import Table, begin
from flocsim import Body, Fluid, Sphere, SpheroPolygon, Swarm, System, floor
from flocsim.ensembles.config.loader import load_any_config
from flocsim.ensembles.swarms.study import SwarmStudy, run_briefly
from flocsim.forces import Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import Implicit, VelocityVerlet
from flocsim.integrators.base import Status
from flocsim.swarms.placement import place_at_random

STUDY = """\
preset = "si"
seed = 1
replicates = 1
[scene]
kind = "swarm"
number = {number}
area_fraction = {fraction}
radius = "5 um"
spread = 0.3
min_radius = "2.5 um"
duration = "{duration} s"
[shapes]
source = "library"
file = "synthetic"
vertices = [{vertices}]
[forces.van_der_waals]
cut = "1 um"
[forces.double_layer]
debye_length = "9.6 nm"
"""

WATER = Fluid(buoyancy=True)
SMALL, LARGE = 5e-6, 1.4
"""Radius of the smaller discs of a bed [m], and that of the larger ones over it."""

SAFE = 0.2
"""Verlet's step over 1/ω of the contact: at 2 it is unstable, at .2 its error is some percent."""


def swarm_of(number, fraction, vertices, duration=10.0):
    """The Swarm of replicate 0 of such a study."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "swarm.toml"
        text = STUDY.format(number=number, fraction=fraction, vertices=vertices, duration=duration)
        path.write_text(text, "utf-8")
        swarm, _ = SwarmStudy(load_any_config(path)).swarm(0)
    run_briefly(swarm)  # compiled
    return swarm


def run(swarm, until, threads=1, most=np.inf):
    """(CPU s, wall s, SwarmTrajectory) of a run that stops where ``most`` CPU seconds are spent."""
    began, wall = time.process_time(), time.perf_counter()
    found = swarm.run(until, threads=threads,
                      watch=lambda _: time.process_time() - began > most)  # fmt: skip
    return time.process_time() - began, time.perf_counter() - wall, found


def cost(arguments, table):
    """Microseconds for a body and an accepted step of its island, by number of bodies."""
    counts = (100, 1000) if arguments.quick else (100, 1000, 10_000)
    for name, fraction in (("dilute", 0.02), ("crowded", 0.2)):
        first = None
        for number in counts:
            swarm = swarm_of(number, fraction, 1)
            spent, _, found = run(swarm, 0.2, most=arguments.seconds)
            each = 1e6 * spent / found.effort.body_steps
            first = first or each
            table.add(name, number, found.t[-1], found.effort.windows, found.effort.body_steps,
                      each, each / first)  # fmt: skip


def flocs(arguments, table):
    """1,000 flocs of N = 16, area fraction .1, 10 s of settling."""
    number, until = (100, 1.0) if arguments.quick else (1000, 10.0)
    swarm = swarm_of(number, 0.1, 16)
    spent, wall, found = run(swarm, until, most=arguments.seconds)
    clusters = found.clusters()
    table.add(number, found.t[-1], spent, wall, found.effort.body_steps, len(clusters),
              clusters.mean_size, float(found.error[-1]), found.status.name)  # fmt: skip


def pairs(arguments, table):
    """Pairs far apart in one box: each against its run alone, in places and in time."""
    number, until = (100 if arguments.quick else 1000), 0.3
    bodies = [body for each in range(number) for body in lone_pair(each, number)]
    forces = [Gravity(), StokesDrag(), VanDerWaals(1e-19, gap="surface", cut=1e-6), Contact()]
    side = APART * math.ceil(math.sqrt(number))
    swarm = Swarm(bodies, forces, fluid=WATER, box=(side, side))
    systems = [System(bodies[k : k + 2], forces, fluid=WATER) for k in range(0, 2 * number, 2)]
    swarm.run(1e-4)
    systems[0].run(1e-4)
    _, wall, found = run(swarm, until)
    began = time.perf_counter()
    alone = [system.run(until, record=False) for system in systems]
    each = time.perf_counter() - began
    furthest, beyond = 0.0, 0
    for number_of, one in enumerate(alone):
        place = found.position[-1, 2 * number_of : 2 * number_of + 2]
        apart = float(np.hypot(*(place - one.position[-1])[:, :2].T).max())
        furthest = max(furthest, apart)
        beyond += apart > one.error + float(found.error[-1])
    met = len(found.neighbours().pairs)
    table.add(number, met, found.t[-1], furthest, float(found.error[-1]), beyond, wall, each,
              wall / each)  # fmt: skip


APART = 5e-4
"""Pairs lie so far apart [m]: they fall by less than that, and forces end at 1 um."""


def lone_pair(number, count):
    """Two flocs, the larger one above the other, of which some meet and some do not."""
    rng = np.random.default_rng([number, 5])
    column, row = divmod(number, math.ceil(math.sqrt(count)))
    radii = 5e-6 * rng.uniform([0.6, 1.2], [1.0, 1.8])
    aside, up = 5e-6 * rng.uniform(-2.5, 2.5), 1.1 * radii.sum()
    places = [(0.0, 0.0), (aside, up)]
    return [
        Body(Sphere(float(radius)), (APART * column + x, APART * row + y), density=2650.0)
        for radius, (x, y) in zip(radii, places, strict=True)
    ]


def bed_of(number, tolerance, seed=0, fraction=0.4):
    """Frictionless discs of 5 and 7 um, half of each, over a floor of √n discs' width, settling."""
    rng = np.random.default_rng(seed)
    radii = rng.permutation(np.where(np.arange(number) % 2 == 0, SMALL, LARGE * SMALL))
    width = 2.4 * SMALL * max(10.0, math.sqrt(number))
    height = math.pi * float(np.sum(radii**2)) / (fraction * width)
    shapes, water = [Sphere(float(radius)) for radius in radii], Fluid(buoyancy=True)
    places = place_at_random(shapes, (width, height), rng)
    excess = 2650.0 - water.density
    bodies = [floor(width, beyond=4.0 * SMALL)]
    for shape, (x, y, _) in zip(shapes, places.tolist(), strict=True):
        down = 2.0 / 9.0 * excess * 9.81 * shape.radius**2 / water.viscosity
        bodies.append(Body(shape, (x, y + 3.0 * SMALL), 0.0, (0.0, -down), density=2650.0))
    forces = [Gravity(), StokesDrag(), Contact(k_t=0.0)]
    return Swarm(bodies, forces, Implicit(tolerance=tolerance), water, box=(width, None))


def bulk_fraction(position, radii, width, low):
    """Area fraction of discs between a height and that of four fifths of their centres."""
    high, total = float(np.quantile(position[:, 1], 0.8)), 0.0
    for y, radius in zip(position[:, 1], radii, strict=True):
        part = np.clip([(low - y) / radius, (high - y) / radius], -1.0, 1.0)
        area = np.arcsin(part) + part * np.sqrt(1.0 - part**2)
        total += float(radius**2 * (area[1] - area[0]))
    return total / (width * (high - low))


def bed(arguments, table):
    """Bidisperse discs settle to a bed, and rest."""
    for number in (100,) if arguments.quick else (100, 1000):
        swarm = bed_of(number, 1e-8)
        until = 6.0 * math.sqrt(number / 100.0)
        spent, _, found = run(swarm, until, most=arguments.seconds)
        radii = np.array([body.shape.radius for body in swarm.bodies[1:]])
        fraction = bulk_fraction(found.position[-1, 1:], radii, swarm.box[0], 3.0 * SMALL)
        effort = found.effort
        speed = float(np.hypot(*found.velocity[-1, 1:, :2].T).max())
        table.add(number, float(found.t[-1]), spent, effort.body_steps,
                  1e6 * spent / effort.body_steps, speed, fraction, found.status.name)  # fmt: skip


SPHERORADIUS, POLYGON = 0.08, 6e-6
"""Of the polygons of a pile: spheroradius over radius, and mean radius [m]."""


def rough_polygon(count, radius, rng, rough=0.4):
    """Return a star-shaped polygon of so many vertices, their distances from the centre within a
    fraction ``rough`` of the radius [m]."""
    angles = 2.0 * np.pi * np.arange(count) / count
    reach = radius * (1.0 + rough * rng.uniform(-1.0, 1.0, count))
    points = np.column_stack([reach * np.cos(angles), reach * np.sin(angles)])
    return SpheroPolygon(points, radius=SPHERORADIUS * radius)


def pile_of(number, friction, attraction, tolerance, seed=0):
    """Return a Swarm of polygons above a periodic floor, with an attraction or without."""
    rng = np.random.default_rng(seed)
    shapes = [
        rough_polygon(10, POLYGON * math.exp(0.25 * rng.normal()), rng) for _ in range(number)
    ]
    widest = 2.0 * max(shape.bounding_radius for shape in shapes)
    width = widest * max(4.0, 0.5 * math.sqrt(number))
    height = max(sum(shape.area for shape in shapes) / (0.3 * width), 3.0 * widest)
    places = place_at_random(shapes, (width, height), rng, (True, False))
    bodies = [
        Body(shape, (x, y), angle=angle, density=2650.0)
        for shape, (x, y, angle) in zip(shapes, places.tolist(), strict=True)
    ]
    forces = [Gravity(), StokesDrag(), Contact(friction=friction)]
    if attraction:
        forces.append(VanDerWaals(hamaker=4.7e-20, gap="surface", cut=1e-6))
    bottom = floor(width, beyond=widest)
    return Swarm([bottom, *bodies], forces, Implicit(tolerance), WATER, box=(width, None))


def pile(arguments, table):
    """Polygons settle on a floor and rest, by friction, with attraction and without."""
    few = 10 if arguments.quick else 50
    for friction in ("none", 0.0, 0.01, 0.4):
        for attraction in (True, False):
            swarm = pile_of(few, friction, attraction, 1e-9)
            spent, _, found = run(swarm, 3.0, most=arguments.seconds)
            speed = float(np.hypot(*found.velocity[-1, 1:, :2].T).max())
            table.add(few, friction, "with" if attraction else "without", float(found.t[-1]),
                      spent, found.effort.steps, speed, found.status.name)  # fmt: skip


def threads(arguments, table):
    """Wall time of one thread over that of two, and whether the bytes are the same."""
    swarm = swarm_of(1000, 0.02, 1)
    until = 1.0 if arguments.quick else 10.0
    _, one, first = run(swarm, until)
    _, two, second = run(swarm, until, threads=2)
    same = first.position.tobytes() == second.position.tobytes()
    table.add(len(swarm.bodies), one, two, one / two, "same" if same else "OTHER")


def verlet(arguments, table):
    """Velocity Verlet at its largest useful step, extrapolated from a stated piece."""
    swarm = swarm_of(100, 0.1, 16)
    spent, _, found = run(swarm, 1.0, most=arguments.seconds)
    pieces = swarm.system.pieces
    contact = next(force for force in pieces.used.values() if hasattr(force, "k_n"))
    lightest = min(body.mass for body in swarm.bodies)
    step = SAFE / np.sqrt(2.0 * contact.k_n / lightest)
    system = System(swarm.bodies, swarm.forces, VelocityVerlet(step), swarm.fluid)
    system.run(10 * step, record=False)
    steps = 200 if arguments.quick else 2000
    began = time.process_time()
    done = system.run(steps * step, max_steps=10 * steps, record=False)
    piece = time.process_time() - began
    assert done.status == Status.FINISHED, done.status
    whole = piece * found.t[-1] / (steps * step)
    table.add(len(swarm.bodies), found.t[-1], spent, step, steps, whole, whole / spent)


def resident():
    """Memory of this process now [bytes], not the most that it has had."""
    with Path("/proc/self/statm").open(encoding="ascii") as file:
        return 4096 * int(file.read().split()[1])


def bytes_of(arrays):
    """Bytes of the arrays of a tuple, and of tuples in it."""
    return sum(each.nbytes if isinstance(each, np.ndarray) else bytes_of(each)
               for each in arrays if isinstance(each, np.ndarray | tuple))  # fmt: skip


def memory(arguments, table):
    """Kilobytes a body: of the arrays of a swarm and of its islands, of what the process grows."""
    number = 2000 if arguments.quick else 10_000
    for fraction in (0.05, 0.3):
        swarm = swarm_of(number, fraction, 16)
        gc.collect()
        before = resident()
        progress = swarm.begin(1.0)
        for _ in range(3):
            progress.advance(1.0)
        whole = bytes_of(progress.swarm)
        islands = sum(bytes_of((place.scene, place.work, place.observed))
                      for own in progress.runner.threads
                      for place in own.by_size.values())  # fmt: skip
        largest = max(max(own.by_size) for own in progress.runner.threads)
        grown = resident() - before
        table.add(number, fraction, largest, 1e-3 * whole / number, 1e-3 * islands / number,
                  1e-3 * grown / number)  # fmt: skip


TABLES = {
    "cost": (cost, "Discs with contact, van der Waals and double layer", (
        "scene", "bodies", "time [s]", "windows", "body steps", "us/body step", "over n = 100")),
    "flocs": (flocs, "Flocs of N = 16, area fraction .1", (
        "bodies", "time [s]", "CPU [s]", "wall [s]", "body steps", "clusters", "mean size",
        "stated error [m]", "ended")),
    "pairs": (pairs, "Pairs of discs far apart in one box, and each by itself", (
        "pairs", "touching", "time [s]", "largest distance [m]", "stated error [m]",
        "beyond both errors", "box [s]", "alone [s]", "box/alone")),
    "threads": (threads, "Two threads, dilute discs", (
        "bodies", "one [s]", "two [s]", "ratio", "bytes")),
    "verlet": (verlet, "Velocity Verlet, extrapolated", (
        "bodies", "time [s]", "implicit [s]", "step [s]", "steps run", "Verlet [s]", "ratio")),
    "bed": (bed, "Frictionless discs of 5 and 7 um settle, tolerance 10 nm", (
        "bodies", "time [s]", "CPU [s]", "body steps", "us/body step", "fastest [m/s]",
        "bulk fraction", "ended")),
    "pile": (pile, "Polygons settle on a floor and rest", (
        "polygons", "friction", "attraction", "time [s]", "CPU [s]", "steps", "fastest [m/s]",
        "ended")),
    "memory": (memory, "Memory of flocs of N = 16", (
        "bodies", "area fraction", "largest island", "swarm [kB a body]", "islands [kB a body]",
        "process [kB a body]")),
}  # fmt: skip


def main():
    """Print the tables."""
    parts = {"nargs": "+", "choices": TABLES, "default": list(TABLES)}
    arguments = begin(__doc__, parts=parts, seconds=900.0, used="one used but for threads")
    for part in arguments.parts:
        measure, title, columns = TABLES[part]
        table = Table(title, columns)
        measure(arguments, table)
        table.print()


if __name__ == "__main__":
    main()
