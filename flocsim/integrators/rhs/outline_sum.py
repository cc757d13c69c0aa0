"""Forces between outlines: the pressure of the laws integrated over one outline in the other's
field.

A body at rest in the field of another has the energy E = ∫ Ψ dA, hence the force

    F = −∮ Ψ n ds,   τ = −∮ Ψ (r × n) ds,

and a law gives −Ψ, the pressure between two plates at a given gap. The integral runs over the
outline of the smaller body, in the frame of the other; the other body feels the reverse. The
attraction is evaluated within a lens around each point (geometry.contact.attraction), so pieces
that are farther apart are never listed.
"""

import math

from flocsim.compiler.linker import apart
from flocsim.geometry.contact.attraction import add_arc, add_segment, convert_to_plate_gaps
from flocsim.geometry.contact.points import length_of, separation
from flocsim.geometry.shapes.pieces import (
    Pose,
    are_within,
    closest_points,
    ends_of,
    may_be_within,
    piece_at,
    placed,
)
from flocsim.hooks import ORIENTED_ENERGY, OUTLINE_PRESSURE, has, hook, outline_pressure
from flocsim.integrators.rhs.charge_sum import sum_charges
from flocsim.integrators.rhs.orientation import oriented_forces_at
from flocsim.integrators.rhs.outline_nodes import MOST_PANELS, find_feet, gap_expansion, write_side
from flocsim.integrators.rhs.views import centre_line, effective_mass
from flocsim.state.bodies import ANGLE
from flocsim.state.outlines import (
    MOST_NODES,
    MOST_ORDER,
)
from flocsim.state.views import OutlineView
from flocsim.state.work import NOW

LENS = 300.0
"""The attraction is evaluated up to LENS · √(gap · d_min). What lies beyond is less than 1e-6 of
the attraction at touch, as the integrand fades out and is compensated for it (attraction.py). A
narrower lens takes less time per sum, but more steps."""

WIDENING = 2.0
"""Pieces are listed up to WIDENING times the lens, so that lists last, and anew if they reach
further than WIDENING² times as far as needed."""

AT_ORIGIN = Pose(0.0, 0.0, 1.0, 0.0)
"""Pose of the body in whose frame the sum is evaluated."""


def list_near_pieces(scene, work, a, b, pose, reach):
    """List the pieces of two bodies that are nearer to each other than ``reach`` [m]."""
    near, listed = work.near, work.listed
    # First against the other body's bounding circle, then piece against piece.
    bound_a, bound_b = scene.bodies[a].bounding_radius, scene.bodies[b].bounding_radius
    list_within(scene, near.first, a, pose, 0.0, 0.0, bound_b + reach)
    list_within(scene, near.second, b, AT_ORIGIN, pose.x, pose.y, bound_a + reach)
    keep_close_pieces(scene.pieces, near.first, pose, near.second, AT_ORIGIN, reach)
    keep_close_pieces(scene.pieces, near.second, AT_ORIGIN, near.first, pose, reach)
    listed.first_body, listed.second_body, listed.reach = a, b, reach
    listed.x, listed.y = pose.x, pose.y
    listed.cosine, listed.sine = pose.cosine, pose.sine


def list_within(scene, rows, body, pose, x, y, reach):
    """List those pieces of a body in a Pose that may be within ``reach`` of a point [m]."""
    count = 0
    for row in range(scene.first_piece[body], scene.first_piece[body + 1]):
        piece = placed(scene.pieces, row, pose)
        dx, dy, most = piece.middle_x - x, piece.middle_y - y, reach + piece.extent
        if dx * dx + dy * dy < most * most:
            count += 1
            rows[count] = row
    rows[0] = count


