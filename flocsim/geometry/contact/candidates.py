"""Lists of candidates: vertex–edge pairs that may touch before the bodies have moved much further.

This is a Verlet list with a skin. Pairs are listed while their gap is below a cut-off (the skin).
The list of two bodies stays valid until their relative motion exceeds a budget. Which pairs of
bodies are considered: body_pairs.py.

Tangential displacements ξ are stored per row. They are saved and restored as lists are rebuilt, and
passed to the neighbouring pair of features as a contact rolls from one edge to the next.
"""

import math

from flocsim.constants import SHALLOWEST_TOUCH
from flocsim.geometry.contact.body_pairs import (
    list_pairs,
    lists_all_pairs,
    time_to_travel,
    travelled_share,
)
from flocsim.geometry.contact.near_pairs import gap_between, list_polygons
from flocsim.geometry.contact.points import (
    contact_point,
    length_of,
    relative_velocity,
    separation,
    tangential_component,
)
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.contacts import GRAZING
from flocsim.state.work import NOW, PROPAGATED

SKIN = 0.1
"""Smallest skin over r_i + r_j (spheroradii), and largest one over the smaller bounding radius, for
coarse polygons."""

SKIN_OF_EDGE = 0.3
"""Skin over the mean edge length, within these bounds: few pairs are listed, yet lists last."""

STEPS_PER_LIST, MOST_WIDENING = 2.2, 12.0
"""STEPS_PER_LIST: list for so many steps at the present speed. MOST_WIDENING: at most so many times
the skin.

A listed but distant row costs 30 ns per step, a rebuild 3 µs. Half of the budget is for the first
step.
"""

EXCESS_WIDTH = 4.0
"""Lists of few bodies are rebuilt if their budget is so many times the needed skin: after a long
flight an impact would otherwise carry its long list."""

MOST_SPENT, LEAST_SPENT = 0.8, 0.1
"""MOST_SPENT: share of its budget that a pair of few bodies may spend by the end of a step.
LEAST_SPENT: share that it must have spent before a longer step justifies a rebuild.

In contact half of the budget is the limit: with longer steps one hook in three hundred let go.
"""


def edge_length(scene, body):
    """Return the mean edge length of a body [m], its outline taken as a circle."""
    points = scene.first[body + 1] - scene.first[body]
    return 2.0 * math.pi * scene.bodies[body].equivalent_radius / points


def widened_skin(skin, approach):
    """Return the skin for bodies that approach by ``approach`` [m] in a step, within its limits."""
    return min(max(skin, STEPS_PER_LIST * approach), MOST_WIDENING * skin)


def skin_of(scene, work, a, b, ahead):
    """Return the skin [m] of two bodies for steps of ``ahead`` [s]."""
    size = min(scene.bodies[a].bounding_radius, scene.bodies[b].bounding_radius)
    edge = min(edge_length(scene, a), edge_length(scene, b))
    contact = scene.bodies[a].radius + scene.bodies[b].radius
    skin = max(SKIN * contact, min(SKIN_OF_EDGE * edge, SKIN * size))
    return widened_skin(skin, relative_speed(scene, work, a, b) * ahead)


