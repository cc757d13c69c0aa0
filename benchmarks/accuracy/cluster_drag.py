"""The drag of clusters: against multiblobs of drawn clusters, how speed grows with size, its cost.

Clusters are drawn by halves that meet on straight paths in random orientations. Multiblobs: every
floc a prism of its outline, 4/3 r_eq deep; numbers are mobilities of clusters over the exact ones,
less 1, in the mean of all directions and of the two main ones.

    python -m benchmarks.accuracy.cluster_drag multiblobs
    python -m benchmarks.accuracy.cluster_drag law
    python -m benchmarks.accuracy.cluster_drag cost
"""

import argparse
import itertools
import math
import statistics
import time

import numpy as np

from benchmarks.reporting import Table, print_heading
from flocsim import Body, Fluid, Sphere, Swarm
from flocsim.forces import Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.hydrodynamics import rigid_bodies
from flocsim.hydrodynamics.rigid_bodies import mobilities

R = 5e-6
WATER = Fluid(buoyancy=True)
ALONE = 1.0 / (6.0 * math.pi)
COVERED = 60
"""Spheres of half of a floc's surface, about."""


def turned(places, angle):
    """Places (n, 2) turned about the origin."""
    c, s = math.cos(angle), math.sin(angle)
    return places @ np.array([[c, s], [-s, c]])


def joined(one, other, rng):
    """Two clusters of discs of radius 1 that have met on a straight path at random."""
    one = one - one.mean(axis=0)
    other = turned(other - other.mean(axis=0), rng.uniform(0.0, 2.0 * math.pi))
    reach = np.hypot(*one.T).max() + np.hypot(*other.T).max() + 2.0
    while True:
        one = turned(one, rng.uniform(0.0, 2.0 * math.pi))
        apart = one[:, None] - other
        across = apart[..., 1] - rng.uniform(-reach, reach)
        hits = np.abs(across) < 2.0
        if hits.any():
            way = np.max(apart[hits][:, 0] + np.sqrt(4.0 - across[hits] ** 2))
            offset = (apart[..., 1] - across)[0, 0]
            return np.concatenate([one, other + [way, offset]])


