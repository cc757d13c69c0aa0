"""Candidates: which vertex–edge pairs can touch before the bodies have moved much further.

Pairs are listed while their gap is below a cut-off, and the list holds as long as the relative
motion of the two bodies stays within a budget.
"""

import math

from flocsim.geometry.contacts import turn_bodies, turned
from flocsim.geometry.handover import keep_slips, restore_slips
from flocsim.geometry.kernels import edge_count, edge_end, segment_distance2
from flocsim.layout import BOUNDING_RADIUS, CANDIDATES, LISTED, NOW, RADIUS, REBUILDS
from flocsim.slots import surface_reach

SKIN = 0.5
"""Pairs are listed up to a gap of this share of r_i + r_j …"""

SKIN_OF_SIZE = 0.02
"""… or of this share of the smaller body, whatever is larger."""


def place_vertices(scene, work):
    """Core points of all bodies in the frame of the scene, relative to their centroids."""
    turn_bodies(work, NOW)
    for body in range(scene.bodies.shape[0]):
        for point in range(scene.first[body], scene.first[body + 1]):
            x, y = turned(scene, work, body, point)
            work.placed[point, 0] = x
            work.placed[point, 1] = y


def edges_to_test(scene, body):
    """Number of edges of a body's core; a point counts as one edge only against a point."""
    return edge_count(scene.first[body + 1] - scene.first[body])


def add_pair(scene, work, a, point, b, start, end, ox, oy, cutoff):
    """List the pair where its gap is below the cut-off; its gap, or −inf where no room is left."""
    placed = work.placed
    distance2 = segment_distance2(
        placed[point, 0] + ox, placed[point, 1] + oy,
        placed[start, 0], placed[start, 1], placed[end, 0], placed[end, 1],
    )  # fmt: skip
    contact = scene.bodies[a, RADIUS] + scene.bodies[b, RADIUS]
    if distance2 >= (contact + cutoff) ** 2:
        return math.sqrt(distance2) - contact
    row = work.tally[CANDIDATES]
    if row == work.candidates.shape[0]:
        return -math.inf
    work.candidates[row, 0], work.candidates[row, 1] = a, point
    work.candidates[row, 2], work.candidates[row, 3], work.candidates[row, 4] = b, start, end
    work.tally[CANDIDATES] = row + 1
    return math.sqrt(distance2) - contact


def list_one_way(scene, work, a, b, cutoff):
    """List pairs of a's vertices and b's edges; the smallest gap met, −inf for a full list."""
    ox = work.motion[NOW, a, 0] - work.motion[NOW, b, 0]
    oy = work.motion[NOW, a, 1] - work.motion[NOW, b, 1]
    contact = scene.bodies[a, RADIUS] + scene.bodies[b, RADIUS]
    vertex_reach2 = (scene.bodies[b, BOUNDING_RADIUS] + scene.bodies[a, RADIUS] + cutoff) ** 2
    edge_reach2 = (scene.bodies[a, BOUNDING_RADIUS] + scene.bodies[b, RADIUS] + cutoff) ** 2
    least = math.inf
    first_b = scene.first[b]
    for edge in range(edges_to_test(scene, b)):
        start, end = first_b + edge, edge_end(scene, b, edge)
        placed = work.placed
        sx, sy = placed[start, 0], placed[start, 1]
        ex, ey = placed[end, 0], placed[end, 1]
        # A long edge can cross the reach of a with both its ends outside.
        if segment_distance2(ox, oy, sx, sy, ex, ey) > edge_reach2:
            continue
        low_x, high_x = min(sx, ex) - contact - cutoff, max(sx, ex) + contact + cutoff
        low_y, high_y = min(sy, ey) - contact - cutoff, max(sy, ey) + contact + cutoff
        for point in range(scene.first[a], scene.first[a + 1]):
            px, py = placed[point, 0] + ox, placed[point, 1] + oy
            near = low_x < px < high_x and low_y < py < high_y
            if near and px * px + py * py < vertex_reach2:
                least = min(least, add_pair(scene, work, a, point, b, start, end, ox, oy, cutoff))
    return least


def list_polygons(scene, work, a, b, cutoff):
    """List the pairs of two bodies, both ways round; the smallest gap met (inf where none)."""
    if scene.first[a + 1] - scene.first[a] == 1 and scene.first[b + 1] - scene.first[b] == 1:
        return list_spheres(scene, work, a, b, cutoff)
    least = list_one_way(scene, work, a, b, cutoff)
    return min(least, list_one_way(scene, work, b, a, cutoff))


