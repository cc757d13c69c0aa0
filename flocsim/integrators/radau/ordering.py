"""Elimination order and sparsity pattern of the systems of many bodies.

Minimum degree: the next body to be eliminated is the one with the fewest neighbours, which become
neighbours of each other by that (fill-in). Chains and trees of bodies have no fill-in. The first
body of a cluster is eliminated last, because its row holds the momentum balance of the whole
cluster and would connect all its bodies.

Order and pattern are kept as long as the pairs that act, and the clusters, allow.

Source: George & Liu, SIAM Review 31 (1989), 1, on minimum degree.
"""

from flocsim.state.clock import BLOCKS_FULL

(
    HEAD, NEXT, PREVIOUS, DEGREE, BEGIN, CAPACITY, VISITED, CLUSTER, NODE_ROWS,
) = range(9)  # fmt: skip
"""Rows of ``Elimination.nodes``, for each body: head of the list of bodies of a degree; next and
previous body in that list; degree (number of neighbours); where its neighbours begin in ``graph``,
and how many fit there; a visited mark; the cluster for which the pattern was made."""

PATTERN, END, LISTING, FOUND_SIZE = range(4)
"""Indices of ``Elimination.found``: 1 + number of pairs in the pattern, or 0 without a pattern;
used length of ``graph``; number of the pair list for which the pattern was made."""

NONE = -1
"""No body, or no index."""

SPARE_EDGES = 4
"""Initial room of a body for fill-in."""

MAX_PATTERN_RATIO, PATTERN_ALLOWANCE = 1.5, 8
"""A pattern is kept until it has more than the first number times the pairs that act, plus the
second."""


