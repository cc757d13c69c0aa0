"""What replaces the code for forces that a scene does not have: nothing, which compiles at once."""

from flocsim import hooks as slots
from flocsim.geometry.contact import candidates
from flocsim.integrators.events import first_event as grain
from flocsim.integrators.rhs import forces as explicit
from flocsim.integrators.rhs import jacobian


def no_forces(scene, work, time, state):
    """No such forces."""


def no_derivatives(scene, work, time):
    """No such forces to differentiate either."""


def no_derivative(scene, work, view, body):
    """No kernel reads it, so there is nothing to differentiate."""


def no_reach(scene, work, a, b, skin, reach):
    """No surface force reaches anywhere: the contact list's own skin will do."""
    return skin


def no_kink(scene, work, share):
    """The contact law is smooth: steps end where pairs switch, and nowhere else."""
    return share


REPLACEMENTS = {
    slots.kink: {grain.kink_share: no_kink},
    slots.surface_force: {
        explicit.add_surface_forces: no_forces,
        jacobian.add_surfaces: no_derivatives,
        candidates.list_for_surface_force: no_reach,
    },
    slots.centre_force: {
        explicit.add_centre_forces: no_forces,
        jacobian.add_centres: no_derivatives,
    },
    slots.velocity_force: {jacobian.add_velocity_derivative: no_derivative},
    slots.position_force: {jacobian.add_position_derivative: no_derivative},
}
"""{slot: {function: replacement where the slot is not filled}}."""


def replacements(filled):
    """{function: replacement} for all slots that a scene leaves empty."""
    found = {}
    for slot, functions in REPLACEMENTS.items():
        if slot not in filled:
            found |= functions
    return found
