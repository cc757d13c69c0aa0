"""What the kernel of a force sees: a body, a pair of bodies, a point of an outline, a contact."""

from collections import namedtuple
from typing import Any, NamedTuple


class BodyView(NamedTuple):
    """One body, as a BodyForce kernel sees it. SI units; angle and spin counter-clockwise.

    ``elongation`` is B = (M₁ − M₂)/(M₁ + M₂) of the shape's principal second moments of area, and
    ``angle + long_axis`` the angle of its long axis; ``kick_x``, ``kick_y`` and ``kick_turn``
    [1/√s] are means of white noise over the present kick, 0 where a scene has no random forces.

    ``resistance_xx`` … and ``strain_xx_x`` …: in the frame of the shape, over the viscosity, the
    symmetric R of (v_x, v_y, spin) [m, m², m³] and what E_xx = −E_yy, and E_xy, put on a body that
    goes along [m², m², m³] (flocsim.hydrodynamics.PrismDrag), 0 where no drag follows shapes.

    ``shielding_xx``, ``_xy`` and ``_yy``: Q, symmetric, by which the drag R of a body in a cluster
    of a swarm becomes Q R Q (flocsim.swarms.together.clusters); 1, 0 and 1 elsewhere.
    """

    time: float
    x: float
    y: float
    angle: float
    vx: float
    vy: float
    spin: float
    mass: float
    buoyant_mass: float
    inertia: float
    radius: float
    elongation: float
    long_axis: float
    kick_x: float = 0.0
    kick_y: float = 0.0
    kick_turn: float = 0.0
    resistance_xx: float = 0.0
    resistance_xy: float = 0.0
    resistance_yy: float = 0.0
    resistance_xs: float = 0.0
    resistance_ys: float = 0.0
    resistance_ss: float = 0.0
    strain_xx_x: float = 0.0
    strain_xx_y: float = 0.0
    strain_xx_s: float = 0.0
    strain_xy_x: float = 0.0
    strain_xy_y: float = 0.0
    strain_xy_s: float = 0.0
    shielding_xx: float = 1.0
    shielding_xy: float = 0.0
    shielding_yy: float = 1.0


PlainBodyView: Any = namedtuple(  # type: ignore[misc]
    "PlainBodyView", BodyView._fields[: BodyView._fields.index("resistance_xx")]
)
"""BodyView without the numbers of its shape, where no kernel of a scene reads any."""


NUMBERS_OF_SHAPES = frozenset(BodyView._fields) - frozenset(PlainBodyView._fields)
"""What a BodyView has besides."""


class PairView(NamedTuple):
    """Two bodies, as a CentreForce or SurfaceForce kernel sees them.

    ``gap`` [m] is d_c − r_i − r_j for a CentreForce, the smooth distance between the outlines for a
    SurfaceForce; ``gap_rate`` [m/s] its rate of change; radii are equivalent radii.
    """

    time: float
    gap: float
    gap_rate: float
    centre_distance: float
    radius_i: float
    radius_j: float
    reduced_radius: float
    effective_mass: float


class OrientedView(NamedTuple):
    """Two bodies and how they are turned, as an OrientedForce kernel sees them.

    i is the earlier of the two in the list of bodies. ``angle_i`` and ``angle_j`` [rad] are those
    of the bodies, counted from the line that leads from the centroid of i to that of j; ``gap`` [m]
    is d_c − r_i − r_j, and radii are equivalent radii.
    """

    time: float
    gap: float
    centre_distance: float
    angle_i: float
    angle_j: float
    radius_i: float
    radius_j: float
    reduced_radius: float
    effective_mass: float


class OutlineView(NamedTuple):
    """A point of one outline beside another, as an OutlineForce kernel sees it.

    ``gap`` [m] is how far the other outline is from the point, below 0 inside of it;
    ``parted_gap`` the same of outlines that are moved apart to d_min where they are nearer;
    ``plate_gap`` that of two plates which van der Waals forces pull at as strongly there, and
    ``depth_gap`` that of plates which lose as large a share to their depth; ``depth`` [m] that of
    the bodies along the third direction; radii are equivalent radii of both.
    """

    time: float
    gap: float
    parted_gap: float
    plate_gap: float
    depth_gap: float
    depth: float
    radius_i: float
    radius_j: float
    reduced_radius: float
    effective_mass: float


class ContactView(NamedTuple):
    """One contact point, as a ContactForce kernel sees it.

    ``overlap`` [m] > 0 and its rate; ``slip`` [m] the tangential elastic displacement ξ and its
    rate; ``effective_mass`` M = m_i m_j/(m_i + m_j) [kg] of the pair; ``radius_i`` and
    ``radius_j`` [m] are those of the outlines that touch (spheroradii), ``smaller_radius`` the
    equivalent radius of the smaller body.
    """

    overlap: float
    overlap_rate: float
    slip: float
    slip_rate: float
    effective_mass: float
    radius_i: float
    radius_j: float
    smaller_radius: float


def moved_contact(
    view: ContactView, overlap: float, overlap_rate: float, slip: float, slip_rate: float
) -> ContactView:
    """Return the view of the same contact with another overlap, slip, and rates of them."""
    return ContactView(
        overlap, overlap_rate, slip, slip_rate,
        view.effective_mass, view.radius_i, view.radius_j, view.smaller_radius,
    )  # fmt: skip
