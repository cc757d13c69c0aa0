"""What replaces the code for forces that a scene does not have: nothing, which compiles at once."""

from flocsim import slots
from flocsim.geometry import candidates
from flocsim.integrators import assembly, explicit


def no_explicit(scene, work, time, place, speed):
    """No such forces."""


def no_assembly(scene, work, time, state, step):
    """No such forces in the implicit system either."""


def no_derivative(scene, work, view, body, step):
    """No kernel reads it, so there is nothing to differentiate."""


def no_reach(scene, work, a, b, skin, reach):
    """No surface force reaches anywhere: the contact list's own skin will do."""
    return skin


REPLACEMENTS = {
    slots.surface_force: {
        explicit.add_surface_forces: no_explicit,
        assembly.add_surfaces: no_assembly,
        candidates.list_for_surface_force: no_reach,
    },
    slots.centre_force: {
        explicit.add_centre_forces: no_explicit,
        assembly.add_centres: no_assembly,
    },
    slots.velocity_force: {assembly.add_velocity_derivative: no_derivative},
    slots.position_force: {assembly.add_position_derivative: no_derivative},
}
"""{slot: {function: replacement where the slot is not filled}}."""


def replacements(filled):
    """{function: replacement} for all slots that a scene leaves empty."""
    found = {}
    for slot, functions in REPLACEMENTS.items():
        if slot not in filled:
            found |= functions
    return found