def list_for_surface_force(scene, work, pair, skin, reach):
    """List the pairs that can become the closest before the budget is spent; return the
    budget [m]."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    least = gap_between(scene, work, a, b)
    # Beyond the reach nothing has to be listed until the bodies have moved by the difference.
    if least > reach + skin:
        return least - reach
    # If the bodies move by ``budget``, the closest pair can recede and any other approach by as
    # much: pairs with gaps up to least + 2 budget can become the closest.
    budget = max(0.5 * skin, 0.1 * least)
    if list_polygons(scene, work, pair, max(skin, least + 2.0 * budget)):
        return budget
    # No room: a budget that is spent at once.
    return -math.inf


def largest_cutoff(scene, work, ahead):
    """Return the gap [m] of bounding circles beyond which no two bodies interact or are listed.

    ``ahead``: size of the coming steps [s].
    """
    largest, contact, edge, fastest = 0.0, 0.0, 0.0, 0.0
    for body in range(scene.bodies.shape[0]):
        if scene.bodies[body].free == 1.0:
            largest = max(largest, scene.bodies[body].bounding_radius)
            edge = max(edge, edge_length(scene, body))
            fastest = max(fastest, outline_speed(scene, work, body))
        contact = max(contact, scene.bodies[body].radius)
    skin = max(SKIN * 2.0 * contact, min(SKIN_OF_EDGE * edge, SKIN * largest))
    reach = max(0.0, scene.listed_reach, scene.centre_reach)
    return reach + widened_skin(skin, 2.0 * fastest * ahead)


def list_pair(scene, work, pair, ahead):
    """List the candidates of two bodies for steps of ``ahead`` [s].

    Return how far they may move relative to each other before the list must be rebuilt [m].
    """
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    ox, oy = separation(scene, work, NOW, a, b)
    reach = scene.listed_reach
    skin = skin_of(scene, work, a, b, ahead)
    # First test with bounding circles, then by the features.
    clearance = (
        length_of(ox, oy) - scene.bodies[a].bounding_radius - scene.bodies[b].bounding_radius
    )
    if clearance > max(0.0, reach) + skin:
        return clearance - max(0.0, reach)
    if reach > 0.0:
        return list_for_surface_force(scene, work, pair, skin, reach)
    before = work.tally.candidates
    if not list_polygons(scene, work, pair, skin):
        return -math.inf
    # Nothing is within the skin: the exact distance allows more motion than the skin does.
    if work.tally.candidates == before:
        return max(skin, gap_between(scene, work, a, b))
    return skin


def core_radius(scene, body):
    """Return the largest distance of a core point from the centroid [m]: 0 for a sphere."""
    return scene.bodies[body].bounding_radius - scene.bodies[body].radius


def distance_after_turn(dx, dy, ox, oy, turn):
    """Return the distance [m] of (dx, dy) from (ox, oy) turned by an angle."""
    c, s = math.cos(turn), math.sin(turn)
    x, y = dx - (c * ox - s * oy), dy - (s * ox + c * oy)
    return length_of(x, y)


def relative_displacement(scene, work, state, a, b, enough):
    """Return an upper bound [m] of the relative displacement of two cores since the listing.

    Seen from b, every point of a's core has moved by at most the displacement of a's centroid plus
    the relative rotation times a's size; the same holds seen from a. A doublet that rotates rigidly
    therefore spends nothing. If a simpler bound, without cosines, is below ``enough``, that one is
    returned.
    """
    dx, dy = separation(scene, work, state, a, b)
    # In a periodic domain: measured to the same image as at the listing.
    ox = work.poses[a].listed_x - work.poses[b].listed_x
    oy = work.poses[a].listed_y - work.poses[b].listed_y
    ox += dx - (work.place[state, a, X] - work.place[state, b, X])
    oy += dy - (work.place[state, a, Y] - work.place[state, b, Y])
    turn_a = work.place[state, a, ANGLE] - work.poses[a].listed_angle
    turn_b = work.place[state, b, ANGLE] - work.poses[b].listed_angle
    size_a, size_b = core_radius(scene, a), core_radius(scene, b)
    # Simple bound: displacement of the centroids plus both rotations times the sizes.
    simple_bound = (
        distance_after_turn(dx, dy, ox, oy, 0.0) + abs(turn_a) * size_a + abs(turn_b) * size_b
    )
    if simple_bound < enough:
        return simple_bound
    turn = abs(turn_a - turn_b)
    seen_from_b = distance_after_turn(dx, dy, ox, oy, turn_b) + turn * size_a
    seen_from_a = distance_after_turn(dx, dy, ox, oy, turn_a) + turn * size_b
    return min(simple_bound, seen_from_b, seen_from_a)


def spent_budget(scene, work, state):
    """Return the largest used share of a motion budget over all pairs of bodies (above 1:
    invalid)."""
    worst = 0.0
    if not lists_all_pairs(work):
        # Nothing has been listed yet.
        if work.tally.rebuilds == 0:
            return math.inf
        worst = travelled_share(scene, work, state)
    for pair in range(work.tally.pairs):
        budget = work.budget[pair]
        if budget <= 0.0:
            return math.inf
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        worst = max(worst, relative_displacement(scene, work, state, a, b, 0.25 * budget) / budget)
    return worst


def relative_speed(scene, work, a, b):
    """Return an upper bound of the relative speed of two cores [m/s].

    It is the rate of `relative_displacement`.
    """
    x, y = separation(scene, work, NOW, a, b)
    vx, vy = relative_velocity(work, NOW, a, b)
    spin_a, spin_b = work.velocity[NOW, a, ANGLE], work.velocity[NOW, b, ANGLE]
    turning = abs(spin_a - spin_b)
    seen_from_b = length_of(vx + spin_b * y, vy - spin_b * x) + turning * core_radius(scene, a)
    seen_from_a = length_of(vx + spin_a * y, vy - spin_a * x) + turning * core_radius(scene, b)
    return min(seen_from_b, seen_from_a)


def outline_speed(scene, work, body):
    """Return an upper bound of the speed of a body's core points [m/s]."""
    turning = abs(work.velocity[NOW, body, ANGLE]) * core_radius(scene, body)
    return length_of(work.velocity[NOW, body, X], work.velocity[NOW, body, Y]) + turning


