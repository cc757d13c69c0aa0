"""Views: the read-only arguments that kernels of forces receive for a body, a pair, an outline
point or a contact."""

from collections import namedtuple
from typing import Any, NamedTuple


class BodyView(NamedTuple):
    """One body, as a BodyForce kernel receives it. SI units; angle and spin counter-clockwise.

    ``radius`` is the equivalent radius [m]. ``elongation`` is B = (M₁ − M₂)/(M₁ + M₂) of the
    principal second moments of area, and ``angle + long_axis`` the angle of the long axis.
    ``kick_x``, ``kick_y`` and ``kick_turn`` [1/√s] are means of white noise over the present kick,
    0 without random forces.

    ``resistance_xx`` … and ``strain_xx_x`` … are, in the frame of the shape and over the viscosity,
    the symmetric resistance R to (v_x, v_y, spin) [m, m², m³], and the load Γ of the strains E_xx =
    −E_yy and E_xy on a body that moves with the flow [m², m², m³]
    (flocsim.hydrodynamics.PrismDrag); 0 unless a drag follows shapes.

    ``shielding_xx``, ``_xy`` and ``_yy`` are the symmetric matrix Q by which the drag R of a body
    in a cluster of a swarm becomes Q R Q (flocsim.swarms.together.clusters); 1, 0 and 1 elsewhere.
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
"""BodyView without the last 15 fields, for scenes in which no kernel reads them: engines then
compile a fifth faster."""


NUMBERS_OF_SHAPES = frozenset(BodyView._fields) - frozenset(PlainBodyView._fields)
"""Fields of BodyView that PlainBodyView lacks."""


class PairView(NamedTuple):
    """Two bodies, as a CentreForce or SurfaceForce kernel receives them.

    ``gap`` [m] is d_c − r_i − r_j for a CentreForce, and the smooth distance of the outlines for a
    SurfaceForce; ``gap_rate`` [m/s] is its rate of change. Radii are equivalent radii;
    ``reduced_radius`` is r_i r_j/(r_i + r_j), ``effective_mass`` m_i m_j/(m_i + m_j).
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
    """Two bodies and their orientations, as an OrientedForce kernel receives them.

    i is the earlier of the two in the list of bodies. ``angle_i`` and ``angle_j`` [rad] are the
    angles of the bodies relative to the line from the centroid of i to that of j. ``gap`` [m] is
    d_c − r_i − r_j; radii are equivalent radii.
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
    """A point of one outline near another, as an OutlineForce kernel receives it.

    ``gap`` [m]: distance of the other outline, negative inside of it. ``parted_gap``: the same with
    the outlines moved apart to d_min if they are closer. ``plate_gap``: gap of two plates with the
    same van der Waals attraction as here. ``depth_gap``: gap of plates that lose the same share of
    it by their finite depth. ``depth`` [m]: extent of the bodies in the third direction. Radii are
    equivalent radii.
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
    """One contact point, as a ContactForce kernel receives it.

    ``overlap`` [m] > 0 and its rate [m/s]; ``slip`` [m], the tangential elastic displacement ξ, and
    its rate; ``effective_mass`` M = m_i m_j/(m_i + m_j) [kg] of the pair of bodies; ``radius_i``
    and ``radius_j`` [m], the spheroradii in contact; ``smaller_radius`` [m], the equivalent radius
    of the smaller body.
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
    """Return the view of the same contact with another overlap, slip, and rates of both."""
    return ContactView(
        overlap, overlap_rate, slip, slip_rate,
        view.effective_mass, view.radius_i, view.radius_j, view.smaller_radius,
    )  # fmt: skip
