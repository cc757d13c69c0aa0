"""In which order the bodies of a sparse system are eliminated, and what fills in by that.

Minimum degree: next is the body that is tied to the fewest others, which are tied to each other
from then on. A chain or a tree of bodies fills in nowhere. The first body of a cluster comes last
of it, because its row holds the momentum of all (systems.py) and would otherwise tie all of them.

The order and the pattern are kept until other pairs act, or clusters are others.
"""

from flocsim.state.clock import BLOCKS_FULL

(
    HEAD, NEXT, PREVIOUS, DEGREE, BEGIN, ROOM, MARK, CLUSTER, NODE_ROWS,
) = range(9)  # fmt: skip
"""Rows of ``Elimination.nodes``: the first body of a degree; the bodies before and behind one of
the same degree; how many others it is tied to; where they begin in ``graph``, and how many have
room there; a mark; the cluster for which the pattern was made."""

PATTERN, END, LISTING, FOUND_SIZE = range(4)
"""Places in ``Elimination.found``: 1 + pairs in the pattern (0: there is none); how far ``graph``
is used; the listing of pairs for which the pattern was made."""

NONE = -1
"""No body, no place."""

SLACK = 4
"""Room for so many more ties of a body at first."""

WIDEST, FEW = 1.5, 8
"""A pattern is kept while it has at most so many times the pairs that act, and a few more."""


def ties(scene, work, pair):
    """Whether a pair ties two bodies of the systems to each other."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    acts = work.pairs[pair].acting == 1
    return acts and scene.bodies[a].free * scene.bodies[b].free == 1.0


def holds(scene, work):
    """Whether the pattern still serves the pairs that act now."""
    e, count = work.elimination, 0
    if e.found[PATTERN] == 0 or e.found[LISTING] != work.tally.rebuilds:
        return False
    for body in range(work.poses.shape[0]):
        if e.nodes[CLUSTER, body] != work.cluster[body]:
            return False
    for pair in range(work.tally.pairs):
        if ties(scene, work, pair):
            if e.pairs[pair] == 0:
                return False
            count += 1
    return e.found[PATTERN] - 1 <= WIDEST * count + FEW


def count_ties(scene, work):
    """Bodies' degrees, and room for their ties; False where there is none."""
    e, n = work.elimination, work.poses.shape[0]
    for body in range(n):
        e.nodes[DEGREE, body] = 0
        e.nodes[MARK, body] = NONE
        e.nodes[CLUSTER, body] = work.cluster[body]
    count = 0
    for pair in range(work.tally.pairs):
        e.pairs[pair] = 1 if ties(scene, work, pair) else 0
        if e.pairs[pair] == 1:
            e.nodes[DEGREE, work.pairs[pair].later] += 1
            e.nodes[DEGREE, work.pairs[pair].earlier] += 1
            count += 1
    end = 0
    for body in range(n):
        e.nodes[BEGIN, body] = end
        e.nodes[ROOM, body] = e.nodes[DEGREE, body] + SLACK
        end += e.nodes[ROOM, body]
        e.nodes[DEGREE, body] = 0
    e.found[END], e.found[PATTERN], e.found[LISTING] = end, 1 + count, work.tally.rebuilds
    return end <= e.graph.shape[0]


def add_tie(e, body, other):
    e.graph[e.nodes[BEGIN, body] + e.nodes[DEGREE, body]] = other
    e.nodes[DEGREE, body] += 1


def write_ties(work):
    """The graph of the pairs that act."""
    for pair in range(work.tally.pairs):
        if work.elimination.pairs[pair] == 1:
            a, b = work.pairs[pair].later, work.pairs[pair].earlier
            add_tie(work.elimination, a, b)
            add_tie(work.elimination, b, a)


def enter(e, body):
    """Put a body among those of its degree."""
    degree = e.nodes[DEGREE, body]
    after = e.nodes[HEAD, degree]
    e.nodes[NEXT, body], e.nodes[PREVIOUS, body] = after, NONE
    if after != NONE:
        e.nodes[PREVIOUS, after] = body
    e.nodes[HEAD, degree] = body


def leave(e, body):
    """Take it out there."""
    before, after = e.nodes[PREVIOUS, body], e.nodes[NEXT, body]
    if before == NONE:
        e.nodes[HEAD, e.nodes[DEGREE, body]] = after
    else:
        e.nodes[NEXT, before] = after
    if after != NONE:
        e.nodes[PREVIOUS, after] = before


def make_room(e, body, needed):
    """Room for so many ties of a body; False where the graph has none."""
    if needed <= e.nodes[ROOM, body]:
        return True
    room, end = needed + needed // 2, e.found[END]
    if end + room > e.graph.shape[0]:
        return False
    begin = e.nodes[BEGIN, body]
    for tie in range(e.nodes[DEGREE, body]):
        e.graph[end + tie] = e.graph[begin + tie]
    e.nodes[BEGIN, body], e.nodes[ROOM, body], e.found[END] = end, room, end + room
    return True


