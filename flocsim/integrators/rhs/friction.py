"""Tangential displacements and forces: how far bodies roll and slide over each other, how far a
contact can hold, and what it does where next to nothing presses on it.

The rate v_t of the tangential displacement is the rate of a sum of lengths: of the foot along its
edge, of the normal's turn about an end of it, and of what the vertex's disk rolls off,

    dξ = ± ds + D (dφ − dθ_b) + r (dθ_b − dθ_a),

s the foot's place on the edge, φ the direction of the normal, D = r_a + r_b + gap, and
r = r_a + gap/2 the radius at which the disk of the vertex rolls. On the edge's inside the normal
turns with the edge, and at its end the foot stays, so that one formula serves both. Between two
states the displacement is therefore known from where the bodies are, whatever a method makes of the
motion in between: a doublet that turns as one has none, however long its steps. What is left to be
summed over a step is next to nothing: D and r change with the gap, by its change times the turn.

While a contact sticks, ξ is the time integral of v_t. It slides in a direction s = ±1 where |ξ| has
reached what the contact can hold, L (µ k_n Δ/k_t for Coulomb friction), and would outgrow it:

    ξ = s L,  as long as  s v_t > dL/dt.

Both are smooth inside a step, whose flags are frozen (Candidate.sliding); the driver ends it where
one has to change. ξ itself never jumps: it is the solution of dξ/dt = v_t under |ξ| ≤ L, which
cutting ξ at the ends of steps comes near to only as fast as steps get short.

Grazing is what a contact does that closes under its load and opens under its own tangential force.

The tangential force of the contact law acts wherever bodies overlap, however little. Where the load
on a contact has all but gone, that force alone may lift the bodies apart; apart, it is gone, the
load closes the contact again, and so on without end: a sliding mode in the sense of Filippov, whose
cycle is as short as it is resolved finely. In its limit the bodies neither part nor overlap,

    d(gap)/dt = 0,  N = 0,  and a tangential force T of between nothing and that of the closed law

is what it takes for that. T is an unknown of the step; here it is the force of a dashpot across,
T = T₀ − K d(gap)/dt, so stiff that the gap changes by a small share of the tolerance alone. The
bodies slide against each other meanwhile. Such a pair opens for good where T has come to nothing;
where it ceases to slide it sticks again, T being taken over by its spring.
"""

import math

from flocsim.geometry.contact.points import row_radii
from flocsim.hooks import SLIP_LIMIT, has, slip_limit
from flocsim.integrators.rhs.views import contact_view, normal_rate, pressed_view, tangential_rate
from flocsim.state.bodies import ANGLE
from flocsim.state.work import NEW, NOW

FULL = 1.0 - 1e-9
"""A displacement is at its limit from this share of it on."""


def turn_of_normal(work, state, row):
    """The angle by which the normal of a pair has turned since now, within half a turn [rad]."""
    g = work.geometry
    ox, oy = g[NOW, row].normal_x, g[NOW, row].normal_y
    nx, ny = g[state, row].normal_x, g[state, row].normal_y
    return math.atan2(ox * ny - oy * nx, ox * nx + oy * ny)


def rolled(scene, work, state, row):
    """How far the tangential displacement of a pair has grown from now to a state, at the gap of
    now [m]; both are located."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g = work.geometry
    radius_a, radius_b = row_radii(scene, work, row)
    gap = g[NOW, row].gap
    turn_a = work.place[state, a, ANGLE] - work.place[NOW, a, ANGLE]
    turn_b = work.place[state, b, ANGLE] - work.place[NOW, b, ANGLE]
    inside = NOW if g[NOW, row].turning == 0.0 else state
    along = g[inside, row].side * (g[state, row].foot - g[NOW, row].foot)
    about = turn_of_normal(work, state, row) - turn_b
    rolling = (radius_a + 0.5 * gap) * (turn_b - turn_a)
    return along + (radius_a + radius_b + gap) * about + rolling


def rolled_besides(scene, work, state, row):
    """How fast it grows besides, in a state, as the gap is another one than now [m/s]."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g, spin_b = work.geometry, work.velocity[state, b, ANGLE]
    radius_a, radius_b = row_radii(scene, work, row)
    gap, apart = g[state, row].gap, g[state, row].gap - g[NOW, row].gap
    relative = spin_b - work.velocity[state, a, ANGLE]
    about = 0.0
    if g[state, row].turning != 0.0:
        rolling = (radius_a + 0.5 * gap) * relative
        about = (tangential_rate(work, state, row) - rolling) / (radius_a + radius_b + gap)
    return apart * (about + 0.5 * relative)


def limit_in(scene, work, state, row):
    """How far a contact's displacement can go in a state [m]."""
    return slip_limit(scene, contact_view(scene, work, state, row))


def limit_slope(scene, work, state, row):
    """By how much that grows with the overlap [m/m]."""
    view = contact_view(scene, work, state, row)
    by = 1e-6 * abs(view.overlap) + 1e-15
    more = slip_limit(scene, pressed_view(view, view.overlap + by, view.overlap_rate))
    now = slip_limit(scene, pressed_view(view, view.overlap, view.overlap_rate))
    return (more - now) / by if more > now else 0.0


