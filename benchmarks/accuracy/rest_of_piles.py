"""What a rest costs: piles that have nothing left to do, and polygons pressed by strong gravity.

    python -m benchmarks.accuracy.rest_of_piles [--parts discs pile attraction pressed]
                                                [--seconds 20] [--scenes 96]

``discs``: heaps of discs at rest, with friction and without, by each way of leaving it out.
``pile``: polygons settle on a floor, stick or slide, and rest. ``attraction``: the steps that a
pile takes without attraction over those with it, by friction. ``pressed``: two to six polygons with
friction and without tension, pressed onto a floor, or each other in a cup, by 290 to 31,000 m/s².
Each scene has a budget of CPU time, so that the table ends whatever the engine does; one over it
says how far it came.
"""

import math
import warnings
from collections import Counter
from functools import partial
from itertools import pairwise

import attrs
import numpy as np

from benchmarks.accuracy.crowds import DENSITY, WATER, rough_polygon
from benchmarks.budget import Stopwatch, run_each
from benchmarks.reporting import Table, parser_of, print_heading
from flocsim import Body, Sphere, SpheroPolygon, Swarm, System, floor, wall
from flocsim.errors import PlausibilityWarning
from flocsim.forces import Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import Implicit, Status
from flocsim.swarms.placement import place_at_random

# What is pressed so strongly falls faster than Stokes's drag holds.
warnings.simplefilter("ignore", PlausibilityWarning)

RESTING = 1e-9
"""Bodies that are all slower [m/s] are at rest."""

MOST_STEPS = 60_000
"""Of an island in a window, or of a run of few bodies."""

OVER_BUDGET = "over budget"
CUT_OFF = "cut off"
"""How a scene ended that minded its budget, and one that did not."""


@attrs.frozen
class Rest:
    """How a scene ended, the time that it came to [s], its steps, since when its bodies rest [s]
    and the steps since then (None: they never did), their largest speed then [m/s], CPU seconds,
    and (time, steps so far) along the way."""

    status: str
    time: float = math.nan
    steps: int = 0
    since: float | None = None
    steps_since: int | None = None
    speed: float = math.nan
    seconds: float = math.nan
    path: tuple = ((0.0, 0),)

    @property
    def cells(self):
        """What a table shows of it."""
        since = ["never", ""] if self.since is None else [self.since, self.steps_since]
        return [self.status, self.time, self.steps, *since, self.speed, self.seconds]


REST_COLUMNS = ("status", "time [s]", "steps", "at rest since [s]", "steps since", "speed [m/s]",
                "CPU s")  # fmt: skip


def fastest(velocity):
    """The largest speed [m/s] of (vx, vy, …)."""
    return float(np.hypot(velocity[:, 0], velocity[:, 1]).max())


def name_of(status):
    """How a run ended, in words; one that was to go on had no budget left."""
    went_on = status in (Status.PAUSED, Status.STOPPED)
    return OVER_BUDGET if went_on else status.name.lower().replace("_", " ")


def settle(swarm, until, seconds, tell):
    """The Rest of a swarm, by the time ``until`` [s] or when its budget is spent."""
    watch, path, since = Stopwatch(seconds), [(0.0, 0)], None
    free = np.array([not body.fixed for body in swarm.bodies])
    progress = swarm.begin(until, max_steps=MOST_STEPS)
    status = Status.PAUSED
    while status == Status.PAUSED and not watch.spent:
        status = progress.advance(until)
        path.append((progress.time, progress.effort.steps))
        speed = fastest(progress.swarm.motion[free, 3:5])
        if since is None and speed < RESTING and progress.time > 0.0:
            since = path[-1]
        steps = progress.effort.steps
        found = Rest(
            CUT_OFF, progress.time, steps, since and since[0], since and steps - since[1], speed,
            watch.seconds, ((0.0, 0), path[-1]),
        )  # fmt: skip
        tell(found)
    return attrs.evolve(found, status=name_of(status), path=tuple(path))


def rests(function, cases, seconds, **kind):
    """Yield (case, Rest) of each."""
    for case, found in run_each(function, cases, seconds, **kind):
        yield case, found or Rest(CUT_OFF)


DISC = 20e-6
"""Radius of the discs of a heap [m]."""

