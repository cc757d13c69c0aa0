"""What is left out of an engine that a scene never reaches, to save what compiling it takes.

Of few bodies: the search among many, and sparse systems; of two, also the steps across switches
that Implicit goes over to by itself. All pairs of few bodies are watched, their systems are dense
(flocsim.state.work: ALL_PAIRS, DENSE), and two are not handed over in a System (backward_euler/
method.py: FEWEST). Of forces: sums along outlines, and the numbers of shapes that slow flow asks
for, where no force is of that kind: most scenes have neither.
"""

import math
from collections.abc import Callable

from flocsim.geometry.contact import body_pairs
from flocsim.hooks import choose_method, step_across
from flocsim.integrators.backward_euler.method import FEWEST
from flocsim.integrators.radau import elimination
from flocsim.integrators.rhs import (
    charge_sum,
    forces,
    jacobian,
    outline_sum,
    pair_resistance,
    views,
)
from flocsim.state.work import DENSE


def list_none(scene, work, cut):
    """All pairs are listed from the start."""
    return True


def none_wandered(scene, work, state):
    """No list can become too old."""
    return 0.0


def never_wanders(scene, work, share):
    """The time [s] for which the list of all pairs is good."""
    return math.inf


def factorise_none(scene, work, step, both):
    """There are no sparse systems."""
    return False


def solve_none(work, both):
    """There are no sparse systems."""


def add_none(scene, work, time, state):
    """No forces act along outlines."""


def differentiate_none(scene, work, time):
    """They have no derivatives."""


def none_apart(scene, work, time, a, b, way):
    """They push nothing apart."""
    return 0.0


def left_out(
    bodies: float, *, outlines: bool, charges: bool, plain: bool, water: bool
) -> dict[Callable, Callable]:
    """{hook: function} that leaves out what a scene does not need, for
    flocsim.compiler.composer.compose: of so many bodies (inf: of any number), with forces along
    ``outlines`` or without, some of them between ``charges``; ``plain``: whether no kernel reads
    the numbers of shapes; with the resistance of ``water`` between two bodies, or without."""
    found: dict[Callable, Callable] = {}
    if plain:
        found |= {views.body_view: views.plain_body_view}
    if not outlines:
        found |= {
            forces.add_outline_forces: add_none,
            jacobian.add_outline_derivatives: differentiate_none,
            outline_sum.outline_repulsion: none_apart,
        }
    if not charges:
        found |= {charge_sum.sum_charges: charge_sum.no_charges}
    if not water:
        found |= pair_resistance.LEFT_OUT
    if bodies < FEWEST:
        found |= {choose_method: choose_method, step_across: step_across}
    if bodies <= DENSE:
        found |= {
            body_pairs.list_near: list_none,
            body_pairs.travelled_share: none_wandered,
            body_pairs.time_to_travel: never_wanders,
            elimination.factorise_sparse: factorise_none,
            elimination.solve_sparse: solve_none,
        }
    return found