def keep_close_pieces(pieces, rows, pose, others, other_pose, reach):
    """Keep those listed pieces that are within ``reach`` of a piece of another list [m]."""
    # Compact the list in place.
    count = 0
    for i in range(1, rows[0] + 1):
        one = placed(pieces, rows[i], pose)
        for j in range(1, others[0] + 1):
            if are_within(one, placed(pieces, others[j], other_pose), reach):
                count += 1
                rows[count] = rows[i]
                break
    rows[0] = count


def listed_distance(scene, work, a, b, pose):
    """Return up to which distance pieces are certainly listed, as bodies have moved by now [m];
    below 0 if none are."""
    listed = work.listed
    if listed.first_body != a or listed.second_body != b:
        return -1.0
    # Both translation and rotation of the first body use the listed distance up.
    displacement = length_of(pose.x - listed.x, pose.y - listed.y)
    c, s = pose.cosine - listed.cosine, pose.sine - listed.sine
    return listed.reach - displacement - scene.bodies[a].bounding_radius * length_of(c, s)


def least_piece_gap(scene, work, pose):
    """Return the least gap of the listed pieces [m]; inf if none are."""
    near, least = work.near, math.inf
    for i in range(near.first[0]):
        one = placed(scene.pieces, near.first[1 + i], pose)
        for j in range(near.second[0]):
            other = piece_at(scene.pieces, near.second[1 + j])
            if may_be_within(one, other, least):
                squared, _, _, _, _ = closest_points(one, other)
                least = min(least, math.sqrt(squared) - one.core_depth - other.core_depth)
    return least


def list_around_piece(scene, work, piece, lens):
    """List the pieces of the other body that may be within ``lens`` of one, and add them to those
    seen so far; return their number."""
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
    """Add a row to a list unless it is there."""
    for k in range(1, rows[0] + 1):
        if rows[k] == row:
            return
    rows[0] += 1
    rows[rows[0]] = row


def evaluate_nodes(scene, work, count, inset, lens):
    """Evaluate, at the first ``count`` nodes, their gap and the gap at which plates attract as
    strongly."""
    near = work.near
    for j in range(near.seen[0]):
        piece = piece_at(scene.pieces, near.seen[1 + j])
        if piece.arc_radius > 0.0:
            add_arc(work.nodes, work.rules, count, piece, inset, lens)
        else:
            add_segment(work.nodes, count, piece, inset, lens)
    convert_to_plate_gaps(work.nodes, count, inset, lens)


def sum_nodes(scene, work, total, count, setup):
    """Add (fx, fy, torque about the origin) of the first ``count`` nodes to a total."""
    inset, lens, _, time, sizes = setup
    fx, fy, torque = total
    nodes = work.nodes
    evaluate_nodes(scene, work, count, inset, lens)
    for k in range(count):
        gap = nodes.gap[k]
        if gap < lens:
            parted, plates = gap + inset, nodes.plate_gap[k]
            # The more an outline curves away, the nearer is all that attracts. For circles this gap
            # gives the fraction lost to a finite depth within 1 %, up to a gap of a third of it.
            point = OutlineView(time, gap, parted, plates, parted * parted / plates, *sizes)
            size = -outline_pressure(scene, point) * nodes.weight[k]
            x, y = nodes.x[k], nodes.y[k]
            across, up = size * nodes.normal_x[k], size * nodes.normal_y[k]
            fx, fy, torque = fx + across, fy + up, torque + x * up - y * across
    return fx, fy, torque


def radii_of(scene, a, b):
    """Return the equivalent radii of two bodies [m]."""
    return scene.bodies[a].equivalent_radius, scene.bodies[b].equivalent_radius


def has_outline_forces(scene):
    """Return True if the scene has forces along outlines or forces that depend on orientation."""
    return outline_reach(scene) > 0.0 or has(scene, ORIENTED_ENERGY)


def outline_reach(scene):
    """Return the gap up to which forces act along outlines [m]; below 0 if none do."""
    return max(scene.outlines[0], scene.layer[2])


