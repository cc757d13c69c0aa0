"""Stokes drag."""

import math

import attrs

from flocsim.fields import flag
from flocsim.forces.base import BodyForce


@attrs.frozen
class StokesDrag(BodyForce):
    """Drag −6πγ r_eq (v − u), and torque −8πγ r_eq³ (ω − Ω) where ``rotational``.

    Viscosity γ and the background flow u, Ω are the fluid's.  Source: Tang et al. (2014), eq. 4;
    the rotational drag of a sphere is an addition, without it nothing would stop a spin.
    """

    rotational: bool = flag(default=True, help="drag torque on spinning bodies")

    @staticmethod
    def kernel(body, viscosity, flow, rotational):
        """Force and torque on the equivalent sphere in the flow (u_x, u_y, g_xx, g_xy, g_yx, g_yy)."""
        u_x, u_y, g_xx, g_xy, g_yx, g_yy = flow
        u = u_x + g_xx * body.x + g_xy * body.y
        v = u_y + g_yx * body.x + g_yy * body.y
        translation = 6.0 * math.pi * viscosity * body.radius
        rotation = 8.0 * math.pi * viscosity * body.radius**3 * rotational
        turning = 0.5 * (g_yx - g_xy)
        return (
            -translation * (body.vx - u),
            -translation * (body.vy - v),
            -rotation * (body.spin - turning),
        )
