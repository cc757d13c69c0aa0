"""A trial: several pairs of flocs at once, one in each lane of a vector, against the engine.

    python -m benchmarks.speed.lanes [--quick] [--markdown]

Pairs of Type I (preset `tang2014`) fall, meet and rest for 2 ms. The prototype is numba code over
arrays whose last axis is the lane: Dormand–Prince 5(4) with a step of its own in every lane,
gravity, drag, the attraction and repulsion of equivalent spheres, and contacts as smooth springs
and dashpots between all vertices and edges. It has no tangential displacements, no candidate
lists, no located events, no stated error and no observer. A lane whose pair has ended takes the
next one. The engine runs the same pairs without an observer, its tangential springs left out.

LLVM keeps the loop over the lanes scalar, so that the prototype shows what a pair costs in a lane
and how many lanes are busy; "at best" is the rate if eight lanes took as long as one. From N = 16
on even that is below the engine's: contacts of all vertices with all edges take more than what
lists leave, and an explicit method needs six to nine times the steps. Lists, events and
displacements of contacts are rows that differ from lane to lane, and would have to be gathered.
"""

import math
import time
from collections.abc import Callable
from typing import Annotated, NamedTuple

import attrs
import numpy as np

from benchmarks.reporting import Table, begin
from benchmarks.speed.scenes import collisions
from flocsim.compiler.composer import compiled
from flocsim.compiler.linker import loops_apart
from flocsim.constants import STANDARD_GRAVITY
from flocsim.ensembles.study import Study
from flocsim.run import Run
from flocsim.state.declared import zeros_of
from flocsim.state.work import NOW, motion_of, work_of

UNTIL, TOLERANCE = 2e-3, 1e-9
WIDTHS = (1, 8)

