"""Candidates: which vertex–edge pairs can touch before the bodies have moved much further; and
their tangential displacements, kept as lists are made anew and passed on as contacts roll.

Pairs are listed while their gap is below a cut-off, and the list holds as long as the relative
motion of the two bodies stays within a budget. Which pairs of bodies are watched at all:
body_pairs.py.
"""

import math

from flocsim.geometry.contact.body_pairs import list_pairs, time_to_wander, wandered, watches_all
from flocsim.geometry.contact.near_pairs import gap_between, list_polygons
from flocsim.geometry.contact.points import contact_point, length_of, separation
from flocsim.hooks import hook
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.contacts import GRAZES
from flocsim.state.work import CARRIED, NOW

SKIN = 0.1
"""Pairs are listed up to a gap of this share of r_i + r_j, or up to the smaller one of …"""

SKIN_OF_EDGE = 0.3
"""… this share of the shorter edges' length, so that few are listed but lists last, …"""

SKIN_OF_SIZE = 0.1
"""… and this share of the smaller body, whatever is larger."""

LASTING, WIDEST = 2.2, 12.0
"""Lists are made for so many steps at the speeds of now, up to so many times as wide: half of that
is for the first."""

TOO_WIDE = 4.0
"""Of few bodies they are made anew where they are so many times as wide as that."""

ONE_POINT = 1e-6
"""Contact points that are no farther apart than this share of r_i + r_j are one."""

MOST_AHEAD, LEAST_USED = 0.8, 0.1
"""Shares of its budget that a pair of few bodies may have spent behind a step, and that it has to
have spent before lists are made anew for the sake of a longer step."""


def edge_length(scene, body):
    """The mean length of a body's edges [m], as if its outline were a circle's."""
    points = scene.first[body + 1] - scene.first[body]
    return 2.0 * math.pi * scene.bodies[body].equivalent_radius / points


def widened(skin, way):
    """A cut-off gap for bodies that come nearer to each other by so much in a step [m]."""
    return min(max(skin, LASTING * way), WIDEST * skin)


def skin_of(scene, work, a, b, ahead):
    """Cut-off gap of the list of a pair of bodies for steps of ``ahead`` [s] [m]."""
    size = min(scene.bodies[a].bounding_radius, scene.bodies[b].bounding_radius)
    edge = min(edge_length(scene, a), edge_length(scene, b))
    contact = scene.bodies[a].radius + scene.bodies[b].radius
    skin = max(SKIN * contact, min(SKIN_OF_EDGE * edge, SKIN_OF_SIZE * size))
    return widened(skin, relative_speed(scene, work, a, b) * ahead)


def list_for_surface_force(scene, work, pair, skin, reach):
    """List what can become the closest pair before the budget is spent; the budget [m]."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    least = gap_between(scene, work, a, b)
    if least > reach + skin:
        return least - reach
    spend = max(0.5 * skin, 0.1 * least)
    if list_polygons(scene, work, pair, max(skin, least + 2.0 * spend)):
        return spend
    return -math.inf


def widest_cut(scene, work, ahead):
    """The gap of bounding circles from which on no two bodies act, nor are they listed for steps of
    ``ahead`` [s] [m]."""
    largest, contact, edge, fastest = 0.0, 0.0, 0.0, 0.0
    for body in range(scene.bodies.shape[0]):
        if scene.bodies[body].free == 1.0:
            largest = max(largest, scene.bodies[body].bounding_radius)
            edge = max(edge, edge_length(scene, body))
            fastest = max(fastest, outline_speed(scene, work, body))
        contact = max(contact, scene.bodies[body].radius)
    skin = max(SKIN * 2.0 * contact, min(SKIN_OF_EDGE * edge, SKIN_OF_SIZE * largest))
    reach = max(0.0, scene.listed_reach, scene.centre_reach)
    return reach + widened(skin, 2.0 * fastest * ahead)


def list_pair(scene, work, pair, ahead):
    """List the candidates of two bodies for steps of ``ahead`` [s]; how far they may move before it
    must be made again."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    ox, oy = separation(scene, work, NOW, a, b)
    reach = scene.listed_reach
    skin = skin_of(scene, work, a, b, ahead)
    apart = length_of(ox, oy) - scene.bodies[a].bounding_radius - scene.bodies[b].bounding_radius
    if apart > max(0.0, reach) + skin:
        return apart - max(0.0, reach)
    if reach > 0.0:
        return list_for_surface_force(scene, work, pair, skin, reach)
    before = work.tally.candidates
    if not list_polygons(scene, work, pair, skin):
        return -math.inf
    if work.tally.candidates == before:
        return max(skin, gap_between(scene, work, a, b))
    return skin


