"""Where inside a step a contact force has an event: a kink of its law, as a clip or a threshold.

A force may have several, and each is watched by itself: two that change their signs in one step
would hide each other in a product. The force is continuous there, so that a step that ends a little
behind the kink errs by the square of that little alone.
"""

from flocsim.arrays import CANDIDATES, CLOSED, NEW, NOW
from flocsim.integrators.rhs.views import contact_view, pressed_view
from flocsim.laws import contact_event

FINENESS = 1e-4
"""A kink is located to this share of how far the step began from it, …"""

ROUNDING = 1e-6
"""… and what lies within this share of the value for the same overlap at rest is as good as there:
its sign may be rounding, and steps would end there for ever, and no time would go by."""


def event_share(scene, work, row, which):
    """The share of the step at which one contact passes one of its kinks, by linear interpolation;
    2.0 where it does not, or is as good as there at either end."""
    view = contact_view(scene, work, NOW, row)
    before = contact_event(scene, view, which)
    after = contact_event(scene, contact_view(scene, work, NEW, row), which)
    nearer, further = min(abs(before), abs(after)), max(abs(before), abs(after))
    at_rest = contact_event(scene, pressed_view(view, view.overlap, 0.0), which)
    if before * after >= 0.0 or nearer <= max(FINENESS * further, ROUNDING * abs(at_rest)):
        return 2.0
    # A little further than the kink, so that the next step begins behind it.
    return (1.0 + 0.5 * FINENESS) * before / (before - after)


def law_event_share(scene, work, share):
    """The share of the step at which the first contact passes a kink, or the given one before."""
    for row in range(work.tally[CANDIDATES]):
        if work.candidates[row, CLOSED] == 1:
            for which in range(scene.events):
                share = min(share, event_share(scene, work, row, which))
    return share
