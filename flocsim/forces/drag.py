"""Stokes drag."""

import math
from collections.abc import Callable

import attrs

from flocsim.body import Fluid
from flocsim.fields import flag
from flocsim.forces.base import BodyForce


def flow_at(flow, x, y):
    """(u_x, u_y, Ω) of the flow (u_x, u_y, g_xx, g_xy, g_yx, g_yy) at a place."""
    u_x, u_y, g_xx, g_xy, g_yx, g_yy = flow
    return u_x + g_xx * x + g_xy * y, u_y + g_yx * x + g_yy * y, 0.5 * (g_yx - g_xy)


@attrs.frozen
class StokesDrag(BodyForce):
    """Drag −6πγ r_eq (v − u), and torque −8πγ r_eq³ (ω − Ω) where ``rotational``.

    Viscosity γ and the background flow u, Ω are the fluid's.  Source: Tang et al. (2014), eq. 4;
    the rotational drag of a sphere is an addition, without it nothing would stop a spin.
    """

    rotational: bool = flag(default=True, help="drag torque on spinning bodies")

    def kernel_in(self, fluid: Fluid) -> Callable:
        """Still water needs no flow, and no derivative by the place."""
        return self.kernel if any(fluid.flow) else self.still

    @staticmethod
    def kernel(body, viscosity, flow, rotational):
        """Force and torque on the equivalent sphere in the flow."""
        u, v, turning = flow_at(flow, body.x, body.y)
        translation = 6.0 * math.pi * viscosity * body.radius
        rotation = 8.0 * math.pi * viscosity * body.radius**3 * rotational
        spin = body.spin - turning
        return -translation * (body.vx - u), -translation * (body.vy - v), -rotation * spin

    @staticmethod
    def still(body, viscosity, rotational):
        """Force and torque on the equivalent sphere in still water."""
        translation = 6.0 * math.pi * viscosity * body.radius
        rotation = 8.0 * math.pi * viscosity * body.radius**3 * rotational
        return -translation * body.vx, -translation * body.vy, -rotation * body.spin
