"""Rigid-body engines (pymunk, Box2D) beside flocsim's implicit and explicit methods.

    python -m benchmarks.peers.rigid_engines [--quick] [--markdown]

Four scenes: a collision, a rolling disc, an elastic gas and a pile. CPU time of this process for
the steps alone, compiled code warm. The engines' steps are calls from Python, as their users make
them. "over Implicit": over the cheapest run of Implicit with an error no larger, "-" where there is
none. Contacts are rigid in the engines and springs in flocsim, so each of its runs has a stiffness
k: the softer, the cheaper for explicit methods, and the larger the error.
"""

import importlib
import math
import time
import warnings
from functools import partial

import numpy as np

from benchmarks.peers import rigid_scenes
from benchmarks.reporting import Table, begin
from flocsim import Swarm, System
from flocsim.integrators import DormandPrince54, Implicit, Status, VelocityVerlet
from flocsim.state.work import NOW, motion_of

LEVEL = 1.1
"""Ratio of CPU times up to which two methods count as equally fast: timings vary so much."""

LIMIT = 150.0
"""CPU seconds after which a run is given up, at its next time."""

SHORT, MOST_RUNS = 0.05, 5
"""A run is repeated up to so many CPU seconds in all, and so often at most."""


class UnfinishedError(Exception):
    """A run ended early; its message says why."""


class FlocsimWorld:
    """A System or Swarm with a scene's bodies."""

    def __init__(self, scene, kind, integrator, stiffness):
        system = kind(scene.bodies, scene.forces(stiffness), integrator)
        self.run = system.begin(scene.times[-1], max_steps=10**9)
        self.is_swarm = kind is Swarm

    def advance(self, until):
        """Advance to a time [s]."""
        status = Status.PAUSED
        if not self.is_swarm:
            self.run.clock.until = until
        while status == Status.PAUSED:
            status = self.run.advance(until) if self.is_swarm else self.run.advance()
        if status != Status.FINISHED:
            raise UnfinishedError(status.name)

    def motion(self):
        """Return x, y, angle, vx, vy, spin of all bodies, (n, 6)."""
        return self.run.swarm.motion.copy() if self.is_swarm else motion_of(self.run.work, NOW)


def adaptive(method, cases, kind=System):
    """Return (name, setting, world) of an adaptive method at (stiffness, tolerance) each."""
    name = method.__name__ + (", Swarm" if kind is Swarm else "")
    for k, tolerance in cases:
        integrator = method(tolerance, first_step=1e-3)
        yield (name, f"k = {k:.0e} N/m, {tolerance:.0e} m",
               partial(FlocsimWorld, kind=kind, integrator=integrator, stiffness=k))  # fmt: skip


def verlet(scene, cases):
    """Return the same of VelocityVerlet at (stiffness, step over √(m/k) of the lightest body)."""
    mass = min(body.mass for body in scene.bodies if not body.fixed)
    for k, fraction in cases:
        step = fraction * math.sqrt(mass / k)
        integrator = VelocityVerlet(step)
        yield ("VelocityVerlet", f"k = {k:.0e} N/m, {step:.0e} s",
               partial(FlocsimWorld, kind=System, integrator=integrator, stiffness=k))  # fmt: skip


def installed_engines():
    """Yield the modules of the engines that are installed; say which are not."""
    for name in ("pymunk_peer", "box2d_peer"):
        try:
            yield importlib.import_module(f"benchmarks.peers.{name}")
        except ImportError as error:
            print(f"{error.name} is not installed: pip install '.[bench]'\n")


def run(make, scene):
    """Return CPU seconds and motions up to each time, of the fastest of several short runs."""
    best, runs, total = None, 0, 0.0
    while runs < MOST_RUNS and total < SHORT:
        world, spent, motions, cpu = make(scene), [], [], 0.0
        for until in scene.times:
            began = time.process_time()
            world.advance(until)
            cpu += time.process_time() - began
            spent.append(cpu)
            motions.append(world.motion())
            if cpu > LIMIT:
                raise UnfinishedError(f"{cpu:.0f} s for {until:.2f} s")
        best = spent if best is None else min(best, spent, key=lambda each: each[-1])
        runs, total = runs + 1, total + cpu
    return best, motions


def cheapest(found, error, name=""):
    """Return the (CPU time, method, setting) of least CPU time within an error, None without."""
    good = [each[1:] for each in found if each[0] <= error and each[2].startswith(name)]
    return min(good, default=None)


