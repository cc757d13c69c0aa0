"""Forces between outlines: the pressure of the laws summed over the one in the field of the other.

A body at rest in the field of another has the energy ∫ Ψ dA, and the force −∮ Ψ n ds, torque alike:
what a law gives is −Ψ, the pressure between two plates at that gap. Of the two bodies the smaller
one is gone along. All is in the frame of the other.
"""

import math

import flocsim.arrays as at
from flocsim.arrays import MOST_FEET, OutlineView
from flocsim.compiler.linker import apart
from flocsim.geometry.contact.separation import length_of, separation
from flocsim.geometry.surfaces.attraction import EIGHT, piece_at_point
from flocsim.geometry.surfaces.distances import (
    Pose,
    apart_at_least,
    between_cores,
    distance_to,
    piece_at,
    placed,
)
from flocsim.geometry.surfaces.nodes import at_parameter, ends_of, foot_of
from flocsim.hooks import hook
from flocsim.integrators.rhs.charge_sum import sum_charges
from flocsim.integrators.rhs.orientation import between_oriented
from flocsim.integrators.rhs.views import effective_mass
from flocsim.laws import ORIENTED_ENERGY, OUTLINE_PRESSURE, has, outline_pressure

LENS = 100.0
"""Attraction counts up to so many times √(gap · least gap that is asked for): what is further comes
to less than 1e-5 of the attraction of touching outlines."""

SAME = 1e-3
"""Of the gap: pieces of the other outline that are as near as that are both the nearest, and feet
that are as near to each other are one."""

MOST_HALVES = 40
"""How often a way along a piece is halved: far below any length that counts."""

NO_ATTRACTION = 1e3
"""The gap [m] of plates that stands for none."""


def list_near(scene, work, a, b, pose, reach):
    """List the pieces of two bodies that may be nearer to each other than ``reach``."""
    near, middle = work.near, work.near.shape[0] // 2
    # The first half is a's, the second b's; the first number of each says how many.
    bound_a, bound_b = scene.bodies[a, at.BOUNDING_RADIUS], scene.bodies[b, at.BOUNDING_RADIUS]
    count = 0
    for row in range(scene.first_piece[a], scene.first_piece[a + 1]):
        piece = placed(scene.pieces, row, pose)
        away = math.sqrt(piece.middle_x * piece.middle_x + piece.middle_y * piece.middle_y)
        if away - piece.extent < bound_b + reach:
            count += 1
            near[count] = row
    near[0] = count
    count = 0
    for row in range(scene.first_piece[b], scene.first_piece[b + 1]):
        piece = piece_at(scene.pieces, row)
        dx, dy = piece.middle_x - pose.x, piece.middle_y - pose.y
        if math.sqrt(dx * dx + dy * dy) - piece.extent < bound_a + reach:
            count += 1
            near[middle + count] = row
    near[middle] = count


def gap_listed(scene, work, pose):
    """The least gap of the pieces that are listed [m]; inf where none are."""
    near, middle, least = work.near, work.near.shape[0] // 2, math.inf
    for i in range(near[0]):
        one = placed(scene.pieces, near[1 + i], pose)
        for j in range(near[middle]):
            other = piece_at(scene.pieces, near[middle + 1 + j])
            if apart_at_least(one, other) < least:
                squared, _, _, _, _ = between_cores(one, other)
                least = min(least, math.sqrt(squared) - one.inward - other.inward)
    return least


def look_from(scene, work, x, y, inset, lens):
    """(gap, S) at a point: how far the other outline is [m], and what attraction comes to (of all
    pieces that are listed for it) [1/m³]."""
    near, middle = work.near, work.near.shape[0] // 2
    gap, total = math.inf, 0.0
    for j in range(near[middle]):
        row = near[middle + 1 + j]
        piece = piece_at(scene.pieces, row)
        dx, dy = x - piece.middle_x, y - piece.middle_y
        if math.sqrt(dx * dx + dy * dy) - piece.extent < lens:
            gap = min(gap, distance_to(x, y, piece))
            total += piece_at_point(x, y, piece, inset, lens)
    return gap, total


def gap_from(scene, work, x, y):
    """How far the other outline is from a point [m]."""
    near, middle, gap = work.near, work.near.shape[0] // 2, math.inf
    for j in range(near[middle]):
        piece = piece_at(scene.pieces, near[middle + 1 + j])
        dx, dy = x - piece.middle_x, y - piece.middle_y
        if math.sqrt(dx * dx + dy * dy) - piece.extent < gap:
            gap = min(gap, distance_to(x, y, piece))
    return gap


def find_feet(scene, work, piece, inset, lens):
    """Write the feet of a piece to ``work.feet``, in their order; how many there are. They are the
    places, ends among them, from where the gap within the lens grows either way."""
    near, middle, count = work.near, work.near.shape[0] // 2, 0
    first, last = ends_of(piece)
    for j in range(near[middle]):
        other = piece_at(scene.pieces, near[middle + 1 + j])
        if apart_at_least(piece, other) >= lens:
            continue
        parameter = min(max(foot_of(piece, other), first), last)
        x, y, _, _, metres = at_parameter(piece, parameter)
        gap = distance_to(x, y, other)
        # Only where the other is what lies nearest there.
        same = SAME * (gap + inset)
        if gap < lens and gap <= gap_from(scene, work, x, y) + same:
            count = add_foot(work.feet, count, parameter, same / metres)
    return count


