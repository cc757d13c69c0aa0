"""Integrators: each takes its own kind of step; the loop around all of them exists once.

``base``: the contract.  ``parts``: building blocks of a user's own method.  ``implicit``: the
default, made of ``exponential`` (power series) and ``radau`` (Radau IIA).  ``backward_euler``:
beds. ``explicit``: Dormand–Prince and velocity Verlet.  ``rhs``: forces and their derivatives.
``events``: where steps end early.  ``loop``: the driver.  May import geometry, body and what is
below.
"""

from flocsim.integrators.backward_euler.method import BackwardEuler
from flocsim.integrators.base import Integrator, Status
from flocsim.integrators.explicit import DormandPrince54, VelocityVerlet
from flocsim.integrators.implicit import Implicit, Overdamped
from flocsim.integrators.parts import FixedStep

__all__ = [
    "BackwardEuler",
    "DormandPrince54",
    "FixedStep",
    "Implicit",
    "Integrator",
    "Overdamped",
    "Status",
    "VelocityVerlet",
]
