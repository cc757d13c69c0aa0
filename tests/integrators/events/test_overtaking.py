"""Boxes that attract a floor and touch it with one corner after the other: which is pressed."""

import math

import pytest

from flocsim import Body, Fluid, SpheroPolygon, System
from flocsim.forces import Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import Implicit, Status
from flocsim.integrators.events.crossings import any_overtakes
from flocsim.state.contacts import CLOSED
from flocsim.state.work import NEW, NOW
from tests.helpers.fast_scene import flagged

OVERLAP = 0.9e-9
"""About that of a corner that bears the attraction [m]."""


def outline(x, y):
    """A box of these half sides [m]."""
    return SpheroPolygon([(-x, -y), (x, -y), (x, y), (-x, y)], 5e-7)


def tilted(angle, spin, tolerance=1e-9):
    """The System of a box on a floor, one of its lower corners pressed."""
    height = 4e-6 + 5e-6 * math.sin(abs(angle)) - OVERLAP
    bodies = [
        Body(outline(3e-5, 1e-6), fixed=True, density=2650.0),
        Body(outline(5e-6, 2e-6), (0.0, height), angle=angle, spin=spin, density=2650.0),
    ]
    attraction = VanDerWaals(hamaker=4.7e-20, gap="surface", cut=1e-6)
    forces = [Gravity(), StokesDrag(), attraction, Contact()]
    return System(bodies, forces, Implicit(tolerance), Fluid(buoyancy=True))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_corner_that_touches_gently_does_not_draw_the_attraction_to_itself(side):
    """The box tilts until its other corner touches, far too slowly to tip over on to that one: both
    rests are nearer to each other than the tolerance."""
    angles = []
    for tolerance in (1e-9, 1e-12):
        run = tilted(side * 3e-4, side * -5.0, tolerance).run(1e-3, jit=False)
        assert run.status == Status.FINISHED
        angles.append(side * run.position[-1, 1, 2])
    assert angles[0] == pytest.approx(angles[1], rel=1e-3)
    assert angles[0] > 1e-5


def between(gaps, step, closed=True):
    """Whether a corner overtakes the other one in a step of so many seconds, which takes the gaps
    of both [m] from the first to the second ones."""
    scene, work = flagged(tilted(0.0, 0.0))
    touching = [row for row in range(work.tally.candidates) if work.geometry[NOW, row].gap < 0.0]
    work.geometry[NOW, :]["gap"] = work.geometry[NEW, :]["gap"] = 1e-6
    for state, values in zip((NOW, NEW), gaps, strict=True):
        for row, value in zip((touching[0], touching[-1]), values, strict=True):
            work.geometry[state, row].gap = value
    assert len(touching) > 1 and (work.candidates[touching]["contact_mode"] == CLOSED).all()
    clock = Implicit(1e-9).fresh_clock()
    clock.across = 0.0 if closed else 1.0
    return any_overtakes(scene, work, clock, step)


def test_only_a_long_step_between_far_states_is_in_doubt():
    far = (-OVERLAP, -1e-13), (-1e-12, -OVERLAP)
    assert between(far, 1e-4)
    assert not between(far, 1e-8)
    assert not between((far[0], far[0]), 1e-4)
    assert not between(((-OVERLAP, -0.95 * OVERLAP), (-0.95 * OVERLAP, -OVERLAP)), 1e-4)


def test_pairs_that_are_open_at_the_start_count_where_steps_go_on_across_switches():
    assert between(((-OVERLAP, 1e-8), (1e-8, -OVERLAP)), 1e-4, closed=False)