def cluster(count, rng):
    """Places (n, 2) of discs of radius 1 of one cluster."""
    if count == 1:
        return np.zeros((1, 2))
    return joined(cluster(count // 2, rng), cluster(count - count // 2, rng), rng)


def outline(rng):
    """A floc's outline, r_eq = 1, about its centroid."""
    turn = np.linspace(0.0, 2.0 * math.pi, 64, endpoint=False)
    modes = [(k, 0.35 * rng.normal() / k**1.2, rng.uniform(0.0, 7.0)) for k in range(2, 7)]
    radius = np.maximum(
        1.0 + sum(size * np.cos(k * turn + phase) for k, size, phase in modes), 0.35
    )
    ring = radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    from shapely import Polygon

    known = Polygon(ring)
    return (ring - np.array(known.centroid.coords[0])) / math.sqrt(known.area / math.pi)


def packed(rings, rng):
    """Flocs, as lists of outlines, of one cluster: halves that meet until they touch."""
    from shapely import Polygon, unary_union
    from shapely.affinity import translate

    if len(rings) == 1:
        return [turned(rings[0], rng.uniform(0.0, 2.0 * math.pi))]
    half = len(rings) // 2
    one, other = packed(rings[:half], rng), packed(rings[half:], rng)
    angle = rng.uniform(0.0, 2.0 * math.pi)
    middle = np.concatenate(other).mean(axis=0)
    other = [turned(ring - middle, angle) for ring in other]
    here, there = (unary_union([Polygon(ring) for ring in each]) for each in (one, other))
    reach = sum(np.hypot(*np.concatenate(each).T).max() for each in (one, other))
    while True:
        place, offset = 2.0 * reach, rng.uniform(-0.5, 0.5) * reach
        while place > -2.0 * reach:
            gap = here.distance(translate(there, place, offset))
            if gap < 1e-4:
                return one + [ring + [place, offset] for ring in other]
            place -= gap


def exact(rings, middle):
    """The mobility (2, 2) of a rigid cluster at its middle, by multiblobs of one spacing."""
    spacings = [
        math.sqrt((2.0 / 3.0 * np.hypot(*(np.roll(r, -1, 0) - r).T).sum() + math.pi) / COVERED)
        for r in rings
    ]
    places = np.concatenate([
        rigid_bodies.surface([ring - middle], 4.0 / 3.0, spacing)
        for ring, spacing in zip(rings, spacings, strict=True)
    ])  # fmt: skip
    loads = rigid_bodies.loads(places, rigid_bodies.RADIUS * float(np.mean(spacings)))
    return np.linalg.inv(loads[:, :3])[:2, :2] / ALONE


def by_sum(places, radii):
    """The same by flocsim's sum."""
    own = np.column_stack([ALONE / radii, 0.0 * radii, ALONE / radii])
    found = mobilities(np.zeros(len(radii), dtype=int), places, radii, own)
    xx, xy, yy = found[0] / ALONE
    return np.array([[xx, xy], [xy, yy]])


def multiblobs(draws):
    """Print how wrong the sum is for drawn clusters."""
    table = Table("Mobility of drawn clusters over that of multiblobs, less 1", (
        "flocs", "mean of directions", "slow direction", "fast direction", "largest",
    ))  # fmt: skip
    for count in (2, 3, 4, 8, 16, 32):
        wrong = []
        for draw in range(draws if count < 32 else 2):
            rng = np.random.default_rng([count, draw])
            rings = packed([outline(rng) for _ in range(count)], rng)
            centres = np.array([ring.mean(axis=0) for ring in rings])
            alone = np.array(
                [
                    2.0 / np.trace(exact([ring], centre))
                    for ring, centre in zip(rings, centres, strict=True)
                ]
            )
            there, found = exact(rings, centres.mean(axis=0)), by_sum(centres, alone)
            main = np.linalg.eigvalsh(found) / np.linalg.eigvalsh(there) - 1.0
            wrong.append([np.trace(found) / np.trace(there) - 1.0, *main])
        wrong = np.array(wrong)
        both = zip(wrong.mean(axis=0), wrong.std(axis=0), strict=True)
        table.add(count, *(f"{mean:+.3f} ± {spread:.3f}" for mean, spread in both),
                  float(np.abs(wrong).max()))  # fmt: skip
    table.print()


def law():
    """Print D of drawn clusters, and the power by which their speed grows with R_g."""
    columns = ("seed", "R_g/r", "D", "power of v", "power − (D − 1)")
    table = Table("Clusters of 16 to 512 discs: v ~ R_g^power", columns)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        sizes = [16, 32, 64, 128, 256, 512]
        drawn = [cluster(count, rng) for count in sizes for _ in range(6)]
        bodies, first = [], 0.0
        for places in drawn:
            places = 0.99999 * R * (places - places.min(axis=0))
            bodies += [Body(Sphere(R), (first + x, y), density=1100.0) for x, y in places.tolist()]
            first += np.ptp(places[:, 0]) + 10.0 * R
        forces = [Gravity(), StokesDrag(clusters=True), Contact()]
        run = Swarm(bodies, forces, fluid=WATER).run("0.5 ms")
        found = run.clusters(0, within=1e-9)
        # Of a body's first cluster to its last one: as they were drawn.
        speed = np.array([
            -run.velocity[-1, found.label == each, 1].mean() for each in range(len(found))
        ])  # fmt: skip
        count, size = found.size, found.gyration
        dimension = np.polyfit(np.log(size), np.log(count), 1)[0]
        power = np.polyfit(np.log(size), np.log(speed), 1)[0]
        table.add(
            seed, f"{size.min() / R:.1f} to {size.max() / R:.1f}",
            f"{dimension:.2f}", f"{power:.2f}", f"{power - (dimension - 1.0):+.2f}",
        )  # fmt: skip
    table.print()


def cost(number, duration, repeats):
    """Print the time of a swarm of clusters with their drag over that without, from one start."""
    rng = np.random.default_rng(1)
    bodies, first = [], 0.0
    for size in itertools.cycle([1, 2, 4, 8, 16, 32, 64, 128]):
        if len(bodies) >= number:
            break
        places = 0.99999 * R * cluster(size, rng)
        places -= places.min(axis=0) - [first, 0.0]
        # Unlike weights, so that clusters roll about with either drag.
        bodies += [
            Body(Sphere(R), tuple(place), density=rng.uniform(1050.0, 1150.0))
            for place in places.tolist()
        ]
        first = places[:, 0].max() + 6.0 * R
    columns = ("clusters", "CPU s", "windows", "steps of bodies", "largest", "CPU µs a step")
    table = Table(f"{len(bodies)} discs in clusters, {duration}", columns)
    times, steps = {False: [], True: []}, {}
    for repeat in range(repeats + 1):
        for clusters in (False, True):
            forces = [Gravity(), StokesDrag(clusters=clusters), VanDerWaals(cut=1e-6), Contact()]
            swarm = Swarm(bodies, forces, fluid=WATER)
            began = time.process_time()
            run = swarm.run(duration)
            if repeat:
                taken = time.process_time() - began
                times[clusters].append(taken)
                steps[clusters] = run.effort.body_steps
                largest = int(run.clusters().size.max())
                row = clusters, taken, run.effort.windows, steps[clusters], largest
                table.add(*row, 1e6 * taken / steps[clusters])
    table.print()
    without, with_them = (statistics.median(times[each]) / steps[each] for each in (False, True))
    print(f"CPU time of a step {with_them / without:.3f} times that without; "
          f"{steps[True] / steps[False]:.2f} times the steps")  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=["multiblobs", "law", "cost"])
    parser.add_argument("--draws", type=int, default=4)
    parser.add_argument("--number", type=int, default=1000)
    parser.add_argument("--duration", default="20 ms")
    parser.add_argument("--repeats", type=int, default=3)
    given = parser.parse_args()
    print_heading()
    if given.what == "multiblobs":
        multiblobs(given.draws)
    elif given.what == "law":
        law()
    else:
        cost(given.number, given.duration, given.repeats)


if __name__ == "__main__":
    main()