def compare(scenes, methods, leaders, small=None):
    """Print a table of one scene, or of variants of it, and add its leaders.

    Of variants: mean CPU time, largest error. ``small`` runs first, so that all is compiled.
    """
    scene, found = scenes[0], []
    title = f"{scene.name}, largest error of {len(scenes)}" if len(scenes) > 1 else scene.name
    table = Table(title, ("method", "setting", "CPU [ms]", "over Implicit", *scene.columns))
    for name, setting, make in methods:
        try:
            run(make, small or scene)
            judged = [each.judge(each, *run(make, each)) for each in scenes]
        except UnfinishedError as early:
            table.add(name, setting, str(early), *["-"] * (1 + len(scene.columns)))
            continue
        cpu = float(np.mean([each[0] for each in judged]))
        error, *cells = max(each[1:] for each in judged)
        found.append((error if cpu < math.inf else math.inf, cpu, name, setting))
        own = cheapest(found, error, "Implicit")
        over = f"{cpu / own[0]:.2g} x" if own and cpu < math.inf else "-"
        spent = 1e3 * cpu if cpu < math.inf else "-"
        table.add(name, setting, spent, over, f"{error:.1e}", *cells)
    table.print()
    for goal in scene.goals:
        best, own = cheapest(found, goal), cheapest(found, goal, "Implicit")
        if own is None:
            continue
        ratio = own[0] / best[0]
        rank = "level" if ratio < LEVEL else f"{ratio:.2g} x slower"
        leaders.add(scene.name, f"{scene.columns[0]} <= {goal:g}", *best[1:], 1e3 * best[0],
                    1e3 * own[0], "leads" if best == own else rank)  # fmt: skip


def main():
    """Print the tables."""
    quick = begin(__doc__, packages=("pymunk", "box2d")).quick
    warnings.simplefilter("ignore")  # of bodies of metres without water
    engines = list(installed_engines())
    leaders = Table("Who leads", ("scene", "within", "leader", "setting", "CPU [ms]",
                                  "Implicit [ms]", "Implicit"))  # fmt: skip

    def by_step(*rates):
        """Yield each engine at each number of steps per second."""
        for engine in engines:
            for rate in rates:
                yield engine.NAME, f"1/{rate} s", partial(engine.World, step=1.0 / rate)

    rates = (60, 240, 1000, 10_000)
    # Stiffnesses [N/m] with tolerances [m], or with Verlet's steps over √(m/k).
    delays = np.random.default_rng(0).uniform(0.0, 1.0 / 60.0, 4 if quick else 8)
    scenes = [rigid_scenes.collision(delay) for delay in delays]
    cases = [(1e14, 1e-2), (1e14, 1e-4), (1e16, 1e-9)]
    compare(scenes, [
        *adaptive(Implicit, cases), *adaptive(DormandPrince54, cases),
        *verlet(scenes[0], [(1e6, 0.02), (1e8, 0.01)]), *by_step(*rates),
    ], leaders)  # fmt: skip
    scene = rigid_scenes.incline()
    compare([scene], [
        *adaptive(Implicit, [(1e6, 1e-3), (1e10, 1e-6)]),
        *adaptive(DormandPrince54, [(1e6, 1e-5), (1e8, 1e-5)]),
        *verlet(scene, [(1e4, 0.05), (1e6, 0.05)]), *by_step(*rates),
    ], leaders)  # fmt: skip
    scene = rigid_scenes.gas(20, 0.5) if quick else rigid_scenes.gas(100, 2.0)
    cases = [(1e8, 1e-3), (1e8, 1e-6)]
    compare([scene], [
        *adaptive(Implicit, cases[1:]), *adaptive(Implicit, cases, Swarm),
        *adaptive(DormandPrince54, cases[1:]),
        *verlet(scene, [(1e6, 0.05)]), *by_step(*rates),
    ], leaders, rigid_scenes.gas(12, 0.2))  # fmt: skip
    scene = rigid_scenes.pile(12, 3.0) if quick else rigid_scenes.pile(100, 4.0)
    cases = [(1e4, 1e-3)] if quick else [(1e4, 1e-3), (1e5, 1e-3)]
    compare([scene], [
        *adaptive(Implicit, cases), *verlet(scene, [(k, 0.05) for k, _ in cases]),
        *by_step(*rates),
    ], leaders, rigid_scenes.pile(12, 1.5))  # fmt: skip
    leaders.print()


if __name__ == "__main__":
    main()
