"""Parts of the engine that a scene never reaches, and that are left out to save compile time.

With few bodies: the search for near pairs, as all pairs are watched (flocsim.state.work:
ALL_PAIRS). With two bodies in a System: backward Euler, to which Implicit does not hand over below
FEWEST bodies (backward_euler/method.py) unless contacts may slide. Where no force needs them: sums
along outlines, sums over charges, the numbers of shapes that drag in a flow uses, and the
resistance of water between bodies.
"""

import math
from collections.abc import Callable

from flocsim.geometry.contact import body_pairs
from flocsim.integrators.backward_euler.method import (
    FEWEST,
    hand_over,
    keep_method,
    no_step_across,
    step_or_give_back,
)
from flocsim.integrators.rhs import (
    charge_sum,
    forces,
    jacobian,
    outline_sum,
    pair_resistance,
    views,
)
from flocsim.state.work import ALL_PAIRS


# Each takes the arguments of what it replaces, and reports that there is nothing to do.
def list_none(scene, work, cut):
    """List no pairs: all are listed from the start."""
    return True


def none_wandered(scene, work, state):
    """Return no motion since the last list: the list of all pairs never expires."""
    return 0.0


def never_wanders(scene, work, fraction):
    """Return the time [s] for which the list of all pairs is valid."""
    return math.inf


def add_none(scene, work, time, state):
    """Add nothing: no forces act along outlines."""


def differentiate_none(scene, work, time):
    """Add no derivatives of forces along outlines."""


def none_apart(scene, work, time, a, b, displacement):
    """Return no repulsion [N]: no forces act along outlines."""
    return 0.0


def left_out(
    bodies: float, *, outlines: bool, charges: bool, plain: bool, sliding: bool, water: bool
) -> dict[Callable, Callable]:
    """Return {hook: function} that replaces what a scene does not need by functions that do
    nothing.

    For flocsim.compiler.composer.compose. ``bodies`` is their number, or inf for any number.
    ``outlines`` and ``charges`` say if there are forces along outlines, and between charges;
    ``plain`` if no kernel reads the numbers of shapes; ``sliding`` if friction has a limit;
    ``water`` if two bodies resist each other through it.
    """
    replaced: dict[Callable, Callable] = {}
    # By forces.
    if plain:
        replaced |= {views.body_view: views.plain_body_view}
    if not outlines:
        replaced |= {
            forces.add_outline_forces: add_none,
            jacobian.add_outline_derivatives: differentiate_none,
            outline_sum.outline_repulsion: none_apart,
        }
    if not charges:
        replaced |= {charge_sum.sum_charges: charge_sum.no_charges}
    if not water:
        replaced |= pair_resistance.LEFT_OUT
    # By the number of bodies.
    if bodies < FEWEST and not sliding:
        replaced |= {hand_over: keep_method, step_or_give_back: no_step_across}
    if bodies <= ALL_PAIRS:
        replaced |= {
            body_pairs.list_near: list_none,
            body_pairs.travelled_share: none_wandered,
            body_pairs.time_to_travel: never_wanders,
        }
    return replaced