def list_spheres(scene, work, a, b, cutoff):
    """List the one pair of two spheres; its gap."""
    ox = work.motion[NOW, a, 0] - work.motion[NOW, b, 0]
    oy = work.motion[NOW, a, 1] - work.motion[NOW, b, 1]
    return add_pair(
        scene, work, a, scene.first[a], b, scene.first[b], scene.first[b], ox, oy, cutoff
    )


def skin_of(scene, a, b):
    """Cut-off gap of the list of a pair of bodies [m]."""
    size = min(scene.bodies[a, BOUNDING_RADIUS], scene.bodies[b, BOUNDING_RADIUS])
    return max(SKIN * (scene.bodies[a, RADIUS] + scene.bodies[b, RADIUS]), SKIN_OF_SIZE * size)


def list_for_surface_force(scene, work, a, b, skin, reach):
    """List what can become the closest pair before the budget is spent; the budget [m]."""
    before = work.tally[CANDIDATES]
    furthest = reach + 2.0 * skin
    margin = skin
    least = list_polygons(scene, work, a, b, margin)
    # A list up to a margin finds the least gap only where that lies below the margin.
    while margin < least < math.inf or (least == math.inf and margin < furthest):
        if margin >= furthest:
            break
        margin = min(4.0 * margin, furthest)
        work.tally[CANDIDATES] = before
        least = list_polygons(scene, work, a, b, margin)
    work.tally[CANDIDATES] = before
    if least == -math.inf:
        return -math.inf
    if min(least, margin) > reach + skin:
        return min(least, margin) - reach
    spend = max(0.5 * skin, 0.25 * least)
    if list_polygons(scene, work, a, b, max(skin, least + 2.0 * spend)) == -math.inf:
        return -math.inf
    return spend


def list_pair(scene, work, a, b):
    """List the candidates of two bodies; how far they may move before it must be made again."""
    ox = work.motion[NOW, a, 0] - work.motion[NOW, b, 0]
    oy = work.motion[NOW, a, 1] - work.motion[NOW, b, 1]
    reach = surface_reach(scene.parameters)
    skin = skin_of(scene, a, b)
    apart = (
        math.sqrt(ox * ox + oy * oy)
        - scene.bodies[a, BOUNDING_RADIUS]
        - scene.bodies[b, BOUNDING_RADIUS]
    )
    if apart > max(0.0, reach) + skin:
        return apart - max(0.0, reach)
    if reach > 0.0:
        return list_for_surface_force(scene, work, a, b, skin, reach)
    if list_polygons(scene, work, a, b, skin) == -math.inf:
        return -math.inf
    return skin


def since_listing(work, state, body, axis):
    """How much one coordinate of a body has changed since the listing."""
    return work.motion[state, body, axis] - work.bodies[body, LISTED + axis]


def moved(scene, work, state, a, b):
    """How far the outlines of two bodies may have moved against each other since the listing."""
    dx = since_listing(work, state, a, 0) - since_listing(work, state, b, 0)
    dy = since_listing(work, state, a, 1) - since_listing(work, state, b, 1)
    turning = abs(since_listing(work, state, a, 2)) * scene.bodies[a, BOUNDING_RADIUS]
    turning += abs(since_listing(work, state, b, 2)) * scene.bodies[b, BOUNDING_RADIUS]
    return math.sqrt(dx * dx + dy * dy) + turning


def spent(scene, work, state):
    """Largest share of its motion budget that any pair of bodies has used (above 1: too far)."""
    worst = 0.0
    pair = 0
    for a in range(scene.bodies.shape[0]):
        for b in range(a):
            if work.budget[pair] <= 0.0:
                return math.inf
            worst = max(worst, moved(scene, work, state, a, b) / work.budget[pair])
            pair += 1
    return worst


def list_candidates(scene, work):
    """Make the list anew at the current position; False where it has no room."""
    kept = keep_slips(work)
    place_vertices(scene, work)
    work.tally[CANDIDATES] = 0
    work.tally[REBUILDS] += 1
    for body in range(scene.bodies.shape[0]):
        for axis in range(3):
            work.bodies[body, LISTED + axis] = work.motion[NOW, body, axis]
    pair = 0
    room = True
    for a in range(scene.bodies.shape[0]):
        for b in range(a):
            budget = list_pair(scene, work, a, b)
            work.budget[pair] = budget
            room = room and budget > 0.0
            pair += 1
    if room:
        restore_slips(work, kept)
    return room
