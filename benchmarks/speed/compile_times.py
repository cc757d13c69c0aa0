"""How long a scene takes to start: cold, warm, and after an edit of a force.

    python -m benchmarks.speed.compile_times [--quick] [--markdown] [--private]

Each figure is of a process of its own that imports flocsim, makes two bodies with forces and takes
its first steps; cold ones start with an empty cache folder, all others with what the ones before
have compiled. ``--private`` also tells what a cold start costs without each private part of numba
that flocsim leans on (flocsim.compiler.numba_internals).
"""

import os
import resource
import subprocess
import sys
import tempfile
import time

from benchmarks.reporting import Table, parse_arguments, print_heading

SCRIPT = """
import attrs
import numpy as np
from flocsim import Body, Sphere, SpheroPolygon, System, forces, integrators
outline = SpheroPolygon(1e-5 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), 1e-6)
shape = Sphere(5e-6) if {spheres} else outline
bodies = [Body(shape, density=2650.0), Body(shape, (3e-6, 26e-6), density=2650.0)]

@attrs.frozen
class Brush(forces.CentreForce):
    reach = 1e-7

    @staticmethod
    def kernel(pair, reach):
        return {edit} * (reach - pair.gap)

laws = [{forces}]
method = integrators.{method}
assert System(bodies, laws, method).run(until=1e-6).status.name == "FINISHED"
"""

METHODS = ("Implicit()", "Overdamped()", "DormandPrince54()", "VelocityVerlet(1e-8)")
ALL = ("Gravity()", "StokesDrag()", "Contact()", "VanDerWaals()", "DoubleLayer()")
OTHERS = ("Gravity()", "Contact(friction=0.3)", "VanDerWaals(gap='surface')")
PRIVATE = ("inner_compiler", "typed_once", "quick_typing")


def start(cache, spheres=False, method=METHODS[0], names=ALL, edit=None, without=""):
    """(wall, CPU) time [s] of a process that starts a scene; ``edit`` puts a user's force in it,
    with that number in its kernel."""
    environment = {**os.environ, "FLOCSIM_CACHE": cache, "FLOCSIM_COMPILE_WITHOUT": without}
    called = [f"forces.{name}" for name in names] + (["Brush()"] if edit is not None else [])
    code = SCRIPT.format(spheres=spheres, method=method, edit=edit, forces=", ".join(called))
    with tempfile.NamedTemporaryFile("w", suffix=".py") as script:
        script.write(code)
        script.flush()
        before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run([sys.executable, script.name], check=True, env=environment)
        wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def starts(quick):
    """The table of cold and warm starts, and of starts after a change."""
    heads = ("scene", "method", "cold [s]", "CPU [s]", "warm [s]", "edited kernel [s]",
             "other forces [s]")  # fmt: skip
    table = Table("Start of a scene", heads)
    for method in METHODS[:1] if quick else METHODS:
        for name, spheres in (("two spheres", True), ("two polygons", False)):
            with tempfile.TemporaryDirectory() as cache:
                wall, cpu = start(cache, spheres, method)
                warm = min(start(cache, spheres, method)[0] for _ in range(3))
                start(cache, spheres, method, edit=1.0)
                edited = min(start(cache, spheres, method, edit=2.0 + k)[0] for k in range(3))
                others, _ = start(cache, spheres, method, OTHERS)
            table.add(name, method.split("(")[0], wall, cpu, warm, edited, others)
    return table


def private_parts():
    """The table of what each private part of numba saves."""
    table = Table("Cold start of two polygons without …", ("left out", "CPU [s]", "ratio"))
    with tempfile.TemporaryDirectory() as cache:
        _, usual = start(cache)
    table.add("nothing", usual, 1.0)
    for without in (*PRIVATE, ",".join(PRIVATE)):
        with tempfile.TemporaryDirectory() as cache:
            _, cpu = start(cache, without=without)
        table.add(without.replace(",", ", "), cpu, cpu / usual)
    return table


def main():
    """Print the tables."""
    more = {"action": "store_true", "help": "tell what each private part of numba saves, too"}
    arguments = parse_arguments(__doc__, private=more)
    print_heading()
    starts(arguments.quick).print(arguments.markdown)
    if arguments.private:
        private_parts().print(arguments.markdown)


if __name__ == "__main__":
    main()
