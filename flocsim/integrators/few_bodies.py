"""What is left out of a scene of few bodies: the search among many, and sparse systems; of two,
also the steps across switches that Implicit goes over to by itself.

All pairs of few bodies are watched, their systems are dense (flocsim.arrays: ALL_PAIRS, DENSE), and
two are not handed over in a System (backward_euler/choice.py: FEWEST), so that none of this is
reached; leaving it out saves what compiling it takes.
"""

import math
from collections.abc import Callable

import flocsim.arrays as at
from flocsim.geometry.contact import body_pairs
from flocsim.hooks import choose_method, step_across
from flocsim.integrators.backward_euler.choice import FEWEST
from flocsim.integrators.radau import elimination


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


def left_out(bodies: int) -> dict[Callable, Callable]:
    """{hook: function} that leaves out what so many bodies do not need, for
    flocsim.compiler.composer.compose."""
    found: dict[Callable, Callable] = {}
    if bodies < FEWEST:
        found |= {choose_method: choose_method, step_across: step_across}
    if bodies <= at.DENSE:
        found |= {
            body_pairs.list_near: list_none,
            body_pairs.wandered: none_wandered,
            body_pairs.time_to_wander: never_wanders,
            elimination.factorise_sparse: factorise_none,
            elimination.solve_sparse: solve_none,
        }
    return found
