"""Whether stated errors cover the true ones in settling swarms of polygons that stick.

    python -m benchmarks.accuracy.swarm_error [--swarms 10] [--first 0] [--tolerance 1e-9]
                                              [--seconds 120] [--worst 10]

Forty polygons settle in a box that repeats itself for a quarter of a second. At five times each
body's place is held against that at 1e-12 m, and a companion of that, nudged by 1 nm, says by how
much the motion of this body amplifies a difference: body-times that amplify it tenfold or more, for
which no sum of errors can speak, are counted apart. Each swarm is also run with all of it shifted
in its box, so that other bodies lie across the edges, and held against the same exact motion.
"""

import math

import attrs
import numpy as np

from benchmarks.accuracy.crowds import WATER, crowd
from benchmarks.budget import Stopwatch, run_each
from benchmarks.reporting import Table, parser_of, print_heading
from flocsim import Swarm
from flocsim.forces import Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import Implicit, Status
from flocsim.integrators.amplification import MOST_AMPLIFIED

EXACT, NUDGE = 1e-12, 1e-9
"""Tolerance [m] of what counts as exact, and how far its companion starts from it [m]."""

NUMBER, UNTIL, TIMES = 40, 0.25, 5
"""Bodies of a swarm, how long it settles [s], and how often it is looked at by then."""

FORCES = (
    Gravity(), StokesDrag(), VanDerWaals(hamaker=4.7e-20, gap="surface", cut=1e-6), Contact(),
)  # fmt: skip

VARIANTS = ("as drawn", "shifted")


def moved(bodies, ways):
    """The bodies, displaced by ``ways`` (n, 2) [m]."""
    return [
        attrs.evolve(body, position=tuple(np.asarray(body.position) + way))
        for body, way in zip(bodies, ways, strict=True)
    ]


def into_the_box(bodies, shift, side):
    """Displacements (n, 2) [m] by which all are shifted and none is outside of the box."""
    places = np.array([body.position for body in bodies])
    return (places + shift) % side - places


@attrs.frozen(eq=False)
class Course:
    """Places (times, n, 2) and stated errors (times, n) [m], steps and CPU seconds of a run; fewer
    times where it did not come to its end."""

    places: np.ndarray
    stated: np.ndarray
    steps: int
    seconds: float

    def less(self, ways):
        """The same of bodies that began elsewhere, by ``ways``."""
        return attrs.evolve(self, places=self.places - ways)

    @property
    def whole(self):
        return len(self.places) == TIMES


def course(bodies, side, tolerance, watch):
    """The Course of a swarm."""
    began, places, stated = Stopwatch(), [], []
    swarm = Swarm(bodies, FORCES, Implicit(tolerance), WATER, box=(side, side))
    progress = swarm.begin(UNTIL)
    for k in range(1, TIMES + 1):
        while (status := progress.advance(UNTIL * k / TIMES)) == Status.PAUSED:
            if watch.spent:
                break
        if status != Status.FINISHED:
            break
        places.append(progress.swarm.motion[:, :2].copy())
        stated.append(progress.stated.copy())
    shape = (len(places), len(bodies))
    return Course(
        np.reshape(places, (*shape, 2)), np.reshape(stated, shape), progress.effort.steps,
        began.seconds,
    )  # fmt: skip


def judge(case, seconds, tell):
    """{variant: (true, stated, amplification, each (times, n); steps, CPU s)} of a swarm, or the
    name of the run that did not come to its end."""
    seed, tolerance = case
    bodies, side = crowd(NUMBER, seed)
    rng, watch = np.random.default_rng([seed, 100]), Stopwatch(seconds)
    ways = rng.uniform(0.0, 2.0 * math.pi, NUMBER)
    nudges = NUDGE * np.column_stack([np.cos(ways), np.sin(ways)])
    shift = into_the_box(bodies, side * rng.random(2), side)
    tell("one of its runs")
    runs = {
        "as drawn": course(bodies, side, tolerance, watch),
        "shifted": course(moved(bodies, shift), side, tolerance, watch).less(shift),
        "exact": course(bodies, side, EXACT, watch),
        "nudged": course(moved(bodies, nudges), side, EXACT, watch),
    }
    for name, run in runs.items():
        if not run.whole:
            return name
    exact = runs["exact"].places
    growth = np.linalg.norm(runs["nudged"].places - exact, axis=2) / NUDGE
    return {
        name: (np.linalg.norm(runs[name].places - exact, axis=2), runs[name].stated, growth,
               runs[name].steps, runs[name].seconds)
        for name in VARIANTS
    }  # fmt: skip