def core_radius(scene, body):
    """Largest distance of a core point from the centroid [m]: 0 for a sphere."""
    return scene.bodies[body].bounding_radius - scene.bodies[body].radius


def shifted_by(dx, dy, ox, oy, turn):
    """How far (dx, dy) lies from (ox, oy) turned by an angle."""
    c, s = math.cos(turn), math.sin(turn)
    x, y = dx - (c * ox - s * oy), dy - (s * ox + c * oy)
    return length_of(x, y)


def moved(scene, work, state, a, b, enough):
    """How far the cores of two bodies may have moved against each other since the listing [m].

    Seen from b, all of a's core has moved by no more than its centroid, plus the relative turn
    times its size; seen from a, the same holds of b: a doublet that turns as one does not count.
    Where a plainer bound, which needs no turning, stays below ``enough``, that one is given.
    """
    dx, dy = separation(scene, work, state, a, b)
    # Of the same image of a as now.
    ox = work.poses[a].listed_x - work.poses[b].listed_x
    oy = work.poses[a].listed_y - work.poses[b].listed_y
    ox += dx - (work.place[state, a, X] - work.place[state, b, X])
    oy += dy - (work.place[state, a, Y] - work.place[state, b, Y])
    turn_a = work.place[state, a, ANGLE] - work.poses[a].listed_angle
    turn_b = work.place[state, b, ANGLE] - work.poses[b].listed_angle
    size_a, size_b = core_radius(scene, a), core_radius(scene, b)
    plain = shifted_by(dx, dy, ox, oy, 0.0) + abs(turn_a) * size_a + abs(turn_b) * size_b
    if plain < enough:
        return plain
    turn = abs(turn_a - turn_b)
    seen_from_b = shifted_by(dx, dy, ox, oy, turn_b) + turn * size_a
    seen_from_a = shifted_by(dx, dy, ox, oy, turn_a) + turn * size_b
    return min(plain, seen_from_b, seen_from_a)


def spent(scene, work, state):
    """Largest share of its motion budget that any pair of bodies has used (above 1: too far)."""
    worst = 0.0
    if not watches_all(work):
        if work.tally.rebuilds == 0:
            return math.inf
        worst = wandered(scene, work, state)
    for pair in range(work.tally.pairs):
        budget = work.budget[pair]
        if budget <= 0.0:
            return math.inf
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        worst = max(worst, moved(scene, work, state, a, b, 0.25 * budget) / budget)
    return worst


def relative_speed(scene, work, a, b):
    """How fast the cores of two bodies can move against each other now [m/s]; see `moved`."""
    x, y = separation(scene, work, NOW, a, b)
    vx, vy = (
        work.velocity[NOW, a, X] - work.velocity[NOW, b, X],
        work.velocity[NOW, a, Y] - work.velocity[NOW, b, Y],
    )
    spin_a, spin_b = work.velocity[NOW, a, ANGLE], work.velocity[NOW, b, ANGLE]
    turning = abs(spin_a - spin_b)
    seen_from_b = length_of(vx + spin_b * y, vy - spin_b * x) + turning * core_radius(scene, a)
    seen_from_a = length_of(vx + spin_a * y, vy - spin_a * x) + turning * core_radius(scene, b)
    return min(seen_from_b, seen_from_a)


def outline_speed(scene, work, body):
    """A bound of how fast the core of a body moves now [m/s]."""
    turning = abs(work.velocity[NOW, body, ANGLE]) * core_radius(scene, body)
    return length_of(work.velocity[NOW, body, X], work.velocity[NOW, body, Y]) + turning


def time_within(scene, work, share):
    """The time [s] in which no pair spends more than a share of its budget, at constant speed."""
    longest = math.inf if watches_all(work) else time_to_wander(scene, work, share)
    for pair in range(work.tally.pairs):
        speed = relative_speed(scene, work, work.pairs[pair].later, work.pairs[pair].earlier)
        if speed > 0.0:
            longest = min(longest, share * work.budget[pair] / speed)
    return longest


def share_ahead(scene, work):
    """The share of the budgets that the next step may spend at constant speed: half of them or, of
    few bodies, whose lists are soon made anew, most of what is left."""
    if not watches_all(work):
        return 0.5
    return max(MOST_AHEAD - spent(scene, work, NOW), 0.5)


