"""How long a scene takes to start: cold, warm, and after an edit of a force.

    python -m benchmarks.speed.compile_times [--quick] [--markdown] [--against COMMIT]

Each figure is of a process of its own that imports flocsim, makes two bodies with forces and takes
its first steps; cold ones start with an empty cache folder, all others with what the ones before
have compiled. ``--against`` starts the flocsim of another commit beside this one, each scene twice
and in both orders: the smaller CPU time counts. It also runs commands that compile nothing, each
six times, in turn: the least CPU time counts.
"""

import sys
import tempfile
from pathlib import Path

from benchmarks.reporting import ROOT, Table, begin, spent_by
from benchmarks.speed.against_commit import other_tree

SCRIPT = """
import attrs
import numpy as np
from flocsim import Body, Fluid, Sphere, SpheroPolygon, System, forces, integrators
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
system = System(bodies, laws, method, Fluid(buoyancy=True))
assert system.run(until=1e-6).status.name == "FINISHED"
"""
SWARM = """
import numpy as np
from flocsim import Body, Fluid, SpheroPolygon, Swarm, forces
outline = SpheroPolygon(1e-5 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), 1e-6)
bodies = [Body(outline, (k * 2e-5, 0.0), density=2650.0) for k in range(4)]
laws = [forces.Gravity(), forces.StokesDrag(), forces.Contact()]
assert Swarm(bodies, laws, fluid=Fluid(buoyancy=True)).run(1e-4).status.name == "FINISHED"
"""

METHODS = ("Implicit()", "DormandPrince54()")
FEW = ("Gravity()", "StokesDrag()", "Contact()")
ALL = (*FEW, "VanDerWaals()", "DoubleLayer()")
OTHERS = ("Gravity()", "Contact(friction=0.3)", "VanDerWaals(gap='surface')")


def script(spheres=False, method=METHODS[0], names=ALL, edit=None):
    """Return a program that starts a scene; ``edit`` puts a user's force in it, with that number in
    its kernel."""
    called = [f"forces.{name}" for name in names] + (["Brush()"] if edit is not None else [])
    return SCRIPT.format(spheres=spheres, method=method, edit=edit, forces=", ".join(called))


def start(cache, code, tree=ROOT, **variables):
    """Return what a process Spent that runs a program with the flocsim of a folder and a cache."""
    path = Path(cache) / "start.py"
    path.write_text(code)
    words = [sys.executable, path]
    return spent_by(words, cache, PYTHONPATH=str(tree), FLOCSIM_CACHE=cache, **variables)


def cold(code, tree=ROOT, **variables):
    """Return the same with nothing compiled before."""
    with tempfile.TemporaryDirectory() as cache:
        return start(cache, code, tree, **variables)


def starts(quick):
    """Return the table of cold and warm starts, and of starts after a change."""
    heads = ("scene", "method", "cold [s]", "CPU [s]", "warm [s]", "edited kernel [s]",
             "other forces [s]")  # fmt: skip
    table = Table("Start of a scene", heads)
    for method in METHODS[:1] if quick else METHODS:
        for name, spheres in (("two spheres", True), ("two polygons", False)):
            with tempfile.TemporaryDirectory() as cache:
                first = start(cache, script(spheres, method))
                warm = min(start(cache, script(spheres, method)).wall for _ in range(3))
                start(cache, script(spheres, method, edit=1.0))
                edits = (script(spheres, method, edit=2.0 + k) for k in range(3))
                edited = min(start(cache, code).wall for code in edits)
                others = start(cache, script(spheres, method, OTHERS)).wall
            table.add(name, method.split("(")[0], first.wall, first.cpu, warm, edited, others)
    return table


def cold_beside(there, commit):
    """Return the table of cold starts here and at another commit."""
    heads = ("scene", "CPU there [s]", "here [s]", "ratio", "memory there [MB]", "here [MB]")
    table = Table(f"Cold starts beside {commit}", heads)
    codes = {
        "two spheres": script(True, names=FEW), "two polygons": script(names=FEW),
        "a swarm of polygons": SWARM,
    }  # fmt: skip
    for name, code in codes.items():
        found = [cold(code, tree) for tree in (there, ROOT, ROOT, there)]
        old, new = (min(each, key=lambda run: run.cpu) for each in (found[::3], found[1:3]))
        table.add(name, old.cpu, new.cpu, new.cpu / old.cpu, old.memory, new.memory)
    return table


COMMANDS = (
    ["--help"],
    ["ensemble", "one.toml", "--overwrite", "--quiet"],
    ["info", "one.h5"],
)
"""What is run where everything is compiled; the second makes what the third reads."""

ONE = """
preset = "tang2014"
seed = 1
replicates = 1
[scene]
types = ["I"]
delta = [0.5]
[shapes]
source = "synthetic"
vertices = [16]
pool = 10
"""


def commands_beside(there, commit):
    """Return the table of commands that compile nothing, here and at another commit."""
    heads = ("flocsim …", "CPU there [s]", "here [s]", "ratio", "wall here [s]",
             "memory there [MB]", "here [MB]")  # fmt: skip
    table = Table(f"Commands that compile nothing beside {commit}", heads)
    with tempfile.TemporaryDirectory() as folder:
        places = {there: Path(folder) / "there", ROOT: Path(folder) / "here"}
        for place in places.values():
            place.mkdir()
            (place / "one.toml").write_text(ONE)
        for words in COMMANDS:
            found = {tree: [] for tree in places}
            for tree in 7 * [there, ROOT]:
                place = places[tree]
                found[tree].append(spent_by(
                    [sys.executable, "-m", "flocsim", *words], place, PYTHONPATH=str(tree),
                    FLOCSIM_CACHE=f"{place}/cache",
                ))  # fmt: skip
            # The first one compiles.
            old, new = (min(each[1:], key=lambda run: run.cpu) for each in found.values())
            table.add(words[0], old.cpu, new.cpu, new.cpu / old.cpu, new.wall, old.memory,
                      new.memory)  # fmt: skip
    return table


def main():
    """Print the tables."""
    arguments = begin(__doc__, against="")
    if not arguments.against:
        starts(arguments.quick).print()
        return
    with tempfile.TemporaryDirectory() as folder:
        there = other_tree(arguments.against, Path(folder))
        cold_beside(there, arguments.against).print()
        commands_beside(there, arguments.against).print()


if __name__ == "__main__":
    main()
