"""BackwardEuler: steps that go on across switches, as a method of its own."""

from collections.abc import Callable

import attrs

from flocsim.fields import quantity
from flocsim.hooks import note_step
from flocsim.integrators.backward_euler.step import euler_step, next_across, note_rates
from flocsim.integrators.base import Integrator

RESOLVED_BOUNCE = 0.003
"""Steps are this share of 1/ω0 at most while bodies touch that fly apart again."""


@attrs.frozen
class BackwardEuler(Integrator):
    """Backward Euler with the contacts of each step's end, of first order: for beds at rest.

    Steps go on across any number of switches. Impacts from which bodies would fly apart again by
    more than the tolerance are resolved by some thousand steps each. Parameters: ``tolerance`` [m],
    the error of a step in the place of any outline point, what its velocity error leads to
    included; ``first_step`` [s].

    Source: Moreau (1988), Jean (1999), for contacts that are springs.
    """

    across = True
    tolerance: float = quantity("m", above=0.0, default=1e-9)
    first_step: float = quantity("s", above=0.0, default=1e-6)

    @staticmethod
    def attempt(scene, work, clock, step):
        """One step: error over tolerance, or −1 where its end is not found."""
        ratio, bounce = euler_step(scene, work, clock, step, True)
        return max(ratio, step * bounce / RESOLVED_BOUNCE) if ratio >= 0.0 else ratio

    @staticmethod
    def next_step(clock, step, ratio):
        """Errors go with h², and with h where contacts switch."""
        return next_across(clock, step, ratio)

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """What is kept of a step for the estimate of the next."""
        return {note_step: note_rates}
