"""Forces between outlines: the pressure of the laws summed over the one in the field of the other.

A body at rest in the field of another has the energy ∫ Ψ dA, and the force −∮ Ψ n ds, torque alike:
what a law gives is −Ψ, the pressure between two plates at that gap. Of the two bodies the smaller
one is gone along. All is in the frame of the other.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.attraction import add_arc, add_segment, find_plates
from flocsim.geometry.contact.points import length_of, separation
from flocsim.geometry.shapes.pieces import (
    Pose,
    are_within,
    between_cores,
    ends_of,
    may_be_within,
    piece_at,
    placed,
)
from flocsim.hooks import ORIENTED_ENERGY, OUTLINE_PRESSURE, has, hook, outline_pressure
from flocsim.integrators.rhs.charge_sum import sum_charges
from flocsim.integrators.rhs.orientation import between_oriented
from flocsim.integrators.rhs.outline_nodes import MOST_PANELS, find_feet, growth_at, put_side
from flocsim.integrators.rhs.views import effective_mass
from flocsim.state.bodies import ANGLE
from flocsim.state.outlines import (
    MOST_NODES,
    MOST_ORDER,
)
from flocsim.state.views import OutlineView
from flocsim.state.work import NOW

LENS = 300.0
"""Attraction counts up to so many times √(gap · least gap that is asked for): what is further comes
to less than 1e-6 of the attraction of touching outlines, as it fades and is made up for
(attraction.py). A narrower lens takes less time a sum, and more steps."""

SKIN, MOST_SKIN = 1.0, 4.0
"""Pieces are listed to so much further than they count, so that lists last, and anew where it is
more than the latter."""

UNMOVED = Pose(0.0, 0.0, 1.0, 0.0)
"""Of the body in whose frame all is."""

AT_ONCE = 8
"""Nodes that a processor takes at once at most."""


def list_near(scene, work, a, b, pose, reach):
    """List the pieces of two bodies that are nearer to each other than ``reach``."""
    near, listed = work.near, work.listed
    list_within(scene.pieces, near.first, scene.first_piece[a], scene.first_piece[a + 1],
                pose, 0.0, 0.0, scene.bodies[b].bounding_radius + reach)  # fmt: skip
    list_within(scene.pieces, near.second, scene.first_piece[b], scene.first_piece[b + 1],
                UNMOVED, pose.x, pose.y, scene.bodies[a].bounding_radius + reach)  # fmt: skip
    keep_paired(scene.pieces, near.first, pose, near.second, UNMOVED, reach)
    keep_paired(scene.pieces, near.second, UNMOVED, near.first, pose, reach)
    listed.first_body, listed.second_body, listed.reach = a, b, reach
    listed.x, listed.y = pose.x, pose.y
    listed.cosine, listed.sine = pose.cosine, pose.sine


def list_within(pieces, rows, first, last, pose, x, y, reach):
    """List the pieces from ``first`` on, of a body in a Pose, that may be within a reach of a
    point [m]."""
    count = 0
    for row in range(first, last):
        piece = placed(pieces, row, pose)
        dx, dy, most = piece.middle_x - x, piece.middle_y - y, reach + piece.extent
        if dx * dx + dy * dy < most * most:
            count += 1
            rows[count] = row
    rows[0] = count


def keep_paired(pieces, rows, pose, others, other_pose, reach):
    """Keep of some pieces those that are within a reach of one of others [m]."""
    count = 0
    for i in range(1, rows[0] + 1):
        one = placed(pieces, rows[i], pose)
        for j in range(1, others[0] + 1):
            if are_within(one, placed(pieces, others[j], other_pose), reach):
                count += 1
                rows[count] = rows[i]
                break
    rows[0] = count


def slack_of(scene, work, a, b, pose):
    """How near to each other pieces have to be so that they are listed, as bodies lie by now [m];
    below 0 where none are."""
    listed = work.listed
    if listed.first_body != a or listed.second_body != b:
        return -1.0
    way = length_of(pose.x - listed.x, pose.y - listed.y)
    c, s = pose.cosine - listed.cosine, pose.sine - listed.sine
    return listed.reach - way - scene.bodies[a].bounding_radius * length_of(c, s)


def gap_listed(scene, work, pose):
    """The least gap of the pieces that are listed [m]; inf where none are."""
    near, least = work.near, math.inf
    for i in range(near.first[0]):
        one = placed(scene.pieces, near.first[1 + i], pose)
        for j in range(near.second[0]):
            other = piece_at(scene.pieces, near.second[1 + j])
            if may_be_within(one, other, least):
                squared, _, _, _, _ = between_cores(one, other)
                least = min(least, math.sqrt(squared) - one.inward - other.inward)
    return least


def look_around_piece(scene, work, piece, lens):
    """List the pieces of the other body that may be within ``lens`` of one, and add them to those
    that have been so far; how many they are."""
    near, count = work.near, 0
    for j in range(near.second[0]):
        row = near.second[1 + j]
        if may_be_within(piece, piece_at(scene.pieces, row), lens):
            count += 1
            near.around[count] = row
            add_row(near.seen, row)
    near.around[0] = count
    return count


def add_row(rows, row):
    """Add a row to some unless it is among them."""
    for k in range(1, rows[0] + 1):
        if rows[k] == row:
            return
    rows[0] += 1
    rows[rows[0]] = row


def look_from(scene, work, count, inset, lens):
    """Look from so many nodes at the pieces that are around any: how far they are, and at which gap
    plates attract each other as they do."""
    near = work.near
    for j in range(near.seen[0]):
        piece = piece_at(scene.pieces, near.seen[1 + j])
        if piece.bend > 0.0:
            add_arc(work.nodes, count, piece, inset, lens)
        else:
            add_segment(work.nodes, count, piece, inset, lens)
    find_plates(work.nodes, count, inset, lens)


def add_nodes(scene, work, total, count, numbers):
    """(fx, fy, torque about the origin) of so many nodes, added to a total."""
    inset, lens, view = numbers
    fx, fy, torque = total
    nodes = work.nodes
    # Several are looked from at once: as if there were some more, of no weight.
    whole = -(-count // AT_ONCE) * AT_ONCE
    for k in range(count, whole):
        nodes.x[k], nodes.y[k] = nodes.x[count - 1], nodes.y[count - 1]
        nodes.gap[k], nodes.attraction[k] = nodes.gap[count - 1], nodes.attraction[count - 1]
    look_from(scene, work, whole, inset, lens)
    for k in range(count):
        gap = nodes.gap[k]
        if gap < lens:
            parted, plates = gap + inset, nodes.plate_gap[k]
            # The more an outline bends away, the more of what attracts is near: of circles the
            # share of a depth is that of plates within 1 % up to a gap of a third of it.
            point = OutlineView(
                view.time, gap, parted, plates, parted * parted / plates, view.depth, view.radius_i,
                view.radius_j, view.reduced_radius, view.effective_mass,
            )  # fmt: skip
            size = -outline_pressure(scene, point) * nodes.weight[k]
            x, y = nodes.x[k], nodes.y[k]
            across, up = size * nodes.normal_x[k], size * nodes.normal_y[k]
            fx, fy, torque = fx + across, fy + up, torque + x * up - y * across
    return fx, fy, torque


def radii_of(scene, a, b):
    """The equivalent radii of two bodies [m]."""
    return scene.bodies[a].equivalent_radius, scene.bodies[b].equivalent_radius


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


def lens_at(scene, least):
    """How far counts around a point of one outline, as near as both are somewhere [m]; 0 where they
    are too far from each other."""
    reach, floor, _, steady = scene.outlines
    if not least < reach:
        return 0.0
    return max(min(LENS * math.sqrt(max(least, floor) * floor), reach), steady)


def look_around(scene, work, time, a, b, pose):
    """(inset, lens, OutlineView of the two) of body a in a Pose, the pieces within the lens being
    listed; a lens of 0 where nothing acts along the outlines."""
    reach, floor, _, _ = scene.outlines
    slack = slack_of(scene, work, a, b, pose)
    least = gap_listed(scene, work, pose) if slack > 0.0 else math.inf
    lens = lens_at(scene, least)
    needed = max(lens, min(least, reach))
    if needed > slack or (1.0 + MOST_SKIN) * needed < slack:
        list_near(scene, work, a, b, pose, (1.0 + SKIN) * reach)
        least = gap_listed(scene, work, pose)
        lens = lens_at(scene, least)
        if lens > 0.0:
            list_near(scene, work, a, b, pose, (1.0 + SKIN) * lens)
    radius_a, radius_b = radii_of(scene, a, b)
    view = OutlineView(
        time, least, least, least, least, depth_of(scene, a, b), radius_a, radius_b,
        radius_a * radius_b / (radius_a + radius_b), effective_mass(scene, a, b),
    )  # fmt: skip
    return max(0.0, floor - least), lens, view


def apart_for_sure(scene, a, b, pose):
    """Whether two bodies are too far from each other for anything to act along outlines."""
    bound = scene.bodies[a].bounding_radius + scene.bodies[b].bounding_radius
    return length_of(pose.x, pose.y) - bound > scene.outlines[0]


@apart
def sum_along(scene, work, time, a, b, x, y, cosine, sine):
    """(fx, fy, torque about b's centroid) on body a [N, N, N m], in the frame of b, where a lies at
    x, y [m] turned by an angle of that cosine and sine."""
    pose, total = Pose(x, y, cosine, sine), (0.0, 0.0, 0.0)
    if apart_for_sure(scene, a, b, pose):
        return total
    numbers = look_around(scene, work, time, a, b, pose)
    inset, lens, view = numbers
    if lens == 0.0:
        return total
    count, least, work.near.seen[0] = 0, view.gap + inset, 0
    for i in range(work.near.first[0]):
        piece = placed(scene.pieces, work.near.first[1 + i], pose)
        if look_around_piece(scene, work, piece, lens) == 0:
            continue
        feet = find_feet(scene, work, piece, inset, lens)
        first, last = ends_of(piece)
        for k in range(feet):
            foot = work.feet[k]
            growth = growth_at(scene, work, piece, foot)
            low = first if k == 0 else 0.5 * (work.feet[k - 1] + foot)
            high = last if k == feet - 1 else 0.5 * (work.feet[k + 1] + foot)
            if low < foot:
                count = put_side(scene, work, count, piece, foot, growth, low, inset, lens, least)
            if foot < high:
                count = put_side(scene, work, count, piece, foot, growth, high, inset, lens, least)
            if count > MOST_NODES - 2 * MOST_PANELS * MOST_ORDER:
                total = add_nodes(scene, work, total, count, numbers)
                count = 0
    fx, fy, torque = add_nodes(scene, work, total, count, numbers)
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
    if scene.bodies[a].bounding_radius > scene.bodies[b].bounding_radius:
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
        fx, fy, turning = sum_charges(scene, work, a, b, seen_x, seen_y, cosine, sine)
        depth = depth_of(scene, a, b)
        across, up, torque = across + depth * fx, up + depth * fy, torque + depth * turning
    own = torque - (seen_x * up - seen_y * across)
    return c * across - s * up, s * across + c * up, own, -torque


@hook
def outlines_apart(scene, work, time, a, b, way):
    """What pushes two bodies apart along the line of centres [N], a being moved out along it from
    where it is now by a way [m]."""
    x, y = separation(scene, work, NOW, a, b)
    distance = length_of(x, y)
    nx, ny = (x / distance, y / distance) if distance > 0.0 else (0.0, 1.0)
    angle_a, angle_b = work.place[NOW, a, ANGLE], work.place[NOW, b, ANGLE]
    x, y = x + way * nx, y + way * ny
    fx, fy, _, _ = between_outlines(scene, work, time, a, b, x, y, angle_a, angle_b)
    return fx * nx + fy * ny


def outlines_in(scene, work, time, state, a, b):
    """The same of two bodies in a state."""
    x, y = separation(scene, work, state, a, b)
    angle_a, angle_b = work.place[state, a, ANGLE], work.place[state, b, ANGLE]
    return between_outlines(scene, work, time, a, b, x, y, angle_a, angle_b)