HEAPS = {"15 between walls": False, "25 on a periodic floor": True}
LAWS = {
    "friction none": {},
    "friction 0": {"friction": 0.0},
    "k_t 0": {"k_t": 0.0},
    "friction 0, k_t 0": {"friction": 0.0, "k_t": 0.0},
    "friction .3": {"friction": 0.3},
}
"""Contact laws of the heaps: those from the second to the fourth are the same one."""

AT_REST, ROWS = 5.0, 5
"""How long a heap lies there [s], and of how many rows of discs it is."""


def heap(periodic, spread, law, tolerance):
    """Rows of touching discs, their radii less by up to a share ``spread``."""
    rng = np.random.default_rng(1)
    up = math.sqrt(3.0) * DISC * 1.0005
    width = 2.0 * DISC * ROWS
    if periodic:
        fixed = [floor(width, beyond=4.0 * DISC)]
        places = [(((2 * j + k) * DISC) % width, DISC + up * k)
                  for k in range(ROWS) for j in range(ROWS)]  # fmt: skip
    else:
        right, thick, high = width - DISC, 1e-5, 1e-3
        sides = (-DISC - thick, right + thick)
        fixed = [floor(right + 4.0 * DISC, beyond=4.0 * DISC)]
        fixed += [wall((x, -0.1 * high), (x, high), radius=thick) for x in sides]
        places = [((2 * j + k) * DISC, DISC + up * k)
                  for k in range(ROWS) for j in range(ROWS - k)]  # fmt: skip
    discs = [
        Body(Sphere(DISC * (1.0 - spread * rng.random())), place, density=DENSITY)
        for place in places
    ]
    forces = [Gravity(), StokesDrag(), Contact(**law)]
    box = (1.0005 * width, None) if periodic else None
    return Swarm([*fixed, *discs], forces, Implicit(tolerance), WATER, box=box)


def rest_of_heap(tolerance, case, seconds, tell):
    """The Rest of a heap: (name, spread of radii, name of the law)."""
    name, spread, law = case
    return settle(heap(HEAPS[name], spread, LAWS[law], tolerance), AT_REST, seconds, tell)


def discs(arguments):
    """Print the table of heaps of discs."""
    columns = ("discs", "spread of radii", "law", *REST_COLUMNS)
    table = Table(f"Heaps of discs at rest for {AT_REST:g} s", columns)
    cases = [(name, spread, law) for law in LAWS for name in HEAPS for spread in (0.0, 0.05)]
    for case, found in rests(partial(rest_of_heap, arguments.tolerance), cases, arguments.seconds):
        table.add(*case, *found.cells)
    table.print(arguments.markdown)


FALLING, LYING, POLYGON = 3.0, 8.0, 6e-6
"""How long a pile of few polygons settles and rests, and a large one [s], and their mean radius
[m]."""


def pile_of(number, friction, attraction, tolerance, seed=0):
    """So many polygons above a periodic floor, with an attraction or without."""
    rng = np.random.default_rng(seed)
    shapes = [
        rough_polygon(10, POLYGON * math.exp(0.25 * rng.normal()), rng) for _ in range(number)
    ]
    widest = 2.0 * max(shape.bounding_radius for shape in shapes)
    width = widest * max(4.0, 0.5 * math.sqrt(number))
    height = max(sum(shape.area for shape in shapes) / (0.3 * width), 3.0 * widest)
    places = place_at_random(shapes, (width, height), rng, (True, False))
    bodies = [
        Body(shape, (x, y), angle=angle, density=DENSITY)
        for shape, (x, y, angle) in zip(shapes, places.tolist(), strict=True)
    ]
    forces = [Gravity(), StokesDrag(), Contact(friction=friction)]
    if attraction:
        forces.append(VanDerWaals(hamaker=4.7e-20, gap="surface", cut=1e-6))
    bottom = floor(width, beyond=widest)
    return Swarm([bottom, *bodies], forces, Implicit(tolerance), WATER, box=(width, None))


def rest_of_pile(tolerance, until, case, seconds, tell):
    """The Rest of a pile: (number, friction, attraction)."""
    return settle(pile_of(*case, tolerance), until, seconds, tell)