def is_edge(scene, work, pair):
    """Return True if a pair of bodies is an edge of the graph: it acts, and both bodies are
    free."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    acts = work.pairs[pair].acting == 1
    return acts and scene.bodies[a].free * scene.bodies[b].free == 1.0


def pattern_fits(scene, work):
    """Return True if the present pattern contains all acting pairs, and not many more."""
    e, count = work.elimination, 0
    # Pairs are numbered by their list: a new list needs a new pattern.
    if e.found[PATTERN] == 0 or e.found[LISTING] != work.tally.rebuilds:
        return False
    # The clusters decide which rows hold momentum balances.
    for body in range(work.poses.shape[0]):
        if e.nodes[CLUSTER, body] != work.cluster[body]:
            return False
    # A pair that is missing needs a new pattern; superfluous ones only cost time.
    for pair in range(work.tally.pairs):
        if is_edge(scene, work, pair):
            if e.pairs[pair] == 0:
                return False
            count += 1
    return e.found[PATTERN] - 1 <= MAX_PATTERN_RATIO * count + PATTERN_ALLOWANCE


def count_edges(scene, work):
    """Reserve room for the edges of each body; return False if the graph is too small."""
    e, n = work.elimination, work.poses.shape[0]
    for body in range(n):
        e.nodes[DEGREE, body] = 0
        e.nodes[VISITED, body] = NONE
        e.nodes[CLUSTER, body] = work.cluster[body]
    count = 0
    for pair in range(work.tally.pairs):
        e.pairs[pair] = 1 if is_edge(scene, work, pair) else 0
        if e.pairs[pair] == 1:
            e.nodes[DEGREE, work.pairs[pair].later] += 1
            e.nodes[DEGREE, work.pairs[pair].earlier] += 1
            count += 1
    # Lay out the neighbour lists one after another; the degree starts from zero when they are
    # filled.
    end = 0
    for body in range(n):
        e.nodes[BEGIN, body] = end
        e.nodes[CAPACITY, body] = e.nodes[DEGREE, body] + SPARE_EDGES
        end += e.nodes[CAPACITY, body]
        e.nodes[DEGREE, body] = 0
    e.found[END], e.found[PATTERN], e.found[LISTING] = end, 1 + count, work.tally.rebuilds
    return end <= e.graph.shape[0]


def add_edge(e, body, other):
    e.graph[e.nodes[BEGIN, body] + e.nodes[DEGREE, body]] = other
    e.nodes[DEGREE, body] += 1


def write_graph(work):
    """Write both directions of the edges of all acting pairs."""
    for pair in range(work.tally.pairs):
        if work.elimination.pairs[pair] == 1:
            a, b = work.pairs[pair].later, work.pairs[pair].earlier
            add_edge(work.elimination, a, b)
            add_edge(work.elimination, b, a)


def insert_by_degree(e, body):
    """Insert a body into the list of bodies of its degree."""
    degree = e.nodes[DEGREE, body]
    next_body = e.nodes[HEAD, degree]
    e.nodes[NEXT, body], e.nodes[PREVIOUS, body] = next_body, NONE
    if next_body != NONE:
        e.nodes[PREVIOUS, next_body] = body
    e.nodes[HEAD, degree] = body


def remove_by_degree(e, body):
    """Remove a body from the list of bodies of its degree."""
    previous_body, next_body = e.nodes[PREVIOUS, body], e.nodes[NEXT, body]
    if previous_body == NONE:
        e.nodes[HEAD, e.nodes[DEGREE, body]] = next_body
    else:
        e.nodes[NEXT, previous_body] = next_body
    if next_body != NONE:
        e.nodes[PREVIOUS, next_body] = previous_body


def reserve_edges(e, body, needed):
    """Reserve room for a number of neighbours of a body; return False if the graph is full."""
    if needed <= e.nodes[CAPACITY, body]:
        return True
    # Move the list to the end of the graph, half again as large as needed.
    capacity, end = needed + needed // 2, e.found[END]
    if end + capacity > e.graph.shape[0]:
        return False
    begin = e.nodes[BEGIN, body]
    for edge in range(e.nodes[DEGREE, body]):
        e.graph[end + edge] = e.graph[begin + edge]
    e.nodes[BEGIN, body], e.nodes[CAPACITY, body], e.found[END] = end, capacity, end + capacity
    return True


def connect_neighbours(e, body, eliminated, first, last):
    """Connect a neighbour of an eliminated body to all others; return False without room.

    ``column`` lists these neighbours from ``first`` up to but excluding ``last``.
    """
    # Drop the eliminated body, and mark the neighbours that are known already.
    begin, remaining = e.nodes[BEGIN, body], 0
    for edge in range(e.nodes[DEGREE, body]):
        other = e.graph[begin + edge]
        if other != eliminated:
            e.graph[begin + remaining] = other
            e.nodes[VISITED, other] = body
            remaining += 1
    e.nodes[DEGREE, body] = remaining
    e.nodes[VISITED, body] = body
    if not reserve_edges(e, body, remaining + last - first):
        return False
    # Add the others (fill-in), then clear the marks.
    for index in range(first, last):
        if e.nodes[VISITED, e.column[index]] != body:
            add_edge(e, body, e.column[index])
    for edge in range(e.nodes[DEGREE, body]):
        e.nodes[VISITED, e.graph[e.nodes[BEGIN, body] + edge]] = NONE
    e.nodes[VISITED, body] = NONE
    return True


def is_leader(work, body):
    return work.cluster[body] == body


def eliminate(work, index, body, end):
    """Eliminate a body at an index; return the new end of ``column``, or NONE without room."""
    e = work.elimination
    e.place[body], e.body[index] = index, body
    count = e.nodes[DEGREE, body]
    e.upper[index] = end
    if end + count > e.column.shape[0]:
        return NONE
    # Its neighbours are the columns of its row, right of the diagonal.
    for edge in range(count):
        e.column[end + edge] = e.graph[e.nodes[BEGIN, body] + edge]
    # They become neighbours of each other, and move to the list of their new degree.
    for each in range(end, end + count):
        other = e.column[each]
        if not is_leader(work, other):
            remove_by_degree(e, other)
        if not connect_neighbours(e, other, body, end, end + count):
            return NONE
        if not is_leader(work, other):
            insert_by_degree(e, other)
    return end + count


def order_bodies(scene, work):
    """Order all free bodies, cluster leaders last; return the end of ``column``, or NONE without
    room."""
    e, n = work.elimination, work.poses.shape[0]
    for degree in range(n + 1):
        e.nodes[HEAD, degree] = NONE
    free = 0
    for body in range(n):
        e.place[body] = NONE
        if scene.bodies[body].free == 1.0:
            free += 1
            if not is_leader(work, body):
                insert_by_degree(e, body)
    # Next is a body of the lowest degree. An elimination lowers a degree by one at most: the search
    # goes back one list.
    index, end, degree = 0, 0, 0
    while degree <= n:
        body = e.nodes[HEAD, degree]
        if body == NONE:
            degree += 1
            continue
        remove_by_degree(e, body)
        end = eliminate(work, index, body, end)
        if end == NONE:
            return NONE
        index, degree = index + 1, max(degree - 1, 0)
    # Leaders, in order of their index.
    for body in range(n):
        if scene.bodies[body].free == 1.0 and is_leader(work, body):
            end = eliminate(work, index, body, end)
            index += 1
    # Fixed bodies have empty rows at the end.
    for rest in range(index, n):
        e.body[rest] = NONE
        e.upper[rest] = end
    return end


def sort_columns(e, first, last):
    """Sort a range of ``column`` (insertion sort: it is short)."""
    for index in range(first + 1, last):
        value, free = e.column[index], index
        while free > first and e.column[free - 1] > value:
            e.column[free] = e.column[free - 1]
            free -= 1
        e.column[free] = value


def build_rows(work, end):
    """Turn the neighbour lists into rows: columns left, then right of the diagonal; False without
    room."""
    e, n = work.elimination, work.poses.shape[0]
    # Row BEGIN of the scratch is the number of entries left of each diagonal. The pattern is
    # symmetric, except that a leader's row holds one entry for each member of its cluster.
    for index in range(n):
        e.nodes[BEGIN, index] = 0
    for each in range(end):
        index = e.place[e.column[each]]
        e.column[each] = index
        e.nodes[BEGIN, index] += 1
    for body in range(n):
        if e.place[body] != NONE and is_leader(work, body):
            e.nodes[BEGIN, e.place[body]] = 0
    for body in range(n):
        if e.place[body] != NONE and not is_leader(work, body):
            e.nodes[BEGIN, e.place[work.cluster[body]]] += 1
    total = end
    for index in range(n):
        total += e.nodes[BEGIN, index]
    if total > e.column.shape[0]:
        return False
    # Shift from the end: nothing is overwritten before it has moved.
    begin = total
    for index in range(n - 1, -1, -1):
        last = end if index == n - 1 else e.nodes[CAPACITY, index + 1]
        first = e.upper[index]
        e.nodes[CAPACITY, index] = first
        e.lower[index + 1] = begin
        begin -= last - first
        for each in range(last - first - 1, -1, -1):
            e.column[begin + each] = e.column[first + each]
        e.upper[index] = begin
        begin -= e.nodes[BEGIN, index]
        e.lower[index] = begin
    fill_lower(work)
    return True


def fill_lower(work):
    """Write the columns left of the diagonal in ascending order."""
    e, n = work.elimination, work.poses.shape[0]
    for index in range(n):
        sort_columns(e, e.upper[index], e.lower[index + 1])
        e.nodes[BEGIN, index] = e.lower[index]
    # An entry right of the diagonal in one row is left of it in another.
    for index in range(n):
        if e.body[index] == NONE:
            continue
        leader = e.place[work.cluster[e.body[index]]]
        for each in range(e.upper[index], e.lower[index + 1]):
            other = e.column[each]
            if other != leader:
                e.column[e.nodes[BEGIN, other]] = index
                e.nodes[BEGIN, other] += 1
        if leader != index:
            e.column[e.nodes[BEGIN, leader]] = index
            e.nodes[BEGIN, leader] += 1


def find_pattern(scene, work):
    """Order the bodies and lay out the blocks unless the present pattern fits; return False without
    room."""
    if pattern_fits(scene, work):
        return True
    if count_edges(scene, work):
        write_graph(work)
        end = order_bodies(scene, work)
        if end != NONE and build_rows(work, end):
            return True
    # The caller pauses the run; it is resumed with larger arrays.
    work.elimination.found[PATTERN] = 0
    work.tally.full = BLOCKS_FULL
    return False