def depth_of(scene, a, b):
    """Return the depth over which two bodies act on each other [m]: given, or 4/3 of the smaller
    radius."""
    if scene.outlines[2] > 0.0:
        return scene.outlines[2]
    radius_a, radius_b = radii_of(scene, a, b)
    return 4.0 / 3.0 * min(radius_a, radius_b)


def lens_radius(scene, least):
    """Return the radius around a point of one outline that counts, for a least gap [m]; 0 out of
    reach."""
    reach, floor, _, steady = scene.outlines
    if not least < reach:
        return 0.0
    # Attraction counts up to LENS · √(gap · d_min) within its reach, other pressures up to theirs.
    return max(min(LENS * math.sqrt(max(least, floor) * floor), reach), steady)


def prepare_sum(scene, work, time, a, b, pose):
    """Return (inset, lens, least gap, time, sizes) of body a in a Pose; list the pieces within the
    lens.

    ``lens`` is 0 if nothing acts. ``inset`` [m] is how far outlines nearer than d_min are moved
    apart; ``sizes`` are the last fields of an OutlineView.
    """
    reach, floor, _, _ = scene.outlines
    # Lists are a superset of what counts, so when they were made does not affect the sum.
    listed_to = listed_distance(scene, work, a, b, pose)
    least = least_piece_gap(scene, work, pose) if listed_to > 0.0 else math.inf
    lens = lens_radius(scene, least)
    needed = max(lens, min(least, reach))
    # Outside the lists, or far within them: list anew, first wide enough to find the least gap,
    # then just the lens.
    if needed > listed_to or WIDENING * WIDENING * needed < listed_to:
        list_near_pieces(scene, work, a, b, pose, WIDENING * reach)
        least = least_piece_gap(scene, work, pose)
        lens = lens_radius(scene, least)
        if lens > 0.0:
            list_near_pieces(scene, work, a, b, pose, WIDENING * lens)
    radius_a, radius_b = radii_of(scene, a, b)
    reduced = radius_a * radius_b / (radius_a + radius_b)
    sizes = depth_of(scene, a, b), radius_a, radius_b, reduced, effective_mass(scene, a, b)
    return max(0.0, floor - least), lens, least, time, sizes


def out_of_reach(scene, a, b, pose):
    """Return True if two bodies are certainly too far apart for forces along outlines."""
    bound = scene.bodies[a].bounding_radius + scene.bodies[b].bounding_radius
    return length_of(pose.x, pose.y) - bound > scene.outlines[0]


@apart
def sum_pressure(scene, work, time, a, b, x, y, cosine, sine):
    """Return (fx, fy, torque about b's centroid) on body a [N, N, N m], in the frame of b.

    In this frame a lies at x, y [m], turned by the angle of the given cosine and sine.
    """
    pose, total = Pose(x, y, cosine, sine), (0.0, 0.0, 0.0)
    if out_of_reach(scene, a, b, pose):
        return total
    setup = prepare_sum(scene, work, time, a, b, pose)
    inset, lens, least_gap, _, sizes = setup
    if lens == 0.0:
        return total
    count, least, work.near.seen[0] = 0, least_gap + inset, 0
    for i in range(work.near.first[0]):
        piece = placed(scene.pieces, work.near.first[1 + i], pose)
        if list_around_piece(scene, work, piece, lens) == 0:
            continue
        feet = find_feet(scene, work, piece, inset, lens)
        first, last = ends_of(piece)
        # Both sides of each foot, up to halfway to the next.
        for k in range(feet):
            foot = work.feet[k]
            growth = gap_expansion(scene, work, piece, foot)
            low = first if k == 0 else 0.5 * (work.feet[k - 1] + foot)
            high = last if k == feet - 1 else 0.5 * (work.feet[k + 1] + foot)
            for end in (low, high):
                if end != foot:
                    count = write_side(
                        scene, work, count, piece, foot, growth, end, inset, lens, least
                    )
            # Work in batches of at most MOST_NODES.
            if count > MOST_NODES - 2 * MOST_PANELS * MOST_ORDER:
                total = sum_nodes(scene, work, total, count, setup)
                count = 0
    fx, fy, torque = sum_nodes(scene, work, total, count, setup)
    return sizes[0] * fx, sizes[0] * fy, sizes[0] * torque


