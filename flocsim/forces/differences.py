"""By how much kernels are shifted to take their derivatives, and the views shifted by that.

The laws take the differences themselves: one call of a law costs less than one for every shift.
"""

from flocsim.arrays import BodyView, ContactView, PlainBodyView


def body_change(view, axis):
    """How much to change x, y, angle (axis 0–2) or vx, vy, spin (3–5) by [m, rad, m/s, rad/s]."""
    if axis < 3:
        return 1e-6 if axis == 2 else 1e-6 * view.radius
    floor = 1e-9 / view.radius if axis == 5 else 1e-9
    return 1e-3 * abs((view.vx, view.vy, view.spin)[axis - 3]) + floor


def changed_body(view, axis, by):
    """A BodyView with one of x, y, angle (axis 0–2) or vx, vy, spin (3–5) changed."""
    return BodyView(
        view.time,
        view.x + by * (axis == 0), view.y + by * (axis == 1), view.angle + by * (axis == 2),
        view.vx + by * (axis == 3), view.vy + by * (axis == 4), view.spin + by * (axis == 5),
        view.mass, view.buoyant_mass, view.inertia, view.radius,
        view.elongation, view.long_axis, view.kick_x, view.kick_y, view.kick_turn,
        view.resistance_xx, view.resistance_xy, view.resistance_yy,
        view.resistance_xs, view.resistance_ys, view.resistance_ss,
        view.strain_xx_x, view.strain_xx_y, view.strain_xx_s,
        view.strain_xy_x, view.strain_xy_y, view.strain_xy_s,
    )  # fmt: skip


def changed_plain_body(view, axis, by):
    """The same of a PlainBodyView."""
    return PlainBodyView(
        view.time,
        view.x + by * (axis == 0), view.y + by * (axis == 1), view.angle + by * (axis == 2),
        view.vx + by * (axis == 3), view.vy + by * (axis == 4), view.spin + by * (axis == 5),
        view.mass, view.buoyant_mass, view.inertia, view.radius,
        view.elongation, view.long_axis, view.kick_x, view.kick_y, view.kick_turn,
    )  # fmt: skip


def contact_change(view, axis):
    """How much to change an overlap, its rate, a slip or its rate (axis 0–3) by [m or m/s]."""
    value = (view.overlap, view.overlap_rate, view.slip, view.slip_rate)[axis]
    floor = 1e-13 if axis % 2 == 0 else 1e-9
    return 1e-3 * abs(value) + floor


def changed_contact(view, axis, by):
    """A ContactView with its overlap, overlap rate, slip or slip rate (axis 0–3) changed."""
    return ContactView(
        view.overlap + by * (axis == 0), view.overlap_rate + by * (axis == 1),
        view.slip + by * (axis == 2), view.slip_rate + by * (axis == 3),
        view.effective_mass, view.radius_i, view.radius_j,
    )  # fmt: skip


def pressed_contact(view):
    """A ContactView without what is no overlap, as an own law of contact sees it.

    Steps are tried beyond the end of a contact, where the two surfaces are apart.
    """
    return ContactView(
        max(view.overlap, 0.0), view.overlap_rate, view.slip, view.slip_rate,
        view.effective_mass, view.radius_i, view.radius_j,
    )  # fmt: skip
