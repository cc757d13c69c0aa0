"""How long a scene takes to start: cold, warm, and after an edit of a force.

    python -m benchmarks.speed.compile_times [--quick] [--markdown] [--private] [--against COMMIT]

Each figure is of a process of its own that imports flocsim, makes two bodies with forces and takes
its first steps; cold ones start with an empty cache folder, all others with what the ones before
have compiled. ``--private`` also tells what a cold start costs without each private part of numba
that flocsim leans on (flocsim.compiler.numba_internals); ``--against`` starts the flocsim of
another commit beside this one, each scene twice and in both orders: the smaller CPU time counts.
It also runs commands that compile nothing, each six times, in turn: the least CPU time counts.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.reporting import ROOT, Table, parse_arguments, print_heading
from benchmarks.speed.against_commit import other_tree

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

STARTS = {
    "two spheres": SCRIPT.format(
        spheres=True, edit=None, method="Implicit()",
        forces="forces.Gravity(), forces.StokesDrag(), forces.Contact()",
    ),
    "two polygons": SCRIPT.format(
        spheres=False, edit=None, method="Implicit()",
        forces="forces.Gravity(), forces.StokesDrag(), forces.Contact()",
    ),
    "a swarm of polygons": """
import numpy as np
from flocsim import Body, SpheroPolygon, Swarm, forces
outline = SpheroPolygon(1e-5 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), 1e-6)
bodies = [Body(outline, (k * 2e-5, 0.0), density=2650.0) for k in range(4)]
laws = [forces.Gravity(), forces.StokesDrag(), forces.Contact()]
assert Swarm(bodies, laws).run(1e-4).status.name == "FINISHED"
""",
}  # fmt: skip
"""What is started beside another commit."""

METHODS = ("Implicit()", "Overdamped()", "DormandPrince54()", "VelocityVerlet(1e-8)")
ALL = ("Gravity()", "StokesDrag()", "Contact()", "VanDerWaals()", "DoubleLayer()")
OTHERS = ("Gravity()", "Contact(friction=0.3)", "VanDerWaals(gap='surface')")
PRIVATE = ("compilers", "typed_once", "quick_typing")


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


def started(tree, code, cache):
    """(CPU time [s], memory at most [MB]) of a process that starts a scene with the flocsim of a
    folder, with what a cache folder has of compiled code."""
    told = "\nimport resource\nfound = resource.getrusage(resource.RUSAGE_SELF)\n"
    told += "print(found.ru_utime + found.ru_stime, found.ru_maxrss / 1024)"
    script = Path(cache) / "start.py"
    script.write_text(code + told)
    environment = {**os.environ, "PYTHONPATH": str(tree), "FLOCSIM_CACHE": cache}
    found = subprocess.run(
        [sys.executable, script], check=True, env=environment, cwd=cache,
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    return tuple(map(float, found.stdout.split()))


def started_anew(tree, code):
    """The same with nothing compiled before."""
    with tempfile.TemporaryDirectory() as cache:
        return started(tree, code, cache)


def started_in_turn(tree):
    """The same of all scenes, one behind the other, with what those before have compiled."""
    with tempfile.TemporaryDirectory() as cache:
        return [started(tree, code, cache) for code in STARTS.values()]


def beside(commit):
    """The table of cold starts here and at another commit, each scene with nothing compiled before
    and then behind the others."""
    heads = ("scene", "CPU there [s]", "here [s]", "ratio", "memory there [MB]", "here [MB]")
    table = Table(f"Cold starts beside {commit}", heads)
    with tempfile.TemporaryDirectory() as folder:
        there = other_tree(commit, Path(folder))
        for name, code in STARTS.items():
            order = (there, ROOT, ROOT, there)
            found = [started_anew(tree, code) for tree in order]
            (old, old_memory), (new, new_memory) = min(found[::3]), min(found[1:3])
            table.add(name, old, new, new / old, old_memory, new_memory)
        in_turn = zip(STARTS, *map(started_in_turn, (there, ROOT)), strict=True)
        for name, (old, old_memory), (new, new_memory) in list(in_turn)[1:]:
            label = f"{name}, behind those above"
            table.add(label, old, new, new / old, old_memory, new_memory)
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


def commanded(tree, words, folder):
    """(CPU time [s], wall time [s], memory at most [MB]) of a command of the flocsim of a tree."""
    environment = {**os.environ, "PYTHONPATH": str(tree), "FLOCSIM_CACHE": f"{folder}/cache"}
    began = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "flocsim", *words], env=environment, cwd=folder,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    _, status, found = os.wait4(process.pid, 0)
    assert status == 0, words
    wall = time.perf_counter() - began
    return found.ru_utime + found.ru_stime, wall, found.ru_maxrss / 1024


def warm_commands(commit):
    """The table of commands that compile nothing, here and at another commit."""
    heads = ("flocsim …", "CPU there [s]", "here [s]", "ratio", "wall here [s]",
             "memory there [MB]", "here [MB]")  # fmt: skip
    table = Table(f"Commands that compile nothing beside {commit}", heads)
    with tempfile.TemporaryDirectory() as folder:
        there = other_tree(commit, Path(folder))
        places = {tree: Path(folder) / name for tree, name in ((there, "there"), (ROOT, "here"))}
        for place in places.values():
            place.mkdir()
            (place / "one.toml").write_text(ONE)
        for words in COMMANDS:
            found = {tree: [] for tree in places}
            for tree in 7 * [there, ROOT]:
                found[tree].append(commanded(tree, words, places[tree]))
            # The first one compiles.
            old, new = (np.array(each[1:]).min(axis=0) for each in found.values())
            table.add(" ".join(words[:1]), old[0], new[0], new[0] / old[0], new[1], old[2], new[2])
    return table


def main():
    """Print the tables."""
    more = {"action": "store_true", "help": "tell what each private part of numba saves, too"}
    other = {"metavar": "COMMIT", "help": "start the flocsim of another commit beside this one"}
    arguments = parse_arguments(__doc__, private=more, against=other)
    print_heading()
    if arguments.against:
        beside(arguments.against).print(arguments.markdown)
        warm_commands(arguments.against).print(arguments.markdown)
        return
    starts(arguments.quick).print(arguments.markdown)
    if arguments.private:
        private_parts().print(arguments.markdown)


if __name__ == "__main__":
    main()
