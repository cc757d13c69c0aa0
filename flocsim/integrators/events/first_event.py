"""Where in a step the first thing happens that must end it: a pair switches, a law has a kink.

How finely touching is told from not touching. A contact force may have several kinks, as a clip or
a threshold, and each is watched by itself: two that change their signs in one step would hide each
other in a product. The force is continuous there, so that a step that ends a little behind the
kink errs by the square of that little alone.

Which listed pairs are closed and which slide are flags that stay as they are inside a step, so that
the forces are smooth functions of the state; the driver ends the step where one would change.
"""

import math

from flocsim.constants import SHALLOWEST_TOUCH
from flocsim.hooks import SLIP_LIMIT, awaits_touch, contact_event, has, hook
from flocsim.integrators.events.crossings import NEVER, first_switch
from flocsim.integrators.events.grazes import grazing_share
from flocsim.integrators.events.resolution import furthest_place
from flocsim.integrators.rhs.error import step_tolerance
from flocsim.integrators.rhs.friction import beyond, set_sliding
from flocsim.integrators.rhs.views import contact_view, pressed_view
from flocsim.state.contacts import GRAZES, OPEN, TOUCHES
from flocsim.state.work import NEW, NOW

RESOLUTION = 1e-3
"""A switch is located to this share of the tolerance, …"""

RESOLUTION_OF_OVERLAP = 0.02
"""… and to this share of the deepest overlap, …"""

ROUNDING = 4e-16
"""… but not finer than this share of the places that the gap is the difference of."""

KINK_FINENESS = 1e-4
"""A kink is located to this share of how far the step began from it, …"""

KINK_ROUNDING = 1e-6
"""… and what lies within this share of the value for the same overlap at rest is as good as there:
its sign may be rounding, and steps would end there for ever, and no time would go by."""


def deepest_overlap(work):
    """The largest overlap of a listed pair now [m], at least 0."""
    deepest = 0.0
    for row in range(work.tally.candidates):
        deepest = max(deepest, -work.geometry[NOW, row].gap)
    return deepest


def resolutions_of(work, clock):
    """How far a pair may go behind its switch unnoticed, and how far it may be there without being
    told from one before it [m]."""
    resolution = RESOLUTION * step_tolerance(work, clock) if clock.tolerance < math.inf else 1e-13
    deepest = deepest_overlap(work)
    if deepest > 0.0:
        resolution = min(resolution, RESOLUTION_OF_OVERLAP * deepest)
    resolution = max(resolution, ROUNDING * furthest_place(work, NEW))
    if deepest > 0.0:
        return resolution, resolution
    return resolution, max(resolution, min(SHALLOWEST_TOUCH, clock.tolerance))


def event_share(scene, work, row, which):
    """The share of the step at which one contact passes one of its kinks, by linear interpolation;
    2.0 where it does not, or is as good as there at either end."""
    view = contact_view(scene, work, NOW, row)
    before = contact_event(scene, view, which)
    after = contact_event(scene, contact_view(scene, work, NEW, row), which)
    nearer, further = min(abs(before), abs(after)), max(abs(before), abs(after))
    at_rest = contact_event(scene, pressed_view(view, view.overlap, 0.0), which)
    as_good_as_there = max(KINK_FINENESS * further, KINK_ROUNDING * abs(at_rest))
    if before * after >= 0.0 or nearer <= as_good_as_there:
        return 2.0
    # A little further than the kink, so that the next step begins behind it.
    return (1.0 + 0.5 * KINK_FINENESS) * before / (before - after)


def law_event_share(scene, work, share):
    """The share of the step at which the first contact passes a kink, or the given one before."""
    for row in range(work.tally.candidates):
        if work.candidates[row].closed == 1:
            for which in range(scene.events):
                share = min(share, event_share(scene, work, row, which))
    return share


def friction_share(scene, work, share, step, resolution):
    """The share of the step at which the first contact begins or ends to slide, or the given one
    before; what is beyond that by less than the resolution [m] at the end of the step is left."""
    for row in range(work.tally.candidates):
        if work.candidates[row].closed == 1:
            distance, share_there = beyond(scene, work, row, step)
            if distance > resolution:
                share = min(share, share_there)
    return share


def law_share(scene, work, clock, step):
    """The share of the step at which the first closed contact passes a kink of its law, or begins
    or ends to slide; above 1 where none does. Expects the geometry of all pairs in NEW."""
    share = grazing_share(work, clock, step, law_event_share(scene, work, NEVER))
    if has(scene, SLIP_LIMIT):
        resolution, _ = resolutions_of(work, clock)
        share = friction_share(scene, work, share, step, resolution)
    return share


def switch_share(scene, work, observed, clock, step):
    """The share of the step at which the first pair switches; above 1 where none does.

    Expects the geometry of all pairs in NEW.
    """
    ends = clock.tolerance < math.inf and clock.across == 0.0
    if ends or awaits_touch(observed):
        resolution, depth = resolutions_of(work, clock)
        share = first_switch(scene, work, step, resolution, depth)
        return share if share <= 1.0 else law_share(scene, work, clock, step)
    return math.inf


SAME, OTHER_FRICTION, OTHER_CONTACTS = range(3)
"""What changed when pairs were flagged: nothing; what sticks and slides, by which no force jumps;
which pairs touch."""


def set_closed(work, state=NOW):
    """Flag every listed pair by its gap in a state, but for those that graze; whether
    any has changed."""
    changed = False
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.closed == GRAZES:
            continue
        closed = TOUCHES if work.geometry[state, row].gap < 0.0 else OPEN
        changed = changed or candidate.closed != closed
        candidate.closed = closed
    return changed


@hook
def leave_at_once(scene, work, clock, step):
    """Let pairs cease to graze that do so right behind the start of a step; whether any has."""
    return False


@hook
def settle_grazes(scene, work, clock, step):
    """Let pairs begin and cease to graze behind a step, where a method has that;
    whether any has."""
    return False


def set_modes(scene, work):
    """Flag every listed pair as it is now; what changed (see SAME)."""
    contacts, friction = set_closed(work), set_sliding(scene, work)
    if contacts:
        return OTHER_CONTACTS
    return OTHER_FRICTION if friction else SAME
