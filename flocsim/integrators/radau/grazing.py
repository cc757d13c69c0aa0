"""Grazing contacts in an implicit step: whether they exist, and how stiff their dashpots are.

The tangential force of a grazing contact is an unknown of the step (rhs/friction.py). It acts as a
dashpot on the rate of the gap, much stiffer than the rest of the system. How the gap responds to a
tangential force depends on the other contacts as well: it follows from the step's own system
without the dashpot. Where the force would close the gap instead of opening it, the load opens it,
and the contact is open. The response of two free bodies is no substitute: it is wrong where a
second contact holds them.
"""

from flocsim.integrators.radau.systems import solve_prepared
from flocsim.integrators.radau.tableau import REAL
from flocsim.integrators.rhs.error import NEGLIGIBLE
from flocsim.integrators.rhs.friction import GRAZING_STIFFNESS_RATIO
from flocsim.integrators.rhs.jacobian import normal_rows, tangent_rows
from flocsim.integrators.rhs.views import normal_rate, velocity_lifetime_of
from flocsim.state.contacts import GRAZING, OPEN
from flocsim.state.work import NOW


def any_grazes(work):
    """Return True if a contact grazes."""
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == GRAZING:
            return True
    return False


def clear_grazing_resistances(work):
    """Remove the dashpots of all grazing contacts."""
    for row in range(work.tally.candidates):
        work.contacts[row].grazing_resistance = 0.0


def tangential_response(scene, work, row):
    """Return the gap rate and the tangential rate per tangential force of a pair [m/(N s)].

    The factorised real system is solved for a unit force.
    """
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    across, along = tangent_rows(work, row), normal_rows(work, row)
    for each in range(work.loads.shape[1]):
        work.loads[REAL, each] = 0.0
    for axis in range(3):
        work.loads[REAL, 3 * a + axis] = across[0][axis]
        work.loads[REAL, 3 * b + axis] = across[1][axis]
    solve_prepared(scene, work)
    # Project the velocities of both bodies on the normal and on the tangent.
    opening, sliding = 0.0, 0.0
    for axis in range(3):
        first, second = work.loads[REAL, 3 * a + axis].real, work.loads[REAL, 3 * b + axis].real
        opening += along[0][axis] * first + along[1][axis] * second
        sliding += across[0][axis] * first + across[1][axis] * second
    return opening, sliding


def can_begin_grazing(work, clock, row, lifting, sliding):
    """Return True if the force of a contact that just opened lifts it, and can stop the opening
    gently: a tangential displacement by that impulse of at most NEGLIGIBLE of the tolerance.

    ``lifting`` and ``sliding`` are its tangential_response.
    """
    if lifting * work.contacts[row].grazing_force <= 0.0:
        return False
    displacement = abs(sliding * normal_rate(work, NOW, row)) * velocity_lifetime_of(work, row)
    return displacement <= NEGLIGIBLE * clock.tolerance * abs(lifting)


def set_grazing_resistances(scene, work, clock):
    """Set the dashpots of all grazing contacts; open those that their own force does not lift.

    Return True if one has been opened. The factors are those of the system without dashpots.
    """
    opened = False
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.contact_mode == GRAZING:
            contact = work.contacts[row]
            lifting, sliding = tangential_response(scene, work, row)
            # Open where the force cannot lift the contact, as the dashpot would be stiffer again
            # than the system by the same ratio, or where grazing cannot begin.
            weak = GRAZING_STIFFNESS_RATIO * abs(lifting) <= abs(sliding)
            is_new = contact.newly_grazing != 0.0
            if weak or (is_new and not can_begin_grazing(work, clock, row, lifting, sliding)):
                candidate.contact_mode, opened = OPEN, True
                work.slip[NOW, row] = 0.0
            else:
                # The ratio times the resistance that the system itself has to a change of the gap.
                contact.grazing_resistance = GRAZING_STIFFNESS_RATIO / lifting
    return opened