def outline_forces_at(scene, work, time, a, b, x, y, angle_a, angle_b):
    """Return (fx, fy, torque on a, torque on b) of forces along outlines and oriented forces [N, N
    m].

    Body a, the later one, is seen from b at x, y [m]; b feels the reverse of fx, fy. Each torque is
    about the body's own centroid.
    """
    fx, fy, torque_a, torque_b = 0.0, 0.0, 0.0, 0.0
    if outline_reach(scene) > 0.0:
        fx, fy, torque_a, torque_b = size_ordered_forces(
            scene, work, time, a, b, x, y, angle_a, angle_b
        )
    if has(scene, ORIENTED_ENERGY):
        more = oriented_forces_at(scene, time, a, b, x, y, angle_a, angle_b)
        return fx + more[0], fy + more[1], torque_a + more[2], torque_b + more[3]
    return fx, fy, torque_a, torque_b


def size_ordered_forces(scene, work, time, a, b, x, y, angle_a, angle_b):
    """Return the same for forces along outlines alone: the integral runs over the smaller body."""
    # The smaller one is gone along.
    if scene.bodies[a].bounding_radius > scene.bodies[b].bounding_radius:
        fx, fy, torque_b, torque_a = forces_in_frame(
            scene, work, time, b, a, -x, -y, angle_b, angle_a
        )
        return -fx, -fy, torque_a, torque_b
    return forces_in_frame(scene, work, time, a, b, x, y, angle_a, angle_b)


def forces_in_frame(scene, work, time, a, b, x, y, angle_a, angle_b):
    # Into the frame of b.
    c, s = math.cos(angle_b), math.sin(angle_b)
    turn = angle_a - angle_b
    seen_x, seen_y = c * x + s * y, c * y - s * x
    cosine, sine = math.cos(turn), math.sin(turn)
    across, up, torque = 0.0, 0.0, 0.0
    # Pressures and charges may act together.
    if has(scene, OUTLINE_PRESSURE):
        across, up, torque = sum_pressure(scene, work, time, a, b, seen_x, seen_y, cosine, sine)
    if scene.layer[2] > 0.0:
        fx, fy, turning = sum_charges(scene, work, a, b, seen_x, seen_y, cosine, sine)
        depth = depth_of(scene, a, b)
        across, up, torque = across + depth * fx, up + depth * fy, torque + depth * turning
    # The torque about a's own centroid, and back into the scene's frame.
    own = torque - (seen_x * up - seen_y * across)
    return c * across - s * up, s * across + c * up, own, -torque


@hook
def outline_repulsion(scene, work, time, a, b, displacement):
    """Return the repulsion of two bodies along the line of centres [N], with a moved out along it
    by ``displacement`` [m]."""
    nx, ny, distance = centre_line(scene, work, NOW, a, b)
    angle_a, angle_b = work.place[NOW, a, ANGLE], work.place[NOW, b, ANGLE]
    # Move a out, keeping its orientation.
    x, y = (distance + displacement) * nx, (distance + displacement) * ny
    fx, fy, _, _ = outline_forces_at(scene, work, time, a, b, x, y, angle_a, angle_b)
    return fx * nx + fy * ny


def outline_forces_in(scene, work, time, state, a, b):
    """Return outline_forces_at of two bodies in a state."""
    x, y = separation(scene, work, state, a, b)
    angle_a, angle_b = work.place[state, a, ANGLE], work.place[state, b, ANGLE]
    return outline_forces_at(scene, work, time, a, b, x, y, angle_a, angle_b)
