"""Overdamped: no inertia, for scenes of small Stokes number."""

from collections.abc import Callable

import attrs

from flocsim.integrators.implicit import Implicit
from flocsim.integrators.rhs.views import inertia


def massless(scene, body, axis):
    """No inertia: forces balance at every instant."""
    return 0.0


@attrs.frozen
class Overdamped(Implicit):
    """The method of Implicit without inertia: drag balances all other forces at every instant.

    For Stokes numbers far below 1, where a body has forgotten its velocity before it has moved.
    The velocities given at the start do not matter. Every body needs a drag on each of its
    coordinates: rotational drag, too. Parameters as for Implicit.
    """

    @property
    def replaces(self) -> dict[Callable, Callable]:
        """No inertia besides what Implicit replaces."""
        return {**super().replaces, inertia: massless}