def said(attraction):
    return "with" if attraction else "without"


def pile(arguments):
    """Print the table of a large pile with friction."""
    columns = ("polygons", "friction", "attraction", *REST_COLUMNS)
    table = Table(f"A pile of polygons settles and rests, {LYING:g} s", columns)
    number = 50 if arguments.quick else 500
    cases = [(number, 0.4, attraction) for attraction in (False, True)]
    seconds = arguments.pile_seconds
    ours = partial(rest_of_pile, arguments.tolerance, LYING)
    for case, found in rests(ours, cases, seconds):
        table.add(*case[:2], said(case[2]), *found.cells)
    table.print(arguments.markdown)


FRICTIONS = ("none", 0.0, 0.01, 0.4)


def steps_at(rest, time):
    """Steps that were taken by a time [s]; NaN of a scene that was cut off before it said."""
    if math.isnan(rest.time):
        return math.nan
    return float(np.interp(time, *zip(*rest.path, strict=True)))


def attraction(arguments):
    """Print the table of steps without attraction over those with it."""
    columns = ("polygons", "friction", "attraction", *REST_COLUMNS, "steps over those with")
    number = 10 if arguments.quick else 50
    title = f"{number} polygons settle and rest, {FALLING:g} s, with attraction and without"
    table, known = Table(title, columns), {}
    cases = [(number, friction, having) for friction in FRICTIONS for having in (True, False)]
    ours = partial(rest_of_pile, arguments.tolerance, FALLING)
    for (_, friction, having), found in rests(ours, cases, arguments.seconds):
        known[friction, having] = found
        other = known[friction, True]
        common = min(found.time, other.time)
        ratio = steps_at(found, common) / max(1.0, steps_at(other, common))
        table.add(number, friction, said(having), *found.cells, "" if having else ratio)
    table.print(arguments.markdown)


GRAVITIES = (290.0, 31_000.0)
"""Least and largest [m/s²] of what presses polygons together."""

PRESSED = 0.1
"""How long a scene is run under the least gravity [s]; under others as much shorter as a fall."""

HALF_WIDTH, DEPTH, THICK = 18e-6, 1.6e-4, 1e-5
"""Of a cup [m], in which the largest polygons have room to turn."""


def cup():
    """A fixed cup whose inner bottom is at y = 0."""
    side, outside, low = HALF_WIDTH, HALF_WIDTH + THICK, -THICK
    points = np.array([
        (-outside, low), (outside, low), (outside, DEPTH), (side, DEPTH),
        (side, 0.0), (-side, 0.0), (-side, DEPTH), (-outside, DEPTH),
    ])  # fmt: skip
    radius = 0.1 * THICK
    shape = SpheroPolygon(points - [0.0, radius], radius)
    return Body(shape, tuple(shape.centroid), density=DENSITY, fixed=True)


def level():
    """A fixed floor whose upper side is at y = 0."""
    return wall((-20.0 * HALF_WIDTH, -THICK), (20.0 * HALF_WIDTH, -THICK), radius=THICK)


CLEAR = 3e-7
"""Polygons begin so far above each other [m]."""

SUPPORTS = {"floor": level, "cup": cup}


@attrs.frozen
class Scene:
    """A scene of polygons pressed together."""

    bodies: list
    forces: list
    until: float
    friction: float
    gravity: float
    support: str


def scene_of(number):
    """The Scene of a number."""
    rng = np.random.default_rng([number, 23])
    count, support = int(rng.integers(2, 7)), list(SUPPORTS)[number % len(SUPPORTS)]
    gravity = float(np.exp(rng.uniform(*np.log(GRAVITIES))))
    friction = float(rng.choice([0.05, 0.2, 0.4, 1.0]))
    shapes = [rough_polygon(int(rng.integers(3, 13)), rng.uniform(4e-6, 8e-6), rng)
              for _ in range(count)]  # fmt: skip
    bodies, height = [], 0.0
    for shape in shapes:
        height += shape.bounding_radius + CLEAR
        place = (float(rng.uniform(-3e-6, 3e-6)), height)
        bodies.append(Body(shape, place, float(rng.uniform(0.0, 2.0 * math.pi)), density=DENSITY))
        height += shape.bounding_radius
    bodies.append(SUPPORTS[support]())
    forces = [Gravity(gravity), StokesDrag(), Contact(friction=friction, tension=False)]
    until = PRESSED * GRAVITIES[0] / gravity
    return Scene(bodies, forces, until, friction, gravity, support)