def add_foot(feet, count, parameter, same):
    """Put a foot among those found so far, in their order, unless one is as near as ``same``; how
    many there are then."""
    place = count
    while place > 0 and feet[place - 1] > parameter:
        place -= 1
    if place > 0 and parameter - feet[place - 1] <= same:
        return count
    if (place < count and feet[place] - parameter <= same) or count == MOST_FEET:
        return count
    for k in range(count, place, -1):
        feet[k] = feet[k - 1]
    feet[place] = parameter
    return count + 1


def way_to_gap(scene, work, piece, foot, way, wanted):
    """How far along a piece from a foot, in its parameter and ``way`` at most, the gap has grown to
    the one that is wanted [m]: continuous in where the bodies are, as the quadrature is then."""
    x, y, _, _, _ = at_parameter(piece, foot + way)
    beyond = gap_from(scene, work, x, y)
    if beyond <= wanted:
        return way
    for _ in range(MOST_HALVES):
        x, y, _, _, _ = at_parameter(piece, foot + 0.5 * way)
        gap = gap_from(scene, work, x, y)
        if gap <= wanted:
            return 0.5 * way * (1.0 + (wanted - gap) / (beyond - gap))
        beyond = gap
        way *= 0.5
    return way


def add_side(scene, work, total, piece, foot, there, end, numbers):
    """(fx, fy, torque about the origin) of a piece from a foot, where the gap is that ``there``, to
    an end, added to a total."""
    inset, lens, _ = numbers
    reach = way_to_gap(scene, work, piece, foot, end - foot, lens)
    scale = way_to_gap(scene, work, piece, foot, reach, 3.0 * there + 2.0 * inset)
    near = abs(scale) < abs(reach)
    for node, weight in EIGHT:
        share = 0.5 * (1.0 + node)
        part = 0.5 * abs(scale) * weight
        total = add_node(scene, work, total, piece, foot + share * scale, part, numbers)
    if not near:
        return total
    log = math.log(reach / scale)
    for node, weight in EIGHT:
        way = scale * math.exp(0.5 * log * (1.0 + node))
        total = add_node(
            scene, work, total, piece, foot + way, 0.5 * log * abs(way) * weight, numbers
        )
    return total


def add_node(scene, work, total, piece, parameter, weight, numbers):
    """What acts on a piece at a parameter, over so much of it, added to a total."""
    inset, lens, view = numbers
    x, y, nx, ny, metres = at_parameter(piece, parameter)
    gap, attraction = look_from(scene, work, x, y, inset, lens)
    if not gap < lens:
        return total
    fx, fy, torque = total
    size = -outline_pressure(scene, seen_at(view, gap, attraction, inset, lens)) * weight * metres
    return fx + size * nx, fy + size * ny, torque + size * (x * ny - y * nx)


def seen_at(view, gap, attraction, inset, lens):
    """The OutlineView at a point with a gap and that S, outlines being moved apart by an inset."""
    share = gap / lens
    share *= share
    attraction *= 1.0 - share * share * share
    plates = NO_ATTRACTION
    if attraction < 0.0:
        plates = min(plates, (-0.75 * attraction) ** (-1.0 / 3.0))
    return OutlineView(
        view.time, gap, gap + inset, plates, view.depth, view.radius_i, view.radius_j,
        view.reduced_radius, view.effective_mass,
    )  # fmt: skip


def radii_of(scene, a, b):
    """The equivalent radii of two bodies [m]."""
    return scene.bodies[a, at.EQUIVALENT_RADIUS], scene.bodies[b, at.EQUIVALENT_RADIUS]


def acts_along(scene):
    """Whether anything acts along outlines, or by how bodies are turned."""
    return outline_reach(scene) > 0.0 or has(scene, ORIENTED_ENERGY)


def outline_reach(scene):
    """The gap of outlines up to which anything acts along them [m]; below 0 where nothing does."""
    return max(scene.outlines[0], scene.layer[2])


def depth_of(scene, a, b):
    """The depth along which two bodies act on each other [m]."""
    if scene.outlines[2] > 0.0:
        return scene.outlines[2]
    radius_a, radius_b = radii_of(scene, a, b)
    return 4.0 / 3.0 * min(radius_a, radius_b)


def look_around(scene, work, time, a, b, pose):
    """(inset, lens, OutlineView of the two) of body a in a Pose, the pieces within the lens being
    listed; a lens of 0 where nothing acts along the outlines."""
    reach, floor, _, steady = scene.outlines
    list_near(scene, work, a, b, pose, reach)
    least = gap_listed(scene, work, pose)
    inset, lens = max(0.0, floor - least), 0.0
    if least < reach:
        lens = max(LENS * math.sqrt((least + inset) * floor), steady)
        list_near(scene, work, a, b, pose, lens)
    radius_a, radius_b = radii_of(scene, a, b)
    view = OutlineView(
        time, least, least, least, depth_of(scene, a, b), radius_a, radius_b,
        radius_a * radius_b / (radius_a + radius_b), effective_mass(scene, a, b),
    )  # fmt: skip
    return inset, lens, view


