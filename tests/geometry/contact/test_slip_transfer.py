"""Tangential displacements: what a contact that rolls on keeps, and when it is forgotten."""

import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon
from flocsim.body import Fluid, scene_of
from flocsim.geometry.contact.candidates import rebuild_list, spent_budget, transfer_slips
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.events.first_event import set_modes
from flocsim.integrators.rhs.forces import write_slip_rates
from flocsim.state.bodies import X, Y
from flocsim.state.work import NOW, work_of

OVERLAP, RADIUS, BALL = 5e-8, 1e-6, 2e-6


def slab(corners, height=4e-6):
    """A bar with a top along the x axis, divided at the given places and bent there by so little,
    7 pm in all, that it is flat: a straight joint would be none."""
    top = [[x, -0.05 * x * x] for x in sorted(corners, reverse=True)]
    ends = [[min(corners), -height], [max(corners), -height]]
    shape = SpheroPolygon(np.array(ends + top), RADIUS)
    return Body(shape, tuple(shape.centroid), surface_density=2.0)


def resting_on(slab_body, body, x, height, speed):
    """Scene and work arrays of a body at (x, height) that moves along the slab's top."""
    scene = scene_of([slab_body, body], Fluid())
    position = np.array([[*slab_body.position, 0.0], [x, height, body.angle]])
    velocity = np.array([[0.0, 0.0, 0.0], [speed, 0.0, 0.0]])
    work = work_of(scene, position, velocity)
    assert rebuild_list(scene, work)
    locate_contacts(scene, work, NOW)
    return scene, work


def pull(work):
    """Σ ξ t_x over the closed pairs, as it acts on body 1 [m]."""
    total = 0.0
    for row in range(work.tally.candidates):
        side = 1.0 if work.candidates[row].vertex_body == 1 else -1.0
        total -= side * work.slip[NOW, row] * -work.geometry[NOW, row].normal_y
    return total


def slide(scene, work, length, passing_on=transfer_slips, steps=400):
    """Carry body 1 along x, its contacts with it; the pull after every step."""
    step = length / steps / work.velocity[NOW, 1, X]
    pulls = []
    for _ in range(steps):
        set_modes(scene, work)
        write_slip_rates(work, NOW)
        closed = work.candidates["contact_mode"] == 1
        work.slip[NOW, closed] += step * work.slip_rate[NOW, closed]
        work.place[NOW, 1, X] += length / steps
        locate_contacts(scene, work, NOW)
        passing_on(scene, work)
        if spent_budget(scene, work, NOW) > 0.5:
            assert rebuild_list(scene, work)
            locate_contacts(scene, work, NOW)
        pulls.append(pull(work))
    return np.array(pulls)


CORNERS = [-10e-6, -4e-6, -3e-6, -2.9e-6, 1e-6, 6e-6, 12e-6]


def ball_on(corners):
    ball = Body(Sphere(BALL), surface_density=2.0)
    return resting_on(slab(corners), ball, -7e-6, RADIUS + BALL - OVERLAP, 1e-3)


def test_the_pull_of_a_sliding_contact_does_not_jump_where_edges_meet():
    length, steps = 16e-6, 400
    pulls = slide(*ball_on(CORNERS), length, steps=steps)
    # At a corner several pairs act at once, each with its own spring: behind it, one holds what
    # their energy allows, and so nearly what one spring on an undivided edge would hold.
    lens = 2.0 * np.sqrt(2.0 * (RADIUS + BALL) * OVERLAP)
    assert np.abs(np.diff(pulls)).max() <= lens
    assert pulls[-1] == pytest.approx(-length, rel=0.05)
    dropped = slide(*ball_on(CORNERS), length, passing_on=forget, steps=steps)
    assert np.abs(np.diff(dropped)).max() > 4.0 * lens


def forget(scene, work):
    """What no hand-over would do: an opening pair loses its displacement."""
    opened = work.geometry[NOW, : work.tally.candidates]["gap"] >= 0.0
    work.slip[NOW, : work.tally.candidates][opened] = 0.0


def test_on_one_undivided_edge_the_pull_is_the_distance():
    pulls = slide(*ball_on([-10e-6, 12e-6]), 16e-6)
    assert pulls[-1] == pytest.approx(-16e-6, rel=1e-9)


def test_the_displacement_vanishes_with_the_last_pair():
    scene, work = ball_on([-10e-6, 12e-6])
    slide(scene, work, 1e-6)
    assert pull(work) != 0.0
    work.place[NOW, 1, Y] += 2.0 * OVERLAP
    locate_contacts(scene, work, NOW)
    transfer_slips(scene, work)
    assert not work.slip[NOW].any()
    work.place[NOW, 1, Y] -= 2.0 * OVERLAP
    locate_contacts(scene, work, NOW)
    assert pull(work) == 0.0


def square_on_slab(tilt):
    """A square that stands on the slab with two corners; tilted, on one."""
    square = SpheroPolygon(2e-6 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), RADIUS)
    body = Body(square, angle=tilt, surface_density=2.0)
    lowest = square.placed_vertices(angle=tilt)[:, 1].min()
    return resting_on(slab([-10e-6, 10e-6]), body, 0.0, 2 * RADIUS - OVERLAP - lowest, 1e-3)


@pytest.mark.parametrize("seed", range(40))
def test_elastic_energy_never_grows_and_spheres_have_no_heir(seed):
    rng = np.random.default_rng(seed)
    scene, work = square_on_slab(0.02 * rng.normal())
    rows = work.tally.candidates
    work.slip[NOW, :rows] = 1e-9 * rng.normal(size=rows)
    work.place[NOW, 1] += rng.normal(size=3) * [1e-7, 3e-8, 1e-2]
    locate_contacts(scene, work, NOW)
    energy = np.sum(work.slip[NOW] ** 2)
    transfer_slips(scene, work)
    assert np.sum(work.slip[NOW] ** 2) <= energy * (1.0 + 1e-12)
    opened = work.geometry[NOW, :rows]["gap"] >= 0.0
    assert not work.slip[NOW, :rows][opened].any()


def test_listing_anew_keeps_every_displacement():
    scene, work = square_on_slab(0.0)
    slide(scene, work, 1e-7, steps=10)
    before = pull(work)
    for _ in range(3):
        assert rebuild_list(scene, work)
        locate_contacts(scene, work, NOW)
        assert pull(work) == before
