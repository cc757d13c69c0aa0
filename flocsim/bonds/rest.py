"""Rests and hooks: contacts classified as bonded because their pose was stable under the largest
load.

Where attraction could not carry that load but the contacts do, by their shape, the bond is a hook;
otherwise a rest. A rest shows that the doublet holds, not that no disturbance could open it. Under
thermal motion spheres rest if BARRIER k_B T keep them in their attraction against the load. Shapes,
whose contacts have no such potential, rest if lifting one by the smaller spheroradius against the
load costs as much.

**Hooks.** The contacts of a hook carry the load without tension, whatever the attraction: statics
with friction. Every closed contact exerts on body j a force N n + T t, N ≥ 0, |T| ≤ µ N, along its
normal n and tangent t, and its moment. The load is carried if such forces balance it. By Farkas'
lemma, either all loads that the doublet may meet are balanced, or there is a motion of j relative
to i along which a load does positive work and no possible contact force does negative work. A
motion in the plane (v_x, v_y, ω) has three components. It suffices to test the extreme rays of the
cone of motions along which no contact force does negative work. Each is orthogonal to two extreme
contact forces, so two nested loops find them all.

**Loads.** A load is a force f on j and its reverse on i. In a free doublet that settles askew and
turns, f acts somewhere between the two centroids, reduced across their line, as drag takes up the
rest. All of these are balanced if f at either centroid and a pull along the line of centres are. A
free doublet turns until its faster body hangs below: its loads range from the present one to one
along the line of centres. The load on a fixed receiver does not turn. A doublet in a flow or in a
cluster meets loads from all directions.

Two spheres touch in one point, which carries no pull along the line of centres: no hook.
"""

import math

from flocsim.bonds.certificate import (
    CALM_SPEED,
    HOOK,
    LEVER_TOLERANCE,
    NO_BOND,
    REST,
    are_spheres,
    capacity,
    is_closed,
    resting_contact,
    smaller_bounding_radius,
)
from flocsim.bonds.escape import BARRIER, can_escape, radii_of
from flocsim.compiler.linker import apart
from flocsim.geometry.contact.points import contact_point
from flocsim.hooks import CONTACT_FORCE, SLIP_LIMIT, contact_force, has, slip_limit
from flocsim.integrators.rhs.views import contact_view
from flocsim.state.bodies import ANGLE
from flocsim.state.work import NOW

STABLE_POSE = 1e-3
"""A pose is stable if it has changed by less than this share of the path at drift velocity."""

HANGING_COSINE = 0.99
"""Cosine between line of centres and drift above which the load is at its largest."""

NESTED_DISTANCE = 0.1
"""Centres closer than this share of r_i + r_j are nested: the load has no lever to turn the
doublet. Nested pairs turn slower by this factor, and count as bonded after 1/NESTED_DISTANCE rest
times."""

REST_TURNS = 3.0
"""Automatic rest time, in units of the time (r_i + r_j)/|relative drift|."""


def is_swinging(scene, work, i, j, load):
    """Return True if a doublet that turns to hang is still swinging.

    It passes the direction of its largest load, but may yet be thrown open. A doublet that meets
    loads from all directions turns with the flow or its cluster and does not swing.
    """
    outer = scene.bodies[i].bounding_radius + scene.bodies[j].bounding_radius
    turns = load.x != 0.0 or load.y != 0.0
    return turns and abs(work.velocity[NOW, i, ANGLE]) * outer > CALM_SPEED * load.drift


def has_kept_pose(scene, bond, load, rested):
    """Return True if a pose kept for ``rested`` rest times shows that the bond holds.

    The load is largest where the faster body hangs straight below. A fixed receiver cannot turn, so
    this is not required of it, nor of loads from all directions. A nest, or a pair across a
    barrier, must keep its pose for 1/NESTED_DISTANCE rest times.
    """
    near = bond.gap >= 0.0 or bond.distance < NESTED_DISTANCE * radii_of(scene, bond)
    if near and NESTED_DISTANCE * rested >= 1.0:
        return True
    hangs = bond.nx * load.x + bond.ny * load.y >= HANGING_COSINE or (
        load.x == 0.0 and load.y == 0.0
    )
    hangs = hangs or scene.bodies[bond.i].free == 0.0 or scene.bodies[bond.j].free == 0.0
    return bond.gap < 0.0 and hangs and rested >= 1.0


def outlasts_kicks(scene, work, time, bond, load):
    """Return True if thermal kicks leave the bond at rest."""
    barrier = BARRIER * load.kicks
    if not are_spheres(scene, bond):
        radii = scene.bodies[bond.i].radius, scene.bodies[bond.j].radius
        # The energy to lift a shape by the smaller spheroradius against the load.
        return load.force > 0.0 and load.force * min(radii[0], radii[1]) >= barrier
    return load.force > 0.0 and not can_escape(scene, work, time, bond, load.force, barrier)


def kind_at_rest(scene, work, time, bond, load, rested):
    """Return HOOK, REST or NO_BOND for a bond whose pose was kept for ``rested`` rest times."""
    if not has_kept_pose(scene, bond, load, rested):
        return NO_BOND
    if load.kicks > 0.0 and not outlasts_kicks(scene, work, time, bond, load):
        return NO_BOND
    # A hook carries what attraction cannot.
    attraction, _, _ = capacity(scene, work, time, bond, 0.0, (load.force, -1.0, math.inf))
    return HOOK if attraction <= load.force and is_hooked(scene, work, bond, load) else REST


UNLIMITED_FRICTION = 10.0
"""Friction coefficient of contacts without a Coulomb limit: a bond that needs |T| > 10 N at a
contact does not count as held by its shape."""

EXTREME_FORCES = 4
"""Extreme forces of a contact: both sides of its friction cone, at both ends of its width."""

