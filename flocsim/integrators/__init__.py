"""Integrators: each gives its step; loop, error control, events and recording exist once.

``base``: the contract.  ``parts``: the pieces that a method of one's own may call.  ``rhs``: forces
and their derivatives.  ``events``: what ends a step early.  ``loop``: the driver.  ``radau``: the
stages of the implicit methods.  May import geometry, body and what is below.
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
