"""Rests and hooks: bonds that have shown to hold, as they kept their pose under the worst load.

Where attraction could not carry the load, and the contacts do by themselves, such a bond is a hook;
what merely has kept its pose is a rest. A rest shows that the doublet holds, not that no kick could
open it. Where thermal motion kicks, spheres rest where BARRIER k_B T keep them in their attraction
against the load, and shapes, whose contacts no potential tells of, where it takes as much to lift
one by the smaller spheroradius against it.

Of a hook the contacts carry the load, whatever attraction there is: statics without tension. Every
closed contact gives body j a force N n + T t, N ≥ 0, |T| ≤ µ N, along its normal n and tangent t,
and its moment. The load hangs from them where such forces balance it. That is so for all loads that
the doublet meets, or there is a motion of j against i that no contact forbids and along which a
load does work (Farkas' lemma); a motion is forbidden where a contact's force could only ever do
negative work along it. In the plane a motion (v_x, v_y, ω) has three numbers, and those to look at
are the edges of what is allowed: each is across two of the contacts' forces, so that two loops over
these find them.

A load is a force f on j and its reverse on i. Of a free doublet that settles askew, and turns, it
acts along f somewhere between the two centroids, and less of it across their line, as drag takes up
the rest: all of these are balanced where f at either centroid and a pull along the line of centres
are. A free doublet turns until its faster body hangs below: its loads go from that of now to one
along the line of centres. That of a fixed receiver does not turn, and one in a flow, or in a
cluster, meets loads from everywhere.

Two spheres touch at one point, and no load along their line of centres is carried there: no hook.
"""

import math

from flocsim.bonds.certificate import (
    CALM,
    HOOK,
    NO_BOND,
    REST,
    are_spheres,
    capacity,
    is_closed,
    lets_out,
    radii_of,
    resting_contact,
    size_of,
)
from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import contact_point
from flocsim.hooks import CONTACT_FORCE, SLIP_LIMIT, contact_force, has, slip_limit
from flocsim.integrators.rhs.climb import BARRIER
from flocsim.integrators.rhs.views import contact_view
from flocsim.state.bodies import ANGLE
from flocsim.state.work import NOW

STILL = 1e-3
"""A pair that has moved by less than this share of the drift's way keeps its pose."""

HANGING = 0.99
"""Cosine between line of centres and drift above which the load is at its worst."""

NEST = 0.1
"""Centres nearer than this share of r_i + r_j lie nested: the load has no lever to turn them, …"""

FAR_LONGER = 10.0
"""… and they are bound when they have rested for so many rest times."""

REST_TURNS = 3.0
"""Automatic rest time, in turn times (r_i + r_j)/|relative drift|."""


def swings(scene, work, i, j, load):
    """Whether a doublet that turns to hang still swings: it passes the worst direction of its load,
    but may yet be thrown open. One that any load may meet turns with the flow, or its cluster."""
    outer = scene.bodies[i].bounding_radius + scene.bodies[j].bounding_radius
    turns = load.x != 0.0 or load.y != 0.0
    return turns and abs(work.velocity[NOW, i, ANGLE]) * outer > CALM * load.drift


def has_shown(scene, bond, load, rested):
    """Whether a pose kept for so many rest times shows that the bond holds.

    The load is at its worst where the faster body hangs straight below; a fixed receiver cannot
    turn, so it need not, nor one whose load comes from everywhere; a nest, or a pair across a
    barrier, has to keep its pose for far longer.
    """
    near = bond.gap >= 0.0 or bond.distance < NEST * radii_of(scene, bond)
    if near and rested >= FAR_LONGER:
        return True
    hangs = bond.nx * load.x + bond.ny * load.y >= HANGING or (load.x == 0.0 and load.y == 0.0)
    hangs = hangs or scene.bodies[bond.i].free == 0.0 or scene.bodies[bond.j].free == 0.0
    return bond.gap < 0.0 and hangs and rested >= 1.0


def outlasts_kicks(scene, work, time, bond, load):
    """Whether kicks let the bond rest."""
    barrier = BARRIER * load.kicks
    if not are_spheres(scene, bond):
        radii = scene.bodies[bond.i].radius, scene.bodies[bond.j].radius
        return load.force > 0.0 and load.force * min(radii[0], radii[1]) >= barrier
    return load.force > 0.0 and not lets_out(scene, work, time, bond, load.force, barrier)


def kind_at_rest(scene, work, time, bond, load, rested):
    """HOOK or REST of a bond whose pose has been kept for so many rest times, or NO_BOND."""
    if not has_shown(scene, bond, load, rested):
        return NO_BOND
    if load.kicks > 0.0 and not outlasts_kicks(scene, work, time, bond, load):
        return NO_BOND
    borne, _, _ = capacity(scene, work, time, bond, 0.0, (load.force, -1.0, math.inf))
    return HOOK if borne <= load.force and is_hooked(scene, work, bond, load) else REST


GRIP = 10.0
"""Friction µ of contacts without a Coulomb limit: what holds by less than a tenth of the tangential
force being normal is not taken to hold by its shape."""