def press(tolerance, case, seconds, tell):
    """The Rest of a scene: (number, what runs it)."""
    number, runner = case
    scene, watch = scene_of(number), Stopwatch(seconds)
    parts = scene.bodies, scene.forces, Implicit(tolerance), WATER
    if runner == "Swarm":
        return settle(Swarm(*parts), scene.until, seconds, tell)
    found = System(*parts).run(
        scene.until, max_steps=MOST_STEPS, record=False, watch=lambda _: watch.spent
    )
    speed = fastest(found.velocity[-1, :-1])
    return Rest(name_of(found.status), float(found.t[-1]), found.steps, None, None, speed,
                watch.seconds)  # fmt: skip


ENDS = ("finished", "stalled", "step budget", OVER_BUDGET, CUT_OFF)


def add_pressed(table, runner, low, high, scenes, found):
    """A row of the table, of scenes of gravities in a range [m/s²]."""
    some = [number for number, scene in scenes.items() if low <= scene.gravity <= high]
    if not some:
        return
    ends = [found[number] for number in some]
    counted = Counter(rest.status for rest in ends)
    listed = [counted.pop(name, 0) for name in ENDS]
    moving = sum(rest.status == "finished" and rest.speed > RESTING for rest in ends)
    shares = [found[number].time / scenes[number].until for number in some]
    steps = [rest.steps for rest in ends]
    table.add(
        runner, f"{low:.3g} to {high:.3g}", len(some), *listed, sum(counted.values()), moving,
        float(np.median(steps)), max(steps), float(np.nansum([rest.seconds for rest in ends])),
        float(np.nan_to_num(shares).min()),
    )  # fmt: skip


def pressed(arguments):
    """Print the table of polygons pressed together."""
    scenes = {k: scene_of(k) for k in range(12 if arguments.quick else arguments.scenes)}
    columns = ("by", "gravity [m/s²]", "scenes", *ENDS, "other", "finished but moving",
               "steps, median", "largest", "CPU s", "least share of the time")  # fmt: skip
    table = Table("Two to six polygons with friction, tension off, pressed together", columns)
    ours, open_ends = partial(press, arguments.tolerance), []
    for runner in ("System", "Swarm"):
        cases = [(number, runner) for number in scenes]
        pressed_by = rests(ours, cases, arguments.scene_seconds,
                           kind=lambda case: (case[1], len(scenes[case[0]].bodies)))  # fmt: skip
        found = {case[0]: rest for case, rest in pressed_by}
        edges = np.geomspace(*GRAVITIES, 4)
        for low, high in [*pairwise(edges), (edges[0], edges[-1])]:
            add_pressed(table, runner, low, high, scenes, found)
        open_ends += [
            f"{runner} {number}, {len(scene.bodies) - 1} polygons, {scene.support}, g = "
            f"{scene.gravity:.0f}, friction {scene.friction:g}: {found[number].status} at "
            f"{found[number].time / scene.until:.3g} of the time, {found[number].steps} steps"
            for number, scene in scenes.items() if found[number].status != "finished"
        ]  # fmt: skip
    table.print(arguments.markdown)
    print("\n".join(["Not finished:", *(open_ends or ["none"])]), end="\n\n", flush=True)


PARTS = {each.__name__: each for each in (discs, pile, attraction, pressed)}


def main():
    """Print the tables."""
    parser = parser_of(__doc__)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--tolerance", type=float, default=1e-9)
    parser.add_argument("--seconds", type=float, default=20.0, help="CPU time of a heap or pile")
    parser.add_argument("--pile-seconds", type=float, default=500.0, help="of the large pile")
    parser.add_argument("--scene-seconds", type=float, default=5.0, help="of a scene of pressed")
    parser.add_argument("--scenes", type=int, default=96, help="of polygons pressed together")
    arguments = parser.parse_args()
    print_heading()
    for part in arguments.parts:
        PARTS[part](arguments)


if __name__ == "__main__":
    main()
