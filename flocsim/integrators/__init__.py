"""Integrators: each gives its step; loop, error control, events and recording exist once."""

from flocsim.integrators.base import Integrator, Status
from flocsim.integrators.implicit import Implicit
from flocsim.integrators.velocity_verlet import VelocityVerlet

__all__ = ["Implicit", "Integrator", "Status", "VelocityVerlet"]
