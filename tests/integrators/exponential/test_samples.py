"""What happens within a long step that is a series: contacts that come and go in it are found."""

import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.forces import Contact
from flocsim.integrators.exponential.samples import first_return, parts_of_way
from tests.helpers.fast_scene import flagged

R, STEP = 5e-6, 1e-3


def parted(gap, way, bend, third):
    """Two discs this far apart [m], of which the second moves away by ``way`` θ + ``bend`` θ² +
    ``third`` θ³ in a step [m]."""
    bodies = [
        Body(Sphere(R), density=1e3),
        Body(Sphere(R), (2.0 * R + gap, 0.0), velocity=(way / STEP, 0.0), density=1e3),
    ]
    scene, work = flagged(System(bodies, [Contact()]))
    work.tally[at.SERIES_TERMS] = 4
    work.series[at.MOTION] = 0.0
    for k, term in enumerate((way, bend, third), 1):
        work.series[at.MOTION, k, 1, 0] = term
    return scene, work


@pytest.mark.parametrize("way", [1e-8, 1e-9, 1e-11])
def test_a_pair_that_is_back_soon_and_gone_again_at_the_end_of_a_step_is_seen(way):
    """It is back at ``way`` over a micron of the step, and apart from the whole of it on."""
    scene, work = parted(1e-14, way, -1e-6, 2e-6)
    share = first_return(scene, work, STEP, 0.0)
    assert way / 1e-6 < share < 0.5
    assert way - 1e-6 * share + 2e-6 * share * share < 0.0


def test_one_that_is_back_by_less_than_counts_is_not():
    scene, work = parted(1e-14, 1e-8, -1e-6, 2e-6)
    assert first_return(scene, work, STEP, 1e-6) == 1.0


def test_one_that_is_not_back_is_not():
    scene, work = parted(1e-14, 1e-6, -0.9e-6, 1e-6)
    assert first_return(scene, work, STEP, 0.0) == 1.0
    scene, work = parted(1e-14, 1e-6, 1e-6, 0.0)
    assert first_return(scene, work, STEP, 0.0) == 1.0


def test_bodies_that_go_far_past_each_other_are_looked_at_often_where_none_touch():
    scene, work = parted(1e-7, 0.0, 0.0, 0.0)
    work.motion[at.NEW] = work.motion[at.NOW]
    assert parts_of_way(scene, work) == 1
    work.motion[at.NEW, 1, at.Y] += 0.25 * R
    assert parts_of_way(scene, work) == 3
    work.motion[at.NEW, :, at.Y] += 10.0 * R
    assert parts_of_way(scene, work) == 3
    work.motion[at.NEW, 0, at.ANGLE] += 0.4
    assert parts_of_way(scene, work) == 7
    work.candidates[0, at.CLOSED] = at.TOUCHES
    assert parts_of_way(scene, work) == 1
