"""How long a scene takes to start: cold, and warm from the disk in a new process.

    python -m benchmarks.speed.compile_times [--markdown]

Each figure is of a process of its own that imports flocsim, makes two bodies with all five forces
and takes its first steps; cold ones start with an empty cache folder.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time

from benchmarks.reporting import Table, parse_arguments, print_heading

SCRIPT = """
import numpy as np
from flocsim import Body, Sphere, SpheroPolygon, System, forces, integrators
outline = SpheroPolygon(1e-5 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), 1e-6)
shape = Sphere(5e-6) if {spheres} else outline
bodies = [Body(shape, density=2650.0), Body(shape, (3e-6, 26e-6), density=2650.0)]
laws = [forces.Gravity(), forces.StokesDrag(), forces.Contact(), forces.VanDerWaals(),
        forces.DoubleLayer()]
method = integrators.{method}
assert System(bodies, laws, method).run(until=1e-6).status.name == "FINISHED"
"""

METHODS = ("Implicit()", "Overdamped()", "DormandPrince54()", "VelocityVerlet(1e-8)")


def start(spheres, method, cache):
    """(wall, CPU) time [s] of a process that starts a scene."""
    environment = {**os.environ, "FLOCSIM_CACHE": cache}
    code = SCRIPT.format(spheres=spheres, method=method)
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    """Print the table."""
    arguments = parse_arguments(__doc__)
    print_heading()
    table = Table("Start of a scene", ("scene", "method", "cold [s]", "CPU [s]", "warm [s]"))
    for method in METHODS[:1] if arguments.quick else METHODS:
        for name, spheres in (("two spheres", True), ("two polygons", False)):
            with tempfile.TemporaryDirectory() as cache:
                wall, cpu = start(spheres, method, cache)
                warm = min(start(spheres, method, cache)[0] for _ in range(3))
            table.add(name, method.split("(")[0], wall, cpu, warm)
    table.print(arguments.markdown)


if __name__ == "__main__":
    main()