def outlived(scene, work, ahead):
    """Whether lists are to be made anew before a step of ``ahead`` [s]."""
    used = spent(scene, work, NOW)
    if used > 0.5:
        return True
    few = used > LEAST_USED and watches_all(work)
    return few and time_within(scene, work, MOST_AHEAD - used) < ahead


def too_wide(scene, work, ahead):
    """Whether the lists of few bodies are far wider than steps of ``ahead`` [s] need."""
    before = -1
    if watches_all(work):
        for row in range(work.tally.candidates):
            candidate = work.candidates[row]
            pair = candidate.pair
            a, b = candidate.vertex_body, candidate.edge_body
            if pair != before and work.budget[pair] > TOO_WIDE * skin_of(scene, work, a, b, ahead):
                return True
            before = pair
    return False


def list_candidates(scene, work):
    """Make the list anew at the current position; False where it has no room."""
    return list_ahead(scene, work, 0.0)


def list_ahead(scene, work, ahead):
    """The same, for steps of ``ahead`` [s]."""
    kept = keep_slips(work)
    work.tally.candidates = 0
    work.tally.rebuilds += 1
    for body in range(scene.bodies.shape[0]):
        pose = work.poses[body]
        pose.listed_x = work.place[NOW, body, X]
        pose.listed_y = work.place[NOW, body, Y]
        pose.listed_angle = work.place[NOW, body, ANGLE]
    if not list_pairs(scene, work, widest_cut(scene, work, ahead)):
        return False
    room = True
    for pair in range(work.tally.pairs):
        budget = list_pair(scene, work, pair, ahead)
        work.budget[pair] = budget
        room = room and budget > 0.0
    if room:
        restore_slips(work, kept)
    return room


def keep_slips(work):
    """Set aside the tangential displacements, and the grazing, of the listed pairs; how many there
    are.

    Those that an earlier attempt has set aside, whose list found no room, are still the ones.
    """
    if work.tally.kept > 0:
        return work.tally.kept - 1
    count = 0
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        contact = work.contacts[row]
        mode = candidate.closed
        # Whether there is anything to be known of a pair besides where its bodies are.
        known = work.slip[NOW, row] != 0.0 or contact.gap_offset != 0.0
        if known or contact.flights != 0.0 or mode == GRAZES:
            a, b = candidate.vertex_body, candidate.edge_body
            work.kept[count].later = max(a, b)
            work.kept[count].earlier = min(a, b)
            work.kept[count].vertex = candidate.vertex
            work.kept[count].edge = candidate.edge_start
            work.kept[count].mode = mode
            work.kept[count].slip = work.slip[NOW, row]
            work.kept[count].grazing_force = contact.grazing_force
            work.kept[count].gap_offset = contact.gap_offset
            work.kept[count].slip_offset = contact.slip_offset
            work.kept[count].flights = contact.flights
            count += 1
    work.tally.kept = count + 1
    return count


def comes_before(work, kept, later, earlier):
    """Whether the bodies of a kept displacement come before two others in the list."""
    if work.kept[kept].later != later:
        return work.kept[kept].later < later
    return work.kept[kept].earlier < earlier


def restore_slips(work, count):
    """Give the kept displacements back to the same pairs of the new list; both are in the order of
    their bodies."""
    first = 0
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        contact = work.contacts[row]
        work.slip[NOW, row] = contact.slip_offset = 0.0
        contact.gap_offset = 0.0
        contact.flight = contact.flights = 0.0
        a, b = candidate.vertex_body, candidate.edge_body
        later, earlier = max(a, b), min(a, b)
        while first < count and comes_before(work, first, later, earlier):
            first += 1
        for k in range(first, count):
            if work.kept[k].later != later or work.kept[k].earlier != earlier:
                break
            same = work.kept[k].vertex == candidate.vertex
            if same and work.kept[k].edge == candidate.edge_start:
                work.slip[NOW, row] = work.kept[k].slip
                contact.slip_offset = work.kept[k].slip_offset
                contact.gap_offset = work.kept[k].gap_offset
                contact.flights = work.kept[k].flights
                if work.kept[k].mode == GRAZES:
                    candidate.closed = GRAZES
                    contact.grazing_force = work.kept[k].grazing_force
                    contact.fresh = 0.0
    work.tally.kept = 0


