"""Integrators: each gives its step; loop, error control, events and recording exist once."""

from flocsim.integrators.base import Integrator, Status
from flocsim.integrators.dormand_prince import DormandPrince54
from flocsim.integrators.implicit import Implicit
from flocsim.integrators.overdamped import Overdamped
from flocsim.integrators.velocity_verlet import VelocityVerlet

__all__ = [
    "DormandPrince54",
    "Implicit",
    "Integrator",
    "Overdamped",
    "Status",
    "VelocityVerlet",
]
