"""The first event that must end a step: a pair switches, slides or sticks, or a law has a kink.

Which listed pairs are closed and which slide are flags that are frozen within a step, so that
forces are smooth functions of the state; the driver ends the step where one would change. Kinks of
a contact law, such as a clip or a threshold, are watched one by one: two that change sign in one
step would hide each other in a product. Forces are continuous there, so a step that ends slightly
past a kink is wrong by the square of that only.
"""

import math

from flocsim.constants import SHALLOWEST_TOUCH
from flocsim.geometry.contact.points import least_listed_gap
from flocsim.hooks import SLIP_LIMIT, awaits_touch, contact_event, contact_force, has
from flocsim.integrators.events.crossings import first_switch
from flocsim.integrators.events.grazes import START_FRACTION, grazing_end_share
from flocsim.integrators.events.resolution import OVERLAP_FRACTION, RESOLUTION
from flocsim.integrators.rhs.error import at_least_rounding, step_tolerance
from flocsim.integrators.rhs.friction import set_sliding, slip_transition
from flocsim.integrators.rhs.views import contact_view, velocity_lifetime_of, view_without_slip
from flocsim.state.contacts import CLOSED, GRAZING, OPEN
from flocsim.state.work import NEW, NOW

KINK_FINENESS = 1e-4
"""A kink is located to this fraction of its distance at the start of the step."""

KINK_EFFECT = 1e-6
"""A kink counts only if the contact's force in the step moves the bodies by more than this fraction
of the tolerance. Contacts that open again at overlaps of rounding would shorten steps for ever; a
larger fraction shows in strongly damped impacts."""


def switch_resolutions(work, clock):
    """Return (resolution, depth) [m] of switches.

    A switch that ends a step is located to ``resolution``; a pair within ``depth`` of its switch
    counts as not switched.
    """
    resolution = RESOLUTION * step_tolerance(work, clock) if clock.tolerance < math.inf else 1e-13
    # While contacts are pressed, resolve a fraction of the deepest overlap.
    deepest = -least_listed_gap(work)
    if deepest > 0.0:
        resolution = min(resolution, OVERLAP_FRACTION * deepest)
    resolution = at_least_rounding(work, NEW, resolution)
    if deepest > 0.0:
        return resolution, resolution
    # While nothing overlaps, touches shallower than SHALLOWEST_TOUCH do not count.
    return resolution, max(resolution, min(SHALLOWEST_TOUCH, clock.tolerance))


def is_force_felt(scene, work, clock, step, row):
    """Return True if the force of a contact within a step moves its bodies by more than
    KINK_EFFECT of the tolerance, at once or later."""
    largest = 0.0
    for state in (NOW, NEW):
        view = contact_view(scene, work, state, row)
        normal, tangential = contact_force(scene, view)
        largest = max(largest, abs(normal), abs(tangential))
    # It displaces them by F h²/m in the step, and by F h/m · lifetime behind it.
    speed = largest * step / view.effective_mass
    displacement = speed * (step + velocity_lifetime_of(work, row))
    return displacement > KINK_EFFECT * clock.tolerance


def kink_share(scene, work, clock, step, row, which):
    """Return the fraction of the step at which one contact passes one kink, by linear
    interpolation.

    inf if it does not, or is as good as there at either end.
    """
    view = contact_view(scene, work, NOW, row)
    before = contact_event(scene, view, which)
    after = contact_event(scene, contact_view(scene, work, NEW, row), which)
    # Too near to either end to be told from rounding: an overlap is known to that of coordinates.
    nearer, further = min(abs(before), abs(after)), max(abs(before), abs(after))
    at_rest = contact_event(scene, view_without_slip(view, view.overlap, 0.0), which)
    rounding = at_least_rounding(work, NOW, 0.0) / view.overlap
    if before * after >= 0.0 or nearer <= max(KINK_FINENESS * further, rounding * abs(at_rest)):
        return math.inf
    if not is_force_felt(scene, work, clock, step, row):
        return math.inf
    # Aim past the kink, so that the next step begins behind it.
    return (1.0 + 0.5 * KINK_FINENESS) * before / (before - after)


def first_law_share(scene, work, clock, step):
    """Return the fraction of the step at which the law of a contact first changes: a kink, sliding,
    sticking or the end of grazing.

    Above 1 if none does. Expects the geometry of all pairs in NEW.
    """
    share, (resolution, _) = math.inf, switch_resolutions(work, clock)
    for row in range(work.tally.candidates):
        mode = work.candidates[row].contact_mode
        if mode == GRAZING:
            end = grazing_end_share(work, clock, step, row)
            share = min(share, (1.0 + START_FRACTION) * end)
        if mode == CLOSED:
            for which in range(scene.events):
                share = min(share, kink_share(scene, work, clock, step, row, which))
            # Sliding and sticking, if there is a Coulomb limit.
            if has(scene, SLIP_LIMIT):
                distance, transition = slip_transition(scene, work, row, step)
                if distance > resolution:
                    share = min(share, transition)
    return share


def switch_share(scene, work, observed, clock, step):
    """Return the fraction of the step at which the first pair switches; above 1 if none does.

    Expects the geometry of all pairs in NEW.
    """
    # Fixed steps, and steps across switches, end at touches only if an observer asks for it.
    ends = clock.tolerance < math.inf and clock.across == 0.0
    if ends or awaits_touch(observed):
        resolution, depth = switch_resolutions(work, clock)
        share = first_switch(scene, work, step, resolution, depth)
        return share if share <= 1.0 else first_law_share(scene, work, clock, step)
    return math.inf


def set_closed(work, state=NOW):
    """Flag every listed pair as open or closed by its gap in a state, except those that graze;
    return True if any has changed."""
    changed = False
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        # A gap of exactly 0 is open.
        if candidate.contact_mode == GRAZING:
            continue
        closed = CLOSED if work.geometry[state, row].gap < 0.0 else OPEN
        changed = changed or candidate.contact_mode != closed
        candidate.contact_mode = closed
    return changed


def set_modes(scene, work):
    """Set the mode of every listed pair from its present gap and slip; return True if any has
    changed."""
    contacts, friction = set_closed(work), set_sliding(scene, work)
    return contacts or friction