@apart
def sum_along(scene, work, time, a, b, x, y, cosine, sine):
    """(fx, fy, torque about b's centroid) on body a [N, N, N m], in the frame of b, where a lies at
    x, y [m] turned by an angle of that cosine and sine."""
    pose = Pose(x, y, cosine, sine)
    numbers = look_around(scene, work, time, a, b, pose)
    inset, lens, view = numbers
    if lens == 0.0:
        return 0.0, 0.0, 0.0
    total = 0.0, 0.0, 0.0
    for i in range(work.near[0]):
        piece = placed(scene.pieces, work.near[1 + i], pose)
        feet = find_feet(scene, work, piece, inset, lens)
        first, last = ends_of(piece)
        for k in range(feet):
            foot = work.feet[k]
            x_foot, y_foot, _, _, _ = at_parameter(piece, foot)
            there = gap_from(scene, work, x_foot, y_foot)
            low = first if k == 0 else 0.5 * (work.feet[k - 1] + foot)
            high = last if k == feet - 1 else 0.5 * (work.feet[k + 1] + foot)
            if low < foot:
                total = add_side(scene, work, total, piece, foot, there, low, numbers)
            if foot < high:
                total = add_side(scene, work, total, piece, foot, there, high, numbers)
    fx, fy, torque = total
    return view.depth * fx, view.depth * fy, view.depth * torque


def between_outlines(scene, work, time, a, b, x, y, angle_a, angle_b):
    """(fx, fy, torque on a, torque on b) of the forces on body a [N, N, N m], each torque about its
    own centroid, a being seen from b at x, y [m]; b feels the reverse of fx, fy. ``a``: the later
    one of the two."""
    fx, fy, torque_a, torque_b = 0.0, 0.0, 0.0, 0.0
    if outline_reach(scene) > 0.0:
        fx, fy, torque_a, torque_b = between_sized(scene, work, time, a, b, x, y, angle_a, angle_b)
    if has(scene, ORIENTED_ENERGY):
        more = between_oriented(scene, time, a, b, x, y, angle_a, angle_b)
        return fx + more[0], fy + more[1], torque_a + more[2], torque_b + more[3]
    return fx, fy, torque_a, torque_b


def between_sized(scene, work, time, a, b, x, y, angle_a, angle_b):
    """The same of forces along outlines alone."""
    # The smaller one is gone along.
    if scene.bodies[a, at.BOUNDING_RADIUS] > scene.bodies[b, at.BOUNDING_RADIUS]:
        fx, fy, torque_b, torque_a = between_in_order(
            scene, work, time, b, a, -x, -y, angle_b, angle_a
        )
        return -fx, -fy, torque_a, torque_b
    return between_in_order(scene, work, time, a, b, x, y, angle_a, angle_b)


def between_in_order(scene, work, time, a, b, x, y, angle_a, angle_b):
    c, s = math.cos(angle_b), math.sin(angle_b)
    turn = angle_a - angle_b
    seen_x, seen_y = c * x + s * y, c * y - s * x
    cosine, sine = math.cos(turn), math.sin(turn)
    across, up, torque = 0.0, 0.0, 0.0
    if has(scene, OUTLINE_PRESSURE):
        across, up, torque = sum_along(scene, work, time, a, b, seen_x, seen_y, cosine, sine)
    if scene.layer[2] > 0.0:
        fx, fy, turning = sum_charges(scene, a, b, seen_x, seen_y, cosine, sine)
        depth = depth_of(scene, a, b)
        across, up, torque = across + depth * fx, up + depth * fy, torque + depth * turning
    own = torque - (seen_x * up - seen_y * across)
    return c * across - s * up, s * across + c * up, own, -torque


@hook
def outlines_apart(scene, work, time, a, b, way):
    """What pushes two bodies apart along the line of centres [N], a being moved out along it from
    where it is now by a way [m]."""
    x, y = separation(scene, work, at.NOW, a, b)
    distance = length_of(x, y)
    nx, ny = (x / distance, y / distance) if distance > 0.0 else (0.0, 1.0)
    angle_a, angle_b = work.motion[at.NOW, a, at.ANGLE], work.motion[at.NOW, b, at.ANGLE]
    x, y = x + way * nx, y + way * ny
    fx, fy, _, _ = between_outlines(scene, work, time, a, b, x, y, angle_a, angle_b)
    return fx * nx + fy * ny


def outlines_in(scene, work, time, state, a, b):
    """The same of two bodies in a state."""
    x, y = separation(scene, work, state, a, b)
    angle_a, angle_b = work.motion[state, a, at.ANGLE], work.motion[state, b, at.ANGLE]
    return between_outlines(scene, work, time, a, b, x, y, angle_a, angle_b)