def time_to_spend(scene, work, share):
    """Return the time [s] in which no pair spends more than a share of its budget, at constant
    speed."""
    longest = math.inf if lists_all_pairs(work) else time_to_travel(scene, work, share)
    for pair in range(work.tally.pairs):
        speed = relative_speed(scene, work, work.pairs[pair].later, work.pairs[pair].earlier)
        if speed > 0.0:
            longest = min(longest, share * work.budget[pair] / speed)
    return longest


def spendable_share(scene, work):
    """Return the share of the budgets that the next step may spend at constant speed.

    Half of them; for few bodies, whose lists are cheap to rebuild, most of what remains.
    """
    if not lists_all_pairs(work):
        return 0.5
    return max(MOST_SPENT - spent_budget(scene, work, NOW), 0.5)


def needs_rebuild(scene, work, ahead):
    """Return True if the lists must be rebuilt before a step of ``ahead`` [s]."""
    used = spent_budget(scene, work, NOW)
    if used > 0.5:
        return True
    few = used > LEAST_SPENT and lists_all_pairs(work)
    return few and time_to_spend(scene, work, MOST_SPENT - used) < ahead


def is_too_wide(scene, work, ahead):
    """Return True if the lists of few bodies are far wider than steps of ``ahead`` [s] need."""
    before = -1
    if lists_all_pairs(work):
        for row in range(work.tally.candidates):
            candidate = work.candidates[row]
            pair = candidate.pair
            a, b = candidate.vertex_body, candidate.edge_body
            # Rows of two bodies are consecutive: test each pair of bodies once.
            if pair != before and work.budget[pair] > EXCESS_WIDTH * skin_of(
                scene, work, a, b, ahead
            ):
                return True
            before = pair
    return False


def rebuild_list(scene, work):
    """Rebuild the list at the present positions; return False if it has no room."""
    return rebuild_list_ahead(scene, work, 0.0)


def rebuild_list_ahead(scene, work, ahead):
    """Rebuild the list for steps of ``ahead`` [s]; return False if it has no room."""
    # The rows are about to be overwritten: save what contacts carry from step to step.
    saved = save_contacts(work)
    work.tally.candidates = 0
    work.tally.rebuilds += 1
    for body in range(scene.bodies.shape[0]):
        pose = work.poses[body]
        pose.listed_x = work.place[NOW, body, X]
        pose.listed_y = work.place[NOW, body, Y]
        pose.listed_angle = work.place[NOW, body, ANGLE]
    if not list_pairs(scene, work, largest_cutoff(scene, work, ahead)):
        return False
    room = True
    for pair in range(work.tally.pairs):
        budget = list_pair(scene, work, pair, ahead)
        work.budget[pair] = budget
        room = room and budget > 0.0
    if room:
        restore_contacts(work, saved)
    return room


def save_contacts(work):
    """Save the tangential displacements and grazing states of the listed pairs; return their
    number.

    If an earlier attempt found no room, its saved values are still the valid ones.
    """
    if work.tally.kept > 0:
        return work.tally.kept - 1
    count = 0
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        contact = work.contacts[row]
        mode = candidate.contact_mode
        # Only rows with a history are saved.
        has_history = work.slip[NOW, row] != 0.0 or contact.gap_offset != 0.0
        if has_history or contact.short_flights != 0.0 or mode == GRAZING:
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
            work.kept[count].short_flights = contact.short_flights
            count += 1
    work.tally.kept = count + 1
    return count


def precedes(work, kept, later, earlier):
    """Return True if the bodies of a saved displacement precede two others in the list."""
    if work.kept[kept].later != later:
        return work.kept[kept].later < later
    return work.kept[kept].earlier < earlier


def restore_contacts(work, count):
    """Give the saved displacements back to the same pairs of features in the new list.

    Both lists are sorted by their bodies, so one merging pass suffices.
    """
    first = 0
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        contact = work.contacts[row]
        work.slip[NOW, row] = contact.slip_offset = 0.0
        contact.gap_offset = 0.0
        contact.flight_gap = contact.short_flights = 0.0
        a, b = candidate.vertex_body, candidate.edge_body
        later, earlier = max(a, b), min(a, b)
        while first < count and precedes(work, first, later, earlier):
            first += 1
        for k in range(first, count):
            if work.kept[k].later != later or work.kept[k].earlier != earlier:
                break
            same = work.kept[k].vertex == candidate.vertex
            if same and work.kept[k].edge == candidate.edge_start:
                work.slip[NOW, row] = work.kept[k].slip
                contact.slip_offset = work.kept[k].slip_offset
                contact.gap_offset = work.kept[k].gap_offset
                contact.short_flights = work.kept[k].short_flights
                if work.kept[k].mode == GRAZING:
                    candidate.contact_mode = GRAZING
                    contact.grazing_force = work.kept[k].grazing_force
                    contact.newly_grazing = 0.0
    work.tally.kept = 0