ROUNDING = 1e-9
"""Components of a unit motion below this count as zero."""


def least_friction(scene, work):
    """Return µ, the smallest ratio |T|/N that the closed contacts can hold.

    Between LEVER_TOLERANCE and UNLIMITED_FRICTION; 0 without contacts or contact forces.
    """
    least = 0.0
    if not has(scene, CONTACT_FORCE):
        return least
    for row in range(work.tally.candidates):
        if is_closed(work, row):
            view = contact_view(scene, work, NOW, row)
            resting = resting_contact(view, 0.0)
            limit = slip_limit(scene, resting) if has(scene, SLIP_LIMIT) else math.inf
            # Without a limit: tangential force at a displacement equal to the overlap.
            slip = limit if limit < math.inf else view.overlap
            normal, tangential = contact_force(scene, resting_contact(view, slip))
            friction = abs(tangential) / normal if normal > 0.0 else 0.0
            # A law with a tangential force but no Coulomb limit.
            if friction > 0.0 and not limit < math.inf:
                friction = UNLIMITED_FRICTION
            friction = min(max(friction, LEVER_TOLERANCE), UNLIMITED_FRICTION)
            least = friction if least == 0.0 else min(least, friction)
    return least


def normal_on(work, bond, row):
    """Return the unit vector along which a contact pushes body j."""
    geometry = work.geometry[NOW, row]
    x, y = geometry.normal_x, geometry.normal_y
    return (x, y) if work.candidates[row].vertex_body == bond.j else (-x, -y)


def extreme_force(work, bond, size, friction, edge):
    """Return (f_x, f_y, moment about j's centroid over ``size``) of an extreme force on j.

    ``edge`` numbers them: contact row times EXTREME_FORCES plus 0 to 3.
    """
    row = edge // EXTREME_FORCES
    nx, ny = normal_on(work, bond, row)
    x, y = contact_point(work, row, bond.j)
    # The two ends of the contact's width, along the tangent.
    aside = LEVER_TOLERANCE * size if edge % 2 == 0 else -LEVER_TOLERANCE * size
    x, y = (x - aside * ny) / size, (y + aside * nx) / size
    # The two sides of the friction cone.
    along = friction if edge % EXTREME_FORCES < 2 else -friction
    px, py = nx - along * ny, ny + along * nx
    return px, py, x * py - y * px


def orthogonal_motion(one, other):
    """Return the vector product: the motion along which neither of two generalised forces does
    work."""
    a, b, c = one
    d, e, f = other
    return b * f - c * e, c * d - a * f, a * e - b * d


def is_allowed(work, bond, size, friction, motion):
    """Return True if no possible force of any contact does negative work along a motion.

    ``motion``: velocity of j's centroid and ``size`` times its rotation.
    """
    vx, vy, turn = motion
    for row in range(work.tally.candidates):
        if not is_closed(work, row):
            continue
        nx, ny = normal_on(work, bond, row)
        x, y = contact_point(work, row, bond.j)
        ux, uy = vx - turn * y / size, vy + turn * x / size
        normal, along = nx * ux + ny * uy, nx * uy - ny * ux
        # The least work per normal force, over both sides of the friction cone and both ends of the
        # width.
        if normal - LEVER_TOLERANCE * abs(turn) - friction * abs(along) < -ROUNDING:
            return False
    return True


def load_works(scene, bond, load, size, motion):
    """Return True if one of the loads that the doublet may meet does positive work along a
    motion."""
    vx, vy, turn = motion
    reach = turn * bond.distance / size
    # The velocity of j's rigid extension at i's centroid.
    tx, ty = vx + reach * bond.ny, vy - reach * bond.nx
    at_j, at_i = load.x * vx + load.y * vy, load.x * tx + load.y * ty
    # Loads from all directions: any motion of either point.
    if load.x == 0.0 and load.y == 0.0:
        return vx * vx + vy * vy + tx * tx + ty * ty > ROUNDING * ROUNDING
    # A fixed body: the load acts at the free one and does not turn.
    if scene.bodies[bond.i].free == 0.0:
        return at_j > ROUNDING
    if scene.bodies[bond.j].free == 0.0:
        return at_i > ROUNDING
    pulling = bond.nx * vx + bond.ny * vy
    askew = load.x * bond.nx + load.y * bond.ny
    if askew < 0.0:
        # The doublet turns by more than 90°: all loads across the line on that side, and along it.
        at_j, at_i, pulling = at_j - askew * pulling, at_i - askew * pulling, abs(pulling)
    return max(at_j, at_i, pulling) > ROUNDING


@apart
def is_hooked(scene, work, bond, load):
    """Return True if the contacts of the two bodies carry every load that the doublet may meet."""
    friction, size = least_friction(scene, work), smaller_bounding_radius(scene, bond.i, bond.j)
    if friction == 0.0 or are_spheres(scene, bond):
        return False
    count = EXTREME_FORCES * work.tally.candidates
    for first in range(count):
        if not is_closed(work, first // EXTREME_FORCES):
            continue
        first_force = extreme_force(work, bond, size, friction, first)
        for second in range(first):
            if not is_closed(work, second // EXTREME_FORCES):
                continue
            # A candidate extreme ray: orthogonal to two extreme contact forces.
            x, y, turn = orthogonal_motion(
                first_force, extreme_force(work, bond, size, friction, second)
            )
            length = math.sqrt(x * x + y * y + turn * turn)
            if length <= ROUNDING:
                continue
            # Both senses; an allowed motion along which a load does work opens the bond.
            for scale in (1.0 / length, -1.0 / length):
                motion = x * scale, y * scale, turn * scale
                if load_works(scene, bond, load, size, motion) and is_allowed(
                    work, bond, size, friction, motion
                ):
                    return False
    return True
