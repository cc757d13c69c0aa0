"""Whether flocs collide several at a time as they do in pairs: swarms, and their pairs alone.

    python examples/tang2014/several.py [--swarms 12] [-o DIR]

Flocs of the preset settle in periodic boxes. Wherever two of them touch for the first time, they
are also run alone, from the last places and velocities before that touch, and looked at again when
a binary collision is over: do they still touch, in the swarm and alone, and has a third floc
touched either of them in the meantime? Writes several.csv, which claim 26 is judged by.
"""

import argparse
from pathlib import Path

import attrs
import numpy as np
from output import write_table

from flocsim.ensembles.config.loader import load_any_config
from flocsim.ensembles.swarms.study import SwarmStudy
from flocsim.swarms.swarm import Swarm

SWARM = Path(__file__).resolve().parent / "swarm.toml"
LASTS = 10e-3
"""How long a binary collision of the preset takes from its first touch to its decision [s], the
median of N = 8, delta = .95; the slowest twentieth takes 40 ms."""
FRACTIONS = 0.01, 0.04
HEADS = ("area fraction", "swarm", "time [s]", "i", "j", "third", "together", "alone")


def pairs_at(trajectory, at):
    """The pairs that touch at a time of a SwarmTrajectory."""
    return {tuple(sorted(pair)) for pair in trajectory.neighbours(at).pairs.tolist()}


def first_touches(touching):
    """(place of the time, pair) of all first touches but those of the start."""
    known = set(touching[0])
    for at, pairs in enumerate(touching):
        yield from ((at, pair) for pair in sorted(pairs - known))
        known |= pairs


def alone(swarm, trajectory, at, pair, steps):
    """Whether two bodies still touch so many times later that are run alone from one time before
    their touch, the later one at its image nearest to the other."""
    near = trajectory.neighbours(at)
    place = [tuple(sorted(each)) for each in near.pairs.tolist()].index(pair)
    later, earlier = near.pairs[place]
    vector = near.vector[place]
    shift = vector - (trajectory.position[at, later, :2] - trajectory.position[at, earlier, :2])
    bodies = []
    for body, moved in ((earlier, 0.0), (later, shift)):
        x, y, angle = trajectory.position[at - 1, body]
        velocity = trajectory.velocity[at - 1, body]
        bodies.append(attrs.evolve(
            swarm.bodies[body], position=np.add((x, y), moved), angle=angle,
            velocity=tuple(velocity[:2]), spin=velocity[2],
        ))  # fmt: skip
    pair_of = Swarm(bodies, swarm.system.forces, swarm.integrator, swarm.fluid)
    found = pair_of.run(float(trajectory.t[at + steps] - trajectory.t[at - 1]))
    return bool(len(found.neighbours().pairs))


def rows_of(study, replicate):
    """A row for each first touch in a swarm that is followed to the end of a binary collision."""
    swarm, _ = study.swarm(replicate)
    every = study.scene.interval
    trajectory = swarm.run(study.scene.duration, every=every)
    touching = [pairs_at(trajectory, at) for at in range(len(trajectory.t))]
    steps = round(LASTS / every)
    for at, pair in first_touches(touching):
        if at + steps >= len(touching):
            break
        meanwhile = set().union(*touching[at - 1 : at + steps + 1]) - {pair}
        third = any(set(pair) & set(other) for other in meanwhile)
        yield (
            study.scene.area_fraction, replicate, f"{trajectory.t[at]:.4f}", *pair, int(third),
            int(pair in touching[at + steps]), int(alone(swarm, trajectory, at, pair, steps)),
        )  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--swarms", type=int, default=12, metavar="N", help="default: %(default)s")
    parser.add_argument("-o", "--output", type=Path, default=Path("tang2014"), metavar="DIR")
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    rows = [HEADS]
    for fraction in FRACTIONS:
        scene = {"scene": {"area_fraction": fraction}}
        study = SwarmStudy(load_any_config(SWARM, scene))
        for replicate in range(arguments.swarms):
            rows += rows_of(study, replicate)
            print(f"area fraction {fraction:g}, swarm {replicate}: {len(rows) - 1} collisions")
    write_table(arguments.output / "several.csv", rows)


if __name__ == "__main__":
    main()