def are_adjacent(scene, point, other):
    """Return True if two core points of a body coincide or are the ends of one edge."""
    apart, points = other - point, scene.vertices
    return apart in (0, points[point].edge_offset, -points[other].edge_offset)


def are_neighbours(scene, work, row, other):
    """Return True if two pairs of features of the same bodies are neighbours, in either role."""
    pairs = work.candidates
    point, start, end = pairs[row].vertex, pairs[row].edge_start, pairs[row].edge_end
    on = pairs[other].vertex
    first, last = pairs[other].edge_start, pairs[other].edge_end
    # Same roles: neighbouring vertices and edges with a common end. Swapped roles: each vertex is
    # an end of the other pair's edge.
    if pairs[row].vertex_body == pairs[other].vertex_body:
        near = are_adjacent(scene, point, on)
        return near and (start in (first, last) or end in (first, last))
    return on in (start, end) and point in (first, last)


def successor_of(scene, work, row):
    """Return the closed pair that takes over a contact's displacement as it opens, −1 without one.

    It is the pair of the same two bodies with the nearest contact point, if it is a neighbouring
    pair of features or within r_i + r_j (spheroradii). Where two corners meet, up to four pairs
    share one point. Then the pair with the smallest displacement takes over; otherwise rounding
    would decide.
    """
    candidate = work.candidates[row]
    successor, least, displaced = -1, math.inf, math.inf
    low = min(candidate.vertex_body, candidate.edge_body)
    high = max(candidate.vertex_body, candidate.edge_body)
    near = scene.bodies[low].radius + scene.bodies[high].radius
    x, y = contact_point(work, row, low)
    pair, first = candidate.pair, row
    # The rows of two bodies are consecutive.
    while first > 0 and work.candidates[first - 1].pair == pair:
        first -= 1
    for other in range(first, work.tally.candidates):
        if work.candidates[other].pair != pair:
            break
        if work.geometry[NOW, other].gap < 0.0:
            ox, oy = contact_point(work, other, low)
            distance = math.hypot(ox - x, oy - y)
            own = abs(work.slip[NOW, other])
            # Points closer than SHALLOWEST_TOUCH count as equally near: the displacement decides
            # between them.
            nearer = distance < least - SHALLOWEST_TOUCH
            if not (nearer or (distance <= least + SHALLOWEST_TOUCH and own < displaced)):
                continue
            if distance <= near or are_neighbours(scene, work, row, other):
                successor, least, displaced = other, min(distance, least), own
    return successor


def transfer_slips(scene, work):
    """Pass the displacement of every pair that has opened to the pair that its contact rolls on to.

    The tangential force of a rolling contact then does not jump, as far as energy allows: Σ ½ k_t
    ξ² of the two bodies never grows, or the increments would drive the doublet without end (2.5e-10
    J per 0.1 s in a hanging doublet). Without a successor ξ vanishes. The geometry must be that of
    the present positions.
    """
    for row in range(work.tally.candidates):
        opened = work.geometry[NOW, row].gap >= 0.0
        grazes = work.candidates[row].contact_mode == GRAZING
        if work.slip[NOW, row] != 0.0 and opened and not grazes:
            successor = successor_of(scene, work, row)
            if successor >= 0:
                own, given = work.slip[NOW, successor], work.slip[NOW, row]
                # Energy bound: ξ_new² ≤ ξ_own² + ξ_given², with the same k_t for both.
                largest = math.hypot(own, given)
                # The passed displacement is projected on the successor's tangent.
                cosine = tangent_cosine(work, row, successor)
                total = own + given * cosine
                work.slip[NOW, successor] = min(max(total, -largest), largest)
                # The propagated error of ξ is passed on in the same proportion.
                error = tangential_component(work, row, work.place, PROPAGATED, NOW)
                error += work.contacts[row].slip_offset
                work.contacts[successor].slip_offset += error * cosine
            work.slip[NOW, row] = 0.0


def tangent_cosine(work, row, other):
    """Return the cosine between the tangents of two pairs, in the sense of their displacements.

    A pair with swapped roles has the opposite tangent, but the sign of its displacement is the
    same.
    """
    one, two = work.geometry[NOW, row], work.geometry[NOW, other]
    cosine = one.normal_x * two.normal_x + one.normal_y * two.normal_y
    if work.candidates[row].vertex_body == work.candidates[other].vertex_body:
        return cosine
    return -cosine
