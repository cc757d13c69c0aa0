"""Derivatives of the contact forces, taken from the kernels by differences."""

from flocsim.integrators.products import add_product, normal_rows, tangent_rows
from flocsim.integrators.turning import add_turning
from flocsim.integrators.views import contact_view
from flocsim.layout import CANDIDATES, CLOSED, DAMPING, NOW, STIFFNESS
from flocsim.slots import contact_force
from flocsim.state import ContactView


def changed_view(view, axis, by):
    """A ContactView with its overlap, overlap rate, slip or slip rate (axis 0–3) changed."""
    return ContactView(
        view.overlap + by * (axis == 0), view.overlap_rate + by * (axis == 1),
        view.slip + by * (axis == 2), view.slip_rate + by * (axis == 3),
        view.effective_mass, view.radius_i, view.radius_j,
    )  # fmt: skip


def change_of(view, axis):
    """How much to change one entry of a view by for a difference [m or m/s]."""
    value = (view.overlap, view.overlap_rate, view.slip, view.slip_rate)[axis]
    floor = 1e-13 if axis % 2 == 0 else 1e-9
    return 1e-3 * abs(value) + floor


def add_contact(scene, work, row):
    """The derivatives of one contact's forces."""
    a, b = work.candidates[row, 0], work.candidates[row, 2]
    view = contact_view(scene, work, NOW, row)
    normal, tangential = contact_force(view, scene.parameters)
    along, across = normal_rows(work, row), tangent_rows(work, row)
    for axis in range(4):
        size = change_of(view, axis)
        more, further = contact_force(changed_view(view, axis, size), scene.parameters)
        # An overlap grows against the normal, a slip along the tangent.
        sign, by = (1.0, along) if axis < 2 else (-1.0, across)
        which = STIFFNESS if axis % 2 == 0 else DAMPING
        add_product(work, which, a, b, along, by, sign * (more - normal) / size)
        add_product(work, which, a, b, across, by, sign * (further - tangential) / size)
    add_turning(scene, work, row, normal, tangential)


def add_contacts(scene, work):
    """The derivatives of all closed pairs."""
    for row in range(work.tally[CANDIDATES]):
        if work.candidates[row, CLOSED] == 1:
            add_contact(scene, work, row)