@hook
def same_corner(scene, body, point, other):
    """Whether two core points of a body are the same one or follow each other."""
    count = scene.first[body + 1] - scene.first[body]
    apart = abs(point - other)
    return apart <= 1 or apart == count - 1


def rolls_on_to(scene, work, row, other):
    """Whether a pair of features of the same two bodies neighbours another, either way round."""
    pairs = work.candidates
    point, start, end = pairs[row].vertex, pairs[row].edge_start, pairs[row].edge_end
    on = pairs[other].vertex
    first, last = pairs[other].edge_start, pairs[other].edge_end
    if pairs[row].vertex_body == pairs[other].vertex_body:
        near = same_corner(scene, pairs[row].vertex_body, point, on)
        return near and (start in (first, last) or end in (first, last))
    return on in (start, end) and point in (first, last)


def heir_of(scene, work, row):
    """The closed pair that a contact rolls on to when this one opens, −1 where it does not.

    The nearest contact point of the same two bodies, if it is of a neighbouring pair of features
    or within r_i + r_j of the spheroradii. Where two corners meet, four pairs have one point: that
    which is displaced least takes over, as rounding would else decide.
    """
    candidate = work.candidates[row]
    found, least, displaced = -1, math.inf, math.inf
    low = min(candidate.vertex_body, candidate.edge_body)
    high = max(candidate.vertex_body, candidate.edge_body)
    near = scene.bodies[low].radius + scene.bodies[high].radius
    x, y = contact_point(work, row, low)
    pair, first = candidate.pair, row
    while first > 0 and work.candidates[first - 1].pair == pair:
        first -= 1  # the rows of two bodies follow one another
    for other in range(first, work.tally.candidates):
        if work.candidates[other].pair != pair:
            break
        if work.geometry[NOW, other].gap < 0.0:
            ox, oy = contact_point(work, other, low)
            distance = math.hypot(ox - x, oy - y)
            own = abs(work.slip[NOW, other])
            nearer = distance < least - ONE_POINT * near
            if not (nearer or (distance <= least + ONE_POINT * near and own < displaced)):
                continue
            if distance <= near or rolls_on_to(scene, work, row, other):
                found, least, displaced = other, min(distance, least), own
    return found


def hand_over(scene, work):
    """Pass the displacement of every pair that has opened on to the pair that it rolls on to.

    The tangential force of a contact that rolls on then does not jump, as far as energy allows:
    Σ ½ k_t ξ² of the two bodies never grows, since what it grew by would drive them without end.
    Without an heir ξ vanishes. Expects the geometry of the current position.
    """
    for row in range(work.tally.candidates):
        opened = work.geometry[NOW, row].gap >= 0.0
        grazes = work.candidates[row].closed == GRAZES
        if work.slip[NOW, row] != 0.0 and opened and not grazes:
            heir = heir_of(scene, work, row)
            if heir >= 0:
                own, given = work.slip[NOW, heir], work.slip[NOW, row]
                most = math.hypot(own, given)
                agreement = tangent_agreement(work, row, heir)
                total = own + given * agreement
                work.slip[NOW, heir] = min(max(total, -most), most)
                wrong = slip_error(work, row, work.place) + work.contacts[row].slip_offset
                work.contacts[heir].slip_offset += wrong * agreement
            work.slip[NOW, row] = 0.0


def slip_error(work, row, of):
    """How wrong a pair's two contact points lie along the tangent, as carried on with the motion
    [m], ``of`` places; how wrong they move there [m/s], of velocities."""
    candidate = work.candidates[row]
    a, b = candidate.vertex_body, candidate.edge_body
    g = work.geometry
    along = g[NOW, row].normal_x * (of[CARRIED, a, Y] - of[CARRIED, b, Y])
    along -= g[NOW, row].normal_y * (of[CARRIED, a, X] - of[CARRIED, b, X])
    along += g[NOW, row].vertex_arm_t * of[CARRIED, a, ANGLE]
    return along - g[NOW, row].edge_arm_t * of[CARRIED, b, ANGLE]


def tangent_agreement(work, row, other):
    """How much of one pair's tangential force another pair can carry: a cosine.

    A pair listed the other way round has the opposite tangent, and its slip the same sign.
    """
    geometry = work.geometry[NOW]
    cosine = (
        geometry[row].normal_x * geometry[other].normal_x
        + geometry[row].normal_y * geometry[other].normal_y
    )
    if work.candidates[row].vertex_body == work.candidates[other].vertex_body:
        return cosine
    return -cosine