def add_row(table, variant, found):
    """A row of the table, of what was judged of this variant, swarm by swarm."""
    true, stated, growth = (np.array([each[k] for each in found]) for k in range(3))
    calm, beyond = growth < MOST_AMPLIFIED, true > stated
    ratios = true[calm] / np.maximum(stated[calm], 1e-300)
    fell = stated[:, 1:] < 0.5 * stated[:, :-1]
    table.add(
        variant, len(found), int(calm.sum()), int(beyond[calm].sum()),
        100.0 * float(beyond[calm].mean()), float(np.median(ratios)),
        float(np.quantile(ratios, 0.99)), float(ratios.max()), int((~calm).sum()),
        int(beyond[~calm].sum()), 100.0 * float(fell.mean()), float(np.median(stated[:, -1])),
        float(np.mean([each[3] for each in found])), float(np.mean([each[4] for each in found])),
    )  # fmt: skip


def print_worst(found, count):
    """Body-times that are furthest beyond their stated error."""
    listed = []
    for (seed, variant), (true, stated, growth, *_) in found.items():
        ratios = np.where(growth < MOST_AMPLIFIED, true / np.maximum(stated, 1e-300), 0.0)
        listed += [
            (ratio, f"swarm {seed} {variant}, body {body}, time {time + 1} of {TIMES}: true "
             f"{true[time, body]:.3g} m, stated {stated[time, body]:.3g} m, amplified "
             f"{growth[time, body]:.3g} times")
            for (time, body), ratio in np.ndenumerate(ratios)
        ]  # fmt: skip
    for ratio, said in sorted(listed, reverse=True)[:count]:
        print(f"{ratio:.3g}: {said}")
    print()


def main():
    """Print the table."""
    parser = parser_of(__doc__)
    parser.add_argument("--swarms", type=int, default=10, help="200 body-times each")
    parser.add_argument("--first", type=int, default=0, help="number of the first swarm")
    parser.add_argument("--tolerance", type=float, default=1e-9)
    parser.add_argument("--seconds", type=float, default=120.0, help="CPU time of a swarm, at most")
    parser.add_argument("--worst", type=int, default=0, help="list so many of the worst body-times")
    arguments = parser.parse_args()
    print_heading()
    swarms = 2 if arguments.quick else arguments.swarms
    cases = [(arguments.first + k, arguments.tolerance) for k in range(swarms)]
    judged = {}
    for (seed, _), found in run_each(judge, cases, arguments.seconds):
        if isinstance(found, dict):
            judged |= {(seed, variant): found[variant] for variant in VARIANTS}
        else:
            print(f"swarm {seed}: {found} did not end", flush=True)
    columns = ("variant", "swarms", "body-times", "beyond stated", "beyond [%]",
               "median true/stated", "99th percentile", "largest", "amplified",
               "of them beyond", "stated fell by half [%]", "stated at the end [m]", "steps",
               "CPU s")  # fmt: skip
    table = Table(f"True errors against stated ones at {arguments.tolerance:g} m", columns)
    for variant in VARIANTS:
        rows = [found for (_, name), found in judged.items() if name == variant]
        if rows:
            add_row(table, variant, rows)
    table.print(arguments.markdown)
    print_worst(judged, arguments.worst)


if __name__ == "__main__":
    main()
