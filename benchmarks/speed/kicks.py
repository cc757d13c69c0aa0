"""Kicks per second of one core: thermal motion, alone and of two bodies, by CPU time.

A kick is one body's: force and torque of one stretch of time, at whose end a step ends. A free
sphere without inertia, one with inertia at x = ζτ/m = 1, and two spheres that repel each other.
"""

import math
import time

from benchmarks.reporting import Table, begin
from flocsim import Body, Fluid, Sphere, System
from flocsim.forces import DoubleLayer, StokesDrag, Thermal
from flocsim.integrators import Implicit, Overdamped

WATER = Fluid(viscosity=0.89e-3)
RADIUS = 1e-6


def sphere(x=0.0):
    return Body(Sphere(RADIUS), (x, 0.0), density=1050.0)


def cases():
    """(what, System, how long its kicks are at most [s])."""
    relaxation = sphere().mass / (6.0 * math.pi * WATER.viscosity * RADIUS)
    layer = DoubleLayer(20e-3, 10e-9)

    def free(method, kick):
        return System([sphere()], [StokesDrag(), Thermal(kick=kick)], method, WATER)

    def pair(apart, **thermal):
        forces = [StokesDrag(), Thermal(**thermal), layer]
        bodies = [sphere(), sphere(2.0 * RADIUS + apart)]
        return System(bodies, forces, Overdamped(1e-9), WATER)

    yield "a free sphere, overdamped", free(Overdamped(1e-9), 1e-3), 1e-3
    yield "a free sphere with inertia, x = 1", free(Implicit(1e-9), relaxation), relaxation
    yield "two spheres that repel, kicks of 1 ms", pair(5e-6, kick=1e-3), 1e-3


def measured(system, kick, steps):
    """(steps taken, body kicks a second of CPU time): the second run, the code being compiled."""
    bodies = len(system.bodies)
    for budget in (100, steps):
        run = system.begin(math.inf, max_steps=budget)
        began = time.process_time()
        run.to_end()
        lasted = time.process_time() - began
    return run.steps, bodies * run.time / kick / lasted


def main():
    """Print the table."""
    arguments = begin(__doc__)
    steps = 50_000 if arguments.quick else 500_000
    table = Table("Kicks of one core", ("scene", "steps", "kicks a second"))
    for what, system, kick in cases():
        table.add(what, *measured(system, kick, steps))
    table.print()


if __name__ == "__main__":
    main()
