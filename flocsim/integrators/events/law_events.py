"""Where inside a step a contact force passes a kink of its law: a clip, a threshold.

The force is continuous there, so that a step that ends a little behind the kink errs by the square
of that little alone.
"""

from flocsim.arrays import CANDIDATES, CLOSED, NEW, NOW
from flocsim.hooks import kink
from flocsim.integrators.rhs.views import contact_view, pressed_view

FINENESS = 1e-4
"""A kink is located to this share of how far the step began from it, …"""

ROUNDING = 1e-6
"""… and what lies within this share of the value for the same overlap at rest is as good as there:
its sign may be rounding, and steps would end there for ever, and no time would go by."""


def rounding(view, parameters):
    """The value of a kink that cannot be told from none."""
    return ROUNDING * abs(kink(pressed_view(view, view.overlap, 0.0), parameters))


def row_share(scene, work, row):
    """The share of the step at which one contact passes its kink, by linear interpolation; 2.0
    where it does not, or is as good as there at either end."""
    view = contact_view(scene, work, NOW, row)
    before = kink(view, scene.parameters)
    after = kink(contact_view(scene, work, NEW, row), scene.parameters)
    nearer, further = min(abs(before), abs(after)), max(abs(before), abs(after))
    least = max(FINENESS * further, rounding(view, scene.parameters))
    if before * after >= 0.0 or nearer <= least:
        return 2.0
    # A little further than the kink, so that the next step begins behind it.
    return (1.0 + 0.5 * FINENESS) * before / (before - after)


def kink_share(scene, work, share):
    """The share of the step at which the first contact passes a kink, or the given one before."""
    for row in range(work.tally[CANDIDATES]):
        if work.candidates[row, CLOSED] == 1:
            share = min(share, row_share(scene, work, row))
    return share
