"""How pairs that graze are held in an implicit step: how stiffly, and whether at all.

What a tangential force does to the gap hangs on the other contacts, too: it is found by the step's
own system, without what holds the gap. Where the force that a pair had as it parted drives the gap
shut instead of open, the load drives it open, and the pair is apart.
"""

from flocsim.integrators.radau.systems import solve_for_free
from flocsim.integrators.radau.tableau import REAL
from flocsim.integrators.rhs.friction import GRAZING_STIFFNESS_RATIO
from flocsim.integrators.rhs.jacobian import normal_rows, tangent_rows
from flocsim.integrators.rhs.views import normal_rate, velocity_lifetime_of
from flocsim.state.contacts import GRAZING, OPEN
from flocsim.state.work import NOW

LEAST_RESPONSE = 1e-3
"""A tangential force lifts nothing that moves the gap by less than this share of what it moves its
bodies along each other."""


SHARE_OF_START = 0.1
"""What taking the speed away with which it parted moves the bodies of a pair along each other may
be this share of the tolerance, or it does not begin to graze."""


def any_grazes(work):
    """Whether a pair grazes."""
    for row in range(work.tally.candidates):
        if work.candidates[row].contact_mode == GRAZING:
            return True
    return False


def release_gaps(work):
    """Hold no gap."""
    for row in range(work.tally.candidates):
        work.contacts[row].grazing_resistance = 0.0


def response(scene, work, row):
    """The rates of the gap, and along the tangent, for every newton along the tangent of a pair, by
    the factorised system [m/(N s)]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    across, along = tangent_rows(work, row), normal_rows(work, row)
    for each in range(work.loads.shape[1]):
        work.loads[REAL, each] = 0.0
    for axis in range(3):
        work.loads[REAL, 3 * a + axis] = across[0][axis]
        work.loads[REAL, 3 * b + axis] = across[1][axis]
    solve_for_free(scene, work)
    opening, sliding = 0.0, 0.0
    for axis in range(3):
        first, second = work.loads[REAL, 3 * a + axis].real, work.loads[REAL, 3 * b + axis].real
        opening += along[0][axis] * first + along[1][axis] * second
        sliding += across[0][axis] * first + across[1][axis] * second
    return opening, sliding


def can_begin(work, clock, row, found, sliding):
    """Whether the force of a pair that has just parted, with those responses to a newton, lifts it,
    and can take its speed away without moving the bodies much."""
    if found * work.contacts[row].grazing_force <= 0.0:
        return False
    way = abs(sliding * normal_rate(work, NOW, row)) * velocity_lifetime_of(work, row)
    return way <= SHARE_OF_START * clock.tolerance * abs(found)


def hold_gaps(scene, work, clock):
    """Say how stiffly the gaps of pairs that graze are held, by the system without that; let those
    go that their own force does not lift. Whether any has been let go."""
    opened = False
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.contact_mode == GRAZING:
            contact = work.contacts[row]
            found, sliding = response(scene, work, row)
            weak = abs(found) <= LEAST_RESPONSE * abs(sliding)
            fresh = contact.newly_grazing != 0.0
            if weak or (fresh and not can_begin(work, clock, row, found, sliding)):
                candidate.contact_mode, opened = OPEN, True
                work.slip[NOW, row] = 0.0
            else:
                contact.grazing_resistance = GRAZING_STIFFNESS_RATIO / found
    return opened
