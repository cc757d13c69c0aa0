"""Events of a contact law: each is watched by itself."""

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Body, Sphere, System
from flocsim.arrays import work_of
from flocsim.forces import Contact
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.hooks import contact_event
from flocsim.integrators import Implicit
from flocsim.integrators.events.first_event import law_event_share, set_modes
from flocsim.integrators.rhs.views import contact_view

RADIUS, OVERLAP = 5e-6, 1e-8
PULL, SLIDE = range(2)
"""The events of Contact: where the normal force begins to pull, and where sliding begins."""


def leaving(contact, rate_before, rate_after, slip=0.0, slip_after=0.0):
    """(scene, arrays) of a sphere on a fixed one at the start and the end of a step: how fast it
    leaves there [m/s], and how far the contact is displaced sideways [m]."""
    still = Body(Sphere(RADIUS), fixed=True, surface_density=2.0)
    flying = Body(Sphere(RADIUS), (0.0, 2.0 * RADIUS - OVERLAP), surface_density=2.0)
    system = System([still, flying], [contact], Implicit(1e-10))
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion())
    assert list_candidates(scene, work)
    for state, rate, slipped in ((at.NOW, rate_before, slip), (at.NEW, rate_after, slip_after)):
        work.motion[state] = work.motion[at.NOW]
        work.motion[state, 1, at.VY] = rate
        locate_contacts(scene, work, state)
        work.slip[state, 0] = slipped
    set_modes(scene, work)
    assert work.tally[at.CANDIDATES] == 1 and work.candidates[0, at.CLOSED] == 1
    return scene, work


def events(scene, work, state):
    """Both events of the one contact in a state [N]."""
    view = contact_view(scene, work, state, 0)
    return [contact_event(scene, view, which) for which in (PULL, SLIDE)]


def test_a_step_from_sticking_to_separated_ends_at_its_first_event():
    """Both events change their signs, and their product would not."""
    contact = Contact(k_n=20.0, k_t=2.0, damping_n=1e4, friction=0.3, tension=False)
    scene, work = leaving(contact, 0.0, 1.0, slip=1e-9, slip_after=2e-9)
    before, after = events(scene, work, at.NOW), events(scene, work, at.NEW)
    assert min(before) > 0.0 > max(after)
    share = law_event_share(scene, work, 2.0)
    wanted = min(b / (b - a) for b, a in zip(before, after, strict=True))
    assert share == pytest.approx(wanted, rel=1e-3) and share < 1.0


@pytest.mark.parametrize(
    "friction, tension, rate, slip, which",
    [(0.3, True, 0.0, 1e-7, SLIDE), ("none", False, 1.0, 0.0, PULL), (0.3, False, 1.0, 0.0, PULL)],
)
def test_one_event_is_located(friction, tension, rate, slip, which):
    contact = Contact(k_n=20.0, k_t=2.0, damping_n=1e4, friction=friction, tension=tension)
    scene, work = leaving(contact, 0.0, rate, slip_after=slip)
    before, after = events(scene, work, at.NOW)[which], events(scene, work, at.NEW)[which]
    assert before > 0.0 > after
    assert law_event_share(scene, work, 2.0) == pytest.approx(before / (before - after), rel=1e-3)


def test_a_law_without_kinks_has_no_events():
    scene, work = leaving(Contact(k_n=20.0, k_t=2.0, damping_n=1e4), 0.0, 1.0, slip_after=1e-6)
    assert scene.events == 0
    assert law_event_share(scene, work, 2.0) == 2.0


@pytest.mark.parametrize("friction", [0.1, 0.3, 1.0])
def test_a_sliding_sphere_that_is_thrown_off_keeps_the_same_motion_at_any_tolerance(friction):
    """µ and no tension: the impact slides, then parts; the end converges with the tolerance."""
    still = Body(Sphere(RADIUS), fixed=True, surface_density=2.0)
    flying = Body(Sphere(RADIUS), (1e-6, 2.0 * RADIUS), velocity=(0.02, -0.05), surface_density=2.0)
    contact = Contact(k_n=20.0, k_t=2.0, damping_n=2e4, friction=friction, tension=False)
    ends = [
        System([still, flying], [contact], Implicit(tolerance)).run(1e-4, jit=False)
        for tolerance in (1e-9, 1e-11)
    ]
    assert all(end.status.name == "FINISHED" for end in ends)
    apart = np.abs(ends[0].position[-1, 1] - ends[1].position[-1, 1])
    assert ends[1].position[-1, 1, at.Y] > 2.0 * RADIUS
    assert apart[:2].max() < 1e-9
    assert ends[1].velocity[-1, 1, at.SPIN - at.VX] != 0.0