def tie_to_all(e, body, gone, first, last):
    """Tie a body to all others that one which is eliminated is tied to: ``column`` from first to
    last; False where there is no room."""
    begin, kept = e.nodes[BEGIN, body], 0
    for tie in range(e.nodes[DEGREE, body]):
        other = e.graph[begin + tie]
        if other != gone:
            e.graph[begin + kept] = other
            e.nodes[MARK, other] = body
            kept += 1
    e.nodes[DEGREE, body] = kept
    e.nodes[MARK, body] = body
    if not make_room(e, body, kept + last - first):
        return False
    for place in range(first, last):
        if e.nodes[MARK, e.column[place]] != body:
            add_tie(e, body, e.column[place])
    for tie in range(e.nodes[DEGREE, body]):
        e.nodes[MARK, e.graph[e.nodes[BEGIN, body] + tie]] = NONE
    e.nodes[MARK, body] = NONE
    return True


def is_leader(work, body):
    return work.cluster[body] == body


def eliminate(work, place, body, end):
    """Give a body its place, and write what it is tied to to ``column`` from ``end`` on; how far
    that is filled then, NONE without room."""
    e = work.elimination
    e.place[body], e.body[place] = place, body
    count = e.nodes[DEGREE, body]
    e.upper[place] = end
    if end + count > e.column.shape[0]:
        return NONE
    for tie in range(count):
        e.column[end + tie] = e.graph[e.nodes[BEGIN, body] + tie]
    for each in range(end, end + count):
        other = e.column[each]
        if not is_leader(work, other):
            leave(e, other)
        if not tie_to_all(e, other, body, end, end + count):
            return NONE
        if not is_leader(work, other):
            enter(e, other)
    return end + count


def order_bodies(scene, work):
    """Give all free bodies their places, leaders last; how far ``column`` is filled with what they
    are tied to, NONE without room."""
    e, n = work.elimination, work.poses.shape[0]
    for degree in range(n + 1):
        e.nodes[HEAD, degree] = NONE
    free = 0
    for body in range(n):
        e.place[body] = NONE
        if scene.bodies[body].free == 1.0:
            free += 1
            if not is_leader(work, body):
                enter(e, body)
    place, end, degree = 0, 0, 0
    while degree <= n:
        body = e.nodes[HEAD, degree]
        if body == NONE:
            degree += 1
            continue
        leave(e, body)
        end = eliminate(work, place, body, end)
        if end == NONE:
            return NONE
        place, degree = place + 1, max(degree - 1, 0)
    for body in range(n):
        if scene.bodies[body].free == 1.0 and is_leader(work, body):
            end = eliminate(work, place, body, end)
            place += 1
    for rest in range(place, n):
        e.body[rest] = NONE
        e.upper[rest] = end
    return end


def sort_places(e, first, last):
    """Sort a stretch of ``column``."""
    for place in range(first + 1, last):
        value, free = e.column[place], place
        while free > first and e.column[free - 1] > value:
            e.column[free] = e.column[free - 1]
            free -= 1
        e.column[free] = value


def lay_out(work, end):
    """From what every body is tied to, rows of places: those left of the diagonal, then those
    right of it; False without room."""
    e, n = work.elimination, work.poses.shape[0]
    left = e.nodes[BEGIN]
    for place in range(n):
        left[place] = 0
    for each in range(end):
        place = e.place[e.column[each]]
        e.column[each] = place
        left[place] += 1
    for body in range(n):
        if e.place[body] != NONE and is_leader(work, body):
            left[e.place[body]] = 0
    for body in range(n):
        if e.place[body] != NONE and not is_leader(work, body):
            left[e.place[work.cluster[body]]] += 1
    total = end
    for place in range(n):
        total += left[place]
    if total > e.column.shape[0]:
        return False
    # From behind, so that nothing is overwritten that has yet to move.
    begin = total
    for place in range(n - 1, -1, -1):
        last = end if place == n - 1 else e.nodes[ROOM, place + 1]
        first = e.upper[place]
        e.nodes[ROOM, place] = first
        e.lower[place + 1] = begin
        begin -= last - first
        for each in range(last - first - 1, -1, -1):
            e.column[begin + each] = e.column[first + each]
        e.upper[place] = begin
        begin -= left[place]
        e.lower[place] = begin
    fill_left(work)
    return True


def fill_left(work):
    """Write the places left of the diagonal, in their order."""
    e, n = work.elimination, work.poses.shape[0]
    filled = e.nodes[BEGIN]
    for place in range(n):
        sort_places(e, e.upper[place], e.lower[place + 1])
        filled[place] = e.lower[place]
    for place in range(n):
        if e.body[place] == NONE:
            continue
        leader = e.place[work.cluster[e.body[place]]]
        for each in range(e.upper[place], e.lower[place + 1]):
            other = e.column[each]
            if other != leader:
                e.column[filled[other]] = place
                filled[other] += 1
        if leader != place:
            e.column[filled[leader]] = place
            filled[leader] += 1


def find_pattern(scene, work):
    """Order the bodies and lay out the blocks of their systems, where that is not known from
    before; False without room."""
    if holds(scene, work):
        return True
    if count_ties(scene, work):
        write_ties(work)
        end = order_bodies(scene, work)
        if end != NONE and lay_out(work, end):
            return True
    work.elimination.found[PATTERN] = 0
    work.tally.full = BLOCKS_FULL
    return False