SLACK = 0.05
"""A pair at rest is as near to its balance as this: so much friction, and so broad a contact, over
the smaller bounding radius, is granted to every one."""

EDGES = 4
"""Extreme forces of a contact: both sides of its friction cone, at both ends of its breadth."""

ROUNDING = 1e-9
"""What counts as nothing of a unit motion."""


def grip_of(scene, work):
    """µ: the least share of their normal forces that the closed contacts hold along the tangent, at
    least SLACK; 0 without contacts or forces at them."""
    least = 0.0
    if not has(scene, CONTACT_FORCE):
        return least
    for row in range(work.tally.candidates):
        if is_closed(work, row):
            view = contact_view(scene, work, NOW, row)
            slip, limit = view.overlap, math.inf
            if has(scene, SLIP_LIMIT):
                limit = slip_limit(scene, resting_contact(view, 0.0))
            if limit < math.inf:
                slip = limit
            normal, tangential = contact_force(scene, resting_contact(view, slip))
            grip = abs(tangential) / normal if normal > 0.0 else 0.0
            if grip > 0.0 and not limit < math.inf:
                grip = GRIP
            grip = min(max(grip, SLACK), GRIP)
            least = grip if least == 0.0 else min(least, grip)
    return least


def normal_on(work, bond, row):
    """The unit vector along which a contact pushes body j."""
    geometry = work.geometry[NOW, row]
    x, y = geometry.normal_x, geometry.normal_y
    return (x, y) if work.candidates[row].vertex_body == bond.j else (-x, -y)


def push_of(work, bond, size, grip, edge):
    """(x, y, moment about j's centroid over ``size``) of an extreme force on j."""
    row = edge // EDGES
    nx, ny = normal_on(work, bond, row)
    x, y = contact_point(work, row, bond.j)
    aside = SLACK * size if edge % 2 == 0 else -SLACK * size
    x, y = (x - aside * ny) / size, (y + aside * nx) / size
    along = grip if edge % EDGES < 2 else -grip
    px, py = nx - along * ny, ny + along * nx
    return px, py, x * py - y * px


def across(one, other):
    """The vector product: the motion along which neither of two forces does work."""
    a, b, c = one
    d, e, f = other
    return b * f - c * e, c * d - a * f, a * e - b * d


def is_allowed(work, bond, size, grip, motion):
    """Whether no force of any contact does negative work along a motion (of j's centroid; ``size``
    times its turn)."""
    vx, vy, turn = motion
    for row in range(work.tally.candidates):
        if not is_closed(work, row):
            continue
        nx, ny = normal_on(work, bond, row)
        x, y = contact_point(work, row, bond.j)
        ux, uy = vx - turn * y / size, vy + turn * x / size
        normal, along = nx * ux + ny * uy, nx * uy - ny * ux
        # Turning moves the ends of its breadth along the normal.
        if normal - SLACK * abs(turn) - grip * abs(along) < -ROUNDING:
            return False
    return True


def load_works(scene, bond, load, size, motion):
    """Whether one of the loads that the doublet meets does work along a motion."""
    vx, vy, turn = motion
    reach = turn * bond.distance / size
    # There, the motion of j's body where i's centroid is.
    tx, ty = vx + reach * bond.ny, vy - reach * bond.nx
    at_j, at_i = load.x * vx + load.y * vy, load.x * tx + load.y * ty
    if load.x == 0.0 and load.y == 0.0:
        return vx * vx + vy * vy + tx * tx + ty * ty > ROUNDING * ROUNDING
    if scene.bodies[bond.i].free == 0.0:
        return at_j > ROUNDING
    if scene.bodies[bond.j].free == 0.0:
        return at_i > ROUNDING
    pulling = bond.nx * vx + bond.ny * vy
    askew = load.x * bond.nx + load.y * bond.ny
    if askew < 0.0:
        # It turns by more than a quarter: all loads across the line to that side, and along it.
        at_j, at_i, pulling = at_j - askew * pulling, at_i - askew * pulling, abs(pulling)
    return max(at_j, at_i, pulling) > ROUNDING


@apart
def is_hooked(scene, work, bond, load):
    """Whether the contacts of the two carry every load that the doublet meets."""
    grip, size = grip_of(scene, work), size_of(scene, bond.i, bond.j)
    if grip == 0.0 or are_spheres(scene, bond):
        return False
    count = EDGES * work.tally.candidates
    for first in range(count):
        if not is_closed(work, first // EDGES):
            continue
        one = push_of(work, bond, size, grip, first)
        for second in range(first):
            if not is_closed(work, second // EDGES):
                continue
            x, y, turn = across(one, push_of(work, bond, size, grip, second))
            length = math.sqrt(x * x + y * y + turn * turn)
            if length <= ROUNDING:
                continue
            for way in (1.0 / length, -1.0 / length):
                motion = x * way, y * way, turn * way
                if load_works(scene, bond, load, size, motion) and is_allowed(
                    work, bond, size, grip, motion
                ):
                    return False
    return True