def outgrowth(scene, work, state, row, side):
    """How fast a displacement at its limit, in a direction, would outgrow it [m/s]."""
    growth = -normal_rate(work, state, row) * limit_slope(scene, work, state, row)
    return side * tangential_rate(work, state, row) - growth


def slip_in(scene, work, state, row, stuck):
    """The displacement of a closed pair in a state; ``stuck``: what it is if it sticks [m]."""
    side = work.candidates[row].sliding
    if side == 0:
        return stuck
    return side * limit_in(scene, work, state, row)


def side_of(scene, work, row):
    """In which direction a closed pair slides from now on, 0 where it sticks; its displacement is
    brought to its limit."""
    limit, side = limit_in(scene, work, NOW, row), work.candidates[row].sliding
    if side == 0:
        slip = work.slip[NOW, row]
        if abs(slip) < FULL * limit:
            return 0
        rate = tangential_rate(work, NOW, row)
        side = 1 if slip > 0.0 or (slip == 0.0 and rate > 0.0) else -1
    work.slip[NOW, row] = side * limit
    return side if outgrowth(scene, work, NOW, row, side) > 0.0 else 0


def set_sliding(scene, work):
    """Flag all closed pairs that slide, now; whether any flag has changed."""
    changed = False
    if has(scene, SLIP_LIMIT):
        for row in range(work.tally.candidates):
            candidate = work.candidates[row]
            side = side_of(scene, work, row) if candidate.closed == 1 else 0
            changed = changed or candidate.sliding != side
            candidate.sliding = side
    return changed


def limit_slips(scene, work):
    """Cut the displacements of the closed pairs in NEW to what they can hold there, for methods
    whose steps do not end where a contact begins to slide."""
    if not has(scene, SLIP_LIMIT):
        return
    for row in range(work.tally.candidates):
        if work.candidates[row].closed == 1:
            limit = limit_in(scene, work, NEW, row)
            work.slip[NEW, row] = min(max(work.slip[NEW, row], -limit), limit)


def beyond(scene, work, row, step):
    """(how far a pair is beyond where it ought to have begun or ceased to slide [m], the share of
    the step at which it should have); 0 at the first place where nothing is wrong."""
    side = work.candidates[row].sliding
    if side == 0:
        before = limit_in(scene, work, NOW, row) - abs(work.slip[NOW, row])
        after = limit_in(scene, work, NEW, row) - abs(work.slip[NEW, row])
        if after >= 0.0:
            return 0.0, 1.0
        return -after, root(scene, work, row, step, before, after)
    before = outgrowth(scene, work, NOW, row, side)
    after = outgrowth(scene, work, NEW, row, side)
    if after >= 0.0:
        return 0.0, 1.0
    share = max(before, 0.0) / (max(before, 0.0) - after)
    return -0.5 * after * step * (1.0 - share), share


def root(scene, work, row, step, before, after):
    """Where in the step the room that a sticking pair has left, ``before`` and ``after``, is used
    up, by the cubic through its values and rates at both ends."""
    side = 1.0 if work.slip[NEW, row] > 0.0 else -1.0
    fall = step * outgrowth(scene, work, NOW, row, side)
    end = step * outgrowth(scene, work, NEW, row, side)
    before = max(before, 0.0)
    low, high = 0.0, 1.0
    for _ in range(40):
        share = 0.5 * (low + high)
        rest = 1.0 - share
        # Hermite: values before and after, slopes −fall and −end.
        value = (
            rest * rest * (1.0 + 2.0 * share) * before + share * share * (3.0 - 2.0 * share) * after
        )
        value += share * rest * (share * end - rest * fall)
        if value > 0.0:
            low = share
        else:
            high = share
    return high


STIFFER = 1e5
"""The gap of a pair that grazes is held so many times as stiffly as by inertia, drag and the other
contacts in a step."""


def grazing_force(work, state, row):
    """T of a pair that grazes, in a state [N]."""
    contact = work.contacts[row]
    force = contact.grazing_force
    if state == NOW:
        return force
    return force - contact.grazing_resistance * normal_rate(work, state, row)


def normal_mobility(scene, work, row):
    """Acceleration of the gap for every newton along the normal of a pair [1/kg]."""
    candidate = work.candidates[row]
    total, g = 0.0, work.geometry
    a, b = candidate.vertex_body, candidate.edge_body
    if scene.bodies[a].free == 1.0:
        arm = g[NOW, row].vertex_arm_n
        total += 1.0 / scene.bodies[a].mass + arm * arm / scene.bodies[a].inertia
    if scene.bodies[b].free == 1.0:
        arm = g[NOW, row].edge_arm_n
        total += 1.0 / scene.bodies[b].mass + arm * arm / scene.bodies[b].inertia
    return total


def coupling(scene, work, row):
    """Acceleration of the gap for every newton along the tangent of a pair [1/kg]."""
    candidate = work.candidates[row]
    total, g = 0.0, work.geometry
    a, b = candidate.vertex_body, candidate.edge_body
    if scene.bodies[a].free == 1.0:
        arms = g[NOW, row].vertex_arm_n * g[NOW, row].vertex_arm_t
        total += arms / scene.bodies[a].inertia
    if scene.bodies[b].free == 1.0:
        arms = g[NOW, row].edge_arm_n * g[NOW, row].edge_arm_t
        total += arms / scene.bodies[b].inertia
    return total
