"""What one force evaluation costs while the pair moves: contact search and list upkeep included.

The pair moves by symplectic Euler steps in a compiled loop, one evaluation a step. In contact it
rolls; near (0.3 µm apart) it is led to and fro along its outlines; far it settles.
"""

import time

import attrs
import numpy as np

from benchmarks.speed.scenes import rolling_pair
from flocsim.geometry.contact.candidates import rebuild_list, spent_budget, transfer_slips
from flocsim.integrators import Implicit, VelocityVerlet
from flocsim.integrators.rhs.forces import locate_with_slip_rates, sum_forces
from flocsim.integrators.rhs.views import inertia
from flocsim.state.work import NOW, work_of

STEP = 1e-7
"""Step [s]: at 25 mm/s, the relative drift of Type I under `tang2014`, 2.5 nm."""

TURN = 200
"""Evaluations after which a near pair turns round: it has moved by half a micrometre."""

NEAR_GAP, FAR_GAP = 0.3e-6, 100e-6
"""Distance of the outlines [m] of a near and of a far pair."""


def push(scene, work, step):
    """One symplectic Euler step with the forces in place NOW of ``work.force``."""
    for body in range(scene.bodies.shape[0]):
        for axis in range(3):
            gain = step * scene.bodies[body].free / inertia(scene, body, axis)
            work.velocity[NOW, body, axis] += gain * work.force[NOW, body, axis]
            work.place[NOW, body, axis] += step * work.velocity[NOW, body, axis]
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == 1:
            work.slip[NOW, row] += step * work.slip_rate[NOW, row]


def evaluate_and_push(scene, work, step, count, turn):
    """So many evaluations and steps; the number of those in contact, −1 without room for lists.

    After every ``turn`` of them time runs the other way.
    """
    touching = 0
    for k in range(count):
        if spent_budget(scene, work, NOW) > 0.5 and not rebuild_list(scene, work):
            return -1
        locate_with_slip_rates(scene, work, NOW)
        sum_forces(scene, work, 0.0, NOW)
        transfer_slips(scene, work)
        for row in range(work.tally.candidates):
            if work.candidates[row].contact_mode == 1:
                touching += 1
                break
        push(scene, work, -step if k // turn % 2 == 1 else step)
    return touching


@attrs.frozen
class Cost:
    """µs per evaluation, and of what: evaluations per list, pairs listed, share in contact."""

    microseconds: float
    per_list: float
    listed: int
    touching: float


def shifted(bodies, gap):
    """The pair with its outlines' distance (0 now) widened along the line of centres, led on."""
    along = np.subtract(bodies[1].position, bodies[0].position)
    along = along / np.hypot(*along)
    place = np.add(bodies[1].position, gap * along)
    across = 0.0125 * np.array([-along[1], along[0]])
    still = attrs.evolve(bodies[0], velocity=(0.0, 0.0), spin=0.0, fixed=True)
    led = attrs.evolve(bodies[1], position=place, velocity=2 * across, spin=0.0, fixed=True)
    return still, led


def touching_pair(preset, vertices, replicate):
    """A scene of Type I whose pair has just touched."""
    scene = rolling_pair(preset, vertices, replicate)
    end = scene.system(Implicit(1e-10)).run(scene.until, record=False)
    bodies = [
        attrs.evolve(b, position=p[:2], angle=p[2], velocity=v[:2], spin=v[2])
        for b, p, v in zip(scene.bodies, end.position[-1], end.velocity[-1], strict=True)
    ]
    return attrs.evolve(scene, bodies=tuple(bodies))


def cost(scene, turn, count):
    """The Cost of evaluations; the pair turns round after ``turn`` of them."""
    system = scene.system(VelocityVerlet(STEP))
    loop = system.compose(entry=evaluate_and_push)
    arrays = system.scene()
    work = work_of(arrays, *system.motion(), capacity=8192)
    loop(arrays, work, STEP, 1, turn)
    rebuilds = work.tally.rebuilds
    began = time.process_time()
    touching = loop(arrays, work, STEP, count, turn)
    took = time.process_time() - began
    lists = max(work.tally.rebuilds - rebuilds, 1)
    return Cost(1e6 * took / count, count / lists, int(work.tally.candidates), touching / count)


def rolling_cost(preset, vertices, count):
    """(Cost, scene) of the first of some pairs that stays in contact."""
    for replicate in range(10):
        scene = touching_pair(preset, vertices, replicate)
        found = cost(scene, count, count)
        if found.touching > 0.95:
            break
    return found, scene


def costs(preset, vertices, count):
    """Costs in contact, near and far."""
    contact, scene = rolling_cost(preset, vertices, count)
    near = attrs.evolve(scene, bodies=shifted(scene.bodies, NEAR_GAP))
    far = attrs.evolve(scene, bodies=shifted(scene.bodies, FAR_GAP))
    return contact, cost(near, TURN, count), cost(far, TURN, count)