STAGES = np.array([
    [0, 0, 0, 0, 0, 0], [1 / 5, 0, 0, 0, 0, 0], [3 / 40, 9 / 40, 0, 0, 0, 0],
    [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
    [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
    [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
    [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
])  # fmt: skip
"""Dormand & Prince (1980): rows of a; the last one is b."""

ERROR = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
"""b − b̂."""


Lane = Annotated[np.ndarray, ("lanes",)]
Bodies = Annotated[np.ndarray, (12, "lanes")]
Outline = Annotated[np.ndarray, ("vertices", "lanes")]


class Lanes(NamedTuple):
    """Pairs that are run together; the last axis is the lane. Rows of motion are x, y, angle and
    their rates, of i and then of j."""

    state: Bodies
    trial: Bodies  # at a stage
    change: Bodies  # rates there: forces, before they are divided by masses
    rates: Annotated[np.ndarray, (7, 12, "lanes")]
    mass: Bodies  # m, –, I, then the three coefficients of drag, of i and then of j
    core_ix: Outline
    core_iy: Outline
    core_jx: Outline
    core_jy: Outline
    x_i: Outline  # where vertices are at a stage
    y_i: Outline
    x_j: Outline
    y_j: Outline
    reach: Lane  # sum of the spheroradii
    spring: Lane
    dashpot: Lane
    size: Lane  # r_i + r_j
    least: Lane  # d_min
    repulsion: Lane
    debye: Lane
    attraction: Lane
    push_x: Lane  # force of all contacts of the vertices of one body, and torques on both
    push_y: Lane
    turn_one: Lane
    turn_two: Lane
    now: Lane
    step: Lane
    who: Annotated[np.ndarray, ("lanes",), np.int64]  # index of the pair; −1: idle


def place(x, y, core_x, core_y, trial, first):
    """Write where the vertices of a body are at a stage."""
    for m in range(x.shape[1]):
        c, s = math.cos(trial[first + 2, m]), math.sin(trial[first + 2, m])
        for k in range(x.shape[0]):
            x[k, m] = trial[first, m] + c * core_x[k, m] - s * core_y[k, m]
            y[k, m] = trial[first + 1, m] + s * core_x[k, m] + c * core_y[k, m]


@loops_apart
def touch(lanes, px, py, ex, ey, one, two):
    """Add the forces of all vertices of body ``one`` at all edges of body ``two``."""
    count = ex.shape[0]
    for p in range(px.shape[0]):
        for q in range(count):
            r = q + 1 if q + 1 < count else 0
            for m in range(lanes.now.shape[0]):
                ax, ay = ex[q, m], ey[q, m]
                bx, by = ex[r, m] - ax, ey[r, m] - ay
                x, y = px[p, m] - ax, py[p, m] - ay
                t = (x * bx + y * by) / (bx * bx + by * by)
                t = t if t > 0.0 else 0.0
                t = t if t < 1.0 else 1.0
                x, y = x - t * bx, y - t * by
                away = math.sqrt(x * x + y * y)
                overlap, nx, ny = lanes.reach[m] - away, x / away, y / away
                # Where the contact is, from both centres.
                rx, ry = px[p, m] - lanes.trial[one, m], py[p, m] - lanes.trial[one + 1, m]
                sx, sy = ax + t * bx - lanes.trial[two, m], ay + t * by - lanes.trial[two + 1, m]
                u = lanes.trial[one + 3, m] - lanes.trial[one + 5, m] * ry
                u -= lanes.trial[two + 3, m] - lanes.trial[two + 5, m] * sy
                v = lanes.trial[one + 4, m] + lanes.trial[one + 5, m] * rx
                v -= lanes.trial[two + 4, m] + lanes.trial[two + 5, m] * sx
                force = lanes.spring[m] * overlap - lanes.dashpot[m] * (nx * u + ny * v)
                force = force if overlap > 0.0 else 0.0
                fx, fy = force * nx, force * ny
                lanes.push_x[m] += fx
                lanes.push_y[m] += fy
                lanes.turn_one[m] += rx * fy - ry * fx
                lanes.turn_two[m] += sx * fy - sy * fx


def add_contacts(lanes, px, py, ex, ey, one, two):
    """Add the forces of touch to both bodies."""
    for m in range(lanes.now.shape[0]):
        lanes.push_x[m] = lanes.push_y[m] = lanes.turn_one[m] = lanes.turn_two[m] = 0.0
    touch(lanes, px, py, ex, ey, one, two)
    for m in range(lanes.now.shape[0]):
        lanes.change[one + 3, m] += lanes.push_x[m]
        lanes.change[one + 4, m] += lanes.push_y[m]
        lanes.change[one + 5, m] += lanes.turn_one[m]
        lanes.change[two + 3, m] -= lanes.push_x[m]
        lanes.change[two + 4, m] -= lanes.push_y[m]
        lanes.change[two + 5, m] -= lanes.turn_two[m]


def write_rates(lanes, stage, gravity):
    """Write the rates of all lanes at a stage."""
    trial, change, mass = lanes.trial, lanes.change, lanes.mass
    for m in range(lanes.now.shape[0]):
        for first in range(0, 12, 6):
            for axis in range(3):
                change[first + axis, m] = trial[first + 3 + axis, m]
                change[first + 3 + axis, m] = (
                    -mass[first + 3 + axis, m] * trial[first + 3 + axis, m]
                )
            change[first + 4, m] -= mass[first, m] * gravity
        # Equivalent spheres: attraction and repulsion along the line of centres.
        x, y = trial[6, m] - trial[0, m], trial[7, m] - trial[1, m]
        away = math.sqrt(x * x + y * y)
        gap = max(away - lanes.size[m], lanes.least[m])
        force = lanes.repulsion[m] * math.exp(-gap / lanes.debye[m])
        force -= lanes.attraction[m] / (gap * gap)
        change[9, m] += force * x / away
        change[10, m] += force * y / away
        change[3, m] -= force * x / away
        change[4, m] -= force * y / away
    place(lanes.x_i, lanes.y_i, lanes.core_ix, lanes.core_iy, trial, 0)
    place(lanes.x_j, lanes.y_j, lanes.core_jx, lanes.core_jy, trial, 6)
    add_contacts(lanes, lanes.x_i, lanes.y_i, lanes.x_j, lanes.y_j, 0, 6)
    add_contacts(lanes, lanes.x_j, lanes.y_j, lanes.x_i, lanes.y_i, 6, 0)
    for row in range(12):
        for m in range(lanes.now.shape[0]):
            inverse = 1.0
            if row % 6 > 2:
                inverse = 1.0 / (mass[row - 3, m] if row % 6 == 5 else mass[row - row % 6, m])
            lanes.rates[stage, row, m] = inverse * change[row, m]


def take(lanes, m, which, starts, outlines, laws, masses):
    """Put a pair into a lane."""
    for row in range(12):
        lanes.state[row, m], lanes.mass[row, m] = starts[which, row], masses[which, row]
    for k in range(lanes.core_ix.shape[0]):
        lanes.core_ix[k, m], lanes.core_iy[k, m] = outlines[which, 0, k], outlines[which, 1, k]
        lanes.core_jx[k, m], lanes.core_jy[k, m] = outlines[which, 2, k], outlines[which, 3, k]
    lanes.reach[m], lanes.spring[m], lanes.dashpot[m] = (
        laws[which, 0],
        laws[which, 1],
        laws[which, 2],
    )
    lanes.size[m], lanes.least[m] = laws[which, 3], laws[which, 4]
    lanes.repulsion[m], lanes.debye[m] = laws[which, 5], laws[which, 6]
    lanes.attraction[m] = laws[which, 7]
    lanes.now[m], lanes.step[m] = 0.0, 1e-6


def step_ratio(lanes, errors, lifetime, tolerance, m):
    """Return the error of a lane's step over the tolerance."""
    worst = 0.0
    for row in range(12):
        off = 0.0
        for k in range(7):
            off += errors[k] * lanes.rates[k, row, m]
        # An error of the angle displaces the rim, one of a velocity for as long as it persists.
        weight = lanes.size[m] if row % 3 == 2 else 1.0
        weight *= lifetime if row % 6 > 2 else 1.0
        worst = max(worst, abs(lanes.step[m] * off * weight))
    return worst / tolerance


def run_all(
    lanes, starts, outlines, laws, masses, stages, errors, ends, until, tolerance, lifetime
):
    """Run all pairs; write their last states to ``ends``; return (steps, idle lane steps)."""
    many, width = starts.shape[0], lanes.now.shape[0]
    taken, ended, steps, idle = 0, 0, 0, 0
    for m in range(width):
        lanes.who[m] = -1
    while ended < many:
        for m in range(width):
            # A lane that has ended takes the next pair; where there is none, it goes on idly.
            if lanes.who[m] < 0 and (taken < many or steps == 0):
                lanes.who[m] = taken if taken < many else -1
                take(lanes, m, min(taken, many - 1), starts, outlines, laws, masses)
                taken += 1
            idle += 1 if lanes.who[m] < 0 else 0
            lanes.step[m] = min(lanes.step[m], max(until - lanes.now[m], 1e-9))
        steps += 1
        for stage in range(7):
            for row in range(12):
                for m in range(width):
                    lanes.trial[row, m] = lanes.state[row, m]
                for k in range(stage):
                    for m in range(width):
                        share = lanes.step[m] * stages[stage, k]
                        lanes.trial[row, m] += share * lanes.rates[k, row, m]
            write_rates(lanes, stage, STANDARD_GRAVITY)
        for m in range(width):
            ratio = step_ratio(lanes, errors, lifetime, tolerance, m)
            if ratio <= 1.0:
                lanes.now[m] += lanes.step[m]
                for row in range(12):
                    lanes.state[row, m] = lanes.trial[row, m]
                if lanes.now[m] >= until * (1.0 - 1e-12) and lanes.who[m] >= 0:
                    for row in range(12):
                        ends[lanes.who[m], row] = lanes.state[row, m]
                    lanes.who[m] = -1
                    ended += 1
            lanes.step[m] *= min(max(0.9 * (ratio + 1e-10) ** -0.2, 0.2), 5.0)
    return steps, idle


@attrs.frozen
class Pairs:
    """Pairs of one collision type: as the prototype reads them, and Draws with their engine."""

    draws: list
    driver: Callable
    starts: np.ndarray
    outlines: np.ndarray
    laws: np.ndarray
    masses: np.ndarray
    lifetime: float


def pairs_of(vertices, count):
    """Return so many Pairs of Type I, at displacements of 0 to .6."""
    more = {"contact": {"k_t": 0.0}}
    study = Study(collisions(shapes={"vertices": [vertices]}, forces=more))
    drawn, starts, outlines, laws, masses, lifetimes = [], [], [], [], [], []
    for k in range(count):
        drawn.append(study.draw(0, vertices, 0.6 * k / count, k))
        system = drawn[-1].system()
        _, _, attraction, layer, contact = system.forces
        i, j = system.bodies
        reduced = 1.0 / (1.0 / i.shape.equivalent_radius + 1.0 / j.shape.equivalent_radius)
        together = i.mass * j.mass / (i.mass + j.mass)
        # As take() reads them: from the sum of the spheroradii to the attraction.
        laws.append([
            i.shape.radius + j.shape.radius, contact.k_n, 2.0 * math.sqrt(contact.k_n * together),
            i.shape.equivalent_radius + j.shape.equivalent_radius, attraction.d_min,
            layer.strength * reduced, layer.debye_length,
            attraction.hamaker * reduced / 6.0,
        ])  # fmt: skip
        rows = []
        for body in (i, j):
            drag = 6.0 * math.pi * system.fluid.viscosity * body.shape.equivalent_radius
            turning = 4.0 / 3.0 * body.shape.equivalent_radius**2 * drag
            rows += [body.mass, 0.0, body.inertia, drag, drag, turning]
        masses.append(rows)
        lifetimes.append(max(rows[0] / rows[3], rows[6] / rows[9]))
        starts.append([
            value for body in (i, j)
            for value in (*body.position, body.angle, *body.velocity, body.spin)
        ])  # fmt: skip
        outlines.append([*i.shape.vertices.T, *j.shape.vertices.T])
    arrays = (np.array(each) for each in (starts, outlines, laws, masses))
    driver = drawn[0].encounter.system.compose()
    return Pairs(drawn, driver, *arrays, max(lifetimes))


def run_lanes(pairs, lanes):
    """(CPU seconds, steps of all lanes together, idle share, last states) of the prototype."""
    run, ends = compiled(run_all), np.zeros_like(pairs.starts)
    work = zeros_of(Lanes, lanes=lanes, vertices=pairs.outlines.shape[2])
    given = pairs.starts, pairs.outlines, pairs.laws, pairs.masses, STAGES, ERROR, ends
    run(work, pairs.starts[:1].copy(), *given[1:], UNTIL, TOLERANCE, pairs.lifetime)
    began = time.process_time()
    steps, idle = run(work, *given, UNTIL, TOLERANCE, pairs.lifetime)
    return time.process_time() - began, steps, idle / (steps * lanes), ends


def run_engine(pairs):
    """(CPU seconds, steps, last states) of the engine without an observer."""
    ends, steps, began = [], 0, 0.0
    for number, draw in enumerate([pairs.draws[0], *pairs.draws]):
        encounter = draw.encounter
        work = work_of(encounter.scene, *encounter.motion(draw.angles, draw.share))
        method = encounter.system.integrator
        run = Run(pairs.driver, encounter.scene, work, method, UNTIL, max_steps=10**6)
        run.to_end()
        if number == 0:
            began = time.process_time()  # compiled
            continue
        steps += run.steps + run.rejected
        ends.append(motion_of(run.work, NOW).ravel())
    return time.process_time() - began, steps, np.array(ends)


def main():
    """Print the table."""
    arguments = begin(__doc__)
    table = Table(
        f"Pairs of Type I for {1e3 * UNTIL:g} ms at a tolerance of {TOLERANCE:g} m",
        ("N", "program", "lanes", "pairs/s", "at best", "steps a pair", "us a step of one pair",
         "busy", "apart [m]"),
    )  # fmt: skip
    for vertices in (4, 16, 64):
        count = 16 if arguments.quick else 64
        pairs = pairs_of(vertices, count)
        spent, steps, exact = run_engine(pairs)
        table.add(vertices, "engine", 1, count / spent, "", steps / count, 1e6 * spent / steps,
                  1.0, "")  # fmt: skip
        alone = 0.0
        for lanes in WIDTHS:
            spent, steps, idle, ends = run_lanes(pairs, lanes)
            apart = np.median(np.abs(ends - exact)[:, [0, 1, 6, 7]].max(axis=1))
            each = steps * lanes * (1.0 - idle)
            alone = alone or count / spent
            table.add(vertices, "prototype", lanes, count / spent, alone * lanes * (1.0 - idle),
                      each / count, 1e6 * spent / each, 1.0 - idle, apart)  # fmt: skip
    table.print()


if __name__ == "__main__":
    main()
