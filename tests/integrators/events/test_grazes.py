"""When a contact hums: flights far below the tolerance are counted, also those within one step."""

import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.forces import Contact
from flocsim.integrators import Implicit
from flocsim.integrators.events import grazes
from tests.helpers.fast_scene import flagged

TOLERANCE = 1e-9


def touching(speed):
    """Two spheres that touch again, at this speed."""
    bodies = [
        Body(Sphere(4e-6), density=2650.0),
        Body(Sphere(4e-6), (8e-6 - 1e-15, 0.0), velocity=(-speed, 0.0), density=2650.0),
    ]
    scene, work = flagged(System(bodies, [Contact()], Implicit(TOLERANCE)))
    return scene, work, Implicit(TOLERANCE).fresh_clock()


@pytest.mark.parametrize(("speed", "counted"), [(1e-4, True), (1e-3, False)])
def test_a_flight_within_one_step_is_as_high_as_its_rate_says(speed, counted):
    """4 µs of it rise by a quarter of speed times time: 1e-10 m and 1e-9 m; a tenth of the
    tolerance is far below it."""
    _, work, clock = touching(speed)
    work.slip[at.FLIGHTS, 0] = 2.0
    grazes.count_flight(work, clock, 0.999 * 4e-6, 0)
    assert work.slip[at.FLIGHTS, 0] == (3.0 if counted else 0.0)


def test_a_flight_that_was_seen_is_taken_as_seen():
    _, work, clock = touching(1e-3)
    work.slip[at.FLIGHT, 0] = 1e-12
    grazes.count_flight(work, clock, 4e-6, 0)
    assert work.slip[at.FLIGHTS, 0] == 1.0 and work.slip[at.FLIGHT, 0] == 0.0


def test_a_pair_that_is_far_apart_hums_no_more():
    """Else the other contacts of its bodies would be taken for one that it throws open in turn."""
    _, work, clock = touching(1e-3)
    work.slip[at.FLIGHTS, 0] = float(grazes.MANY)
    for gap, hums in ((0.05 * TOLERANCE, True), (0.2 * TOLERANCE, False)):
        work.geometry[at.NOW, 0, at.GAP] = gap
        grazes.note_flight(work, clock, 0)
        assert grazes.hums(work, 0) == hums
