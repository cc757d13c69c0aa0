"""Elimination order and sparsity pattern of the systems of a step.

Minimum degree: the next body to be eliminated is the one with the fewest neighbours, which become
neighbours of each other by that (fill-in). Chains and trees of bodies have no fill-in. The first
body of a cluster is eliminated last, because its row holds the momentum balance of the whole
cluster and would connect all its bodies.

Order and pattern are kept as long as the pattern has all pairs that act, and clusters stay. They
are found in a table of all bodies by all: n² steps are little beside the systems that a pattern
serves.

Source: George & Liu, SIAM Review 31 (1989), 1, on minimum degree.
"""

from flocsim.state.clock import BLOCKS_FULL

NONE = -1
"""No body, or no index."""


def is_edge(scene, work, pair):
    """Return True if a pair of bodies is an edge of the graph: it acts, and both bodies are
    free."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    acts = work.pairs[pair].acting == 1
    return acts and scene.bodies[a].free * scene.bodies[b].free == 1.0


def is_leader(work, body):
    """Return True for the first body of a cluster."""
    return work.cluster[body] == body


def pattern_fits(scene, work):
    """Return True if the present pattern contains all acting pairs."""
    e = work.elimination
    if e.pattern[0] == 0:
        return False
    # The clusters decide which rows hold momentum balances.
    for body in range(work.poses.shape[0]):
        if e.cluster[body] != work.cluster[body]:
            return False
    # A pair that is missing needs a new pattern; superfluous ones only cost time.
    for pair in range(work.tally.pairs):
        is_joined = e.joined[work.pairs[pair].later, work.pairs[pair].earlier] == 1
        if is_edge(scene, work, pair) and not is_joined:
            return False
    return True


def join(e, a, b):
    """Make two bodies neighbours."""
    if e.joined[a, b] == 0:
        e.joined[a, b] = e.joined[b, a] = 1
        e.degree[a] += 1
        e.degree[b] += 1


def join_pairs(scene, work):
    """Make the bodies of each acting pair neighbours, and no others; none is eliminated yet."""
    e, n = work.elimination, work.poses.shape[0]
    for body in range(n):
        e.cluster[body] = work.cluster[body]
        e.place[body] = e.body[body] = NONE
        e.degree[body] = 0
        for other in range(n):
            e.joined[body, other] = 0
    e.pattern[0] = 1
    for pair in range(work.tally.pairs):
        if is_edge(scene, work, pair):
            join(e, work.pairs[pair].later, work.pairs[pair].earlier)


def next_body(scene, work):
    """Return the free body with the fewest neighbours, a leader after all others; NONE is left."""
    e, n = work.elimination, work.poses.shape[0]
    found, least = NONE, 2 * n
    for body in range(n):
        if e.place[body] == NONE and scene.bodies[body].free == 1.0:
            rank = e.degree[body] + (n if is_leader(work, body) else 0)
            if rank < least:
                found, least = body, rank
    return found


def eliminate(e, body, index):
    """Eliminate a body at an index: the neighbours that are left become neighbours of each
    other."""
    e.place[body], e.body[index] = index, body
    count = 0
    for other in range(e.place.shape[0]):
        if e.joined[body, other] == 1 and e.place[other] == NONE:
            e.degree[other] -= 1
            # ``where`` is scratch until a row is factorised.
            e.where[count] = other
            count += 1
    for each in range(count):
        for earlier in range(each):
            join(e, e.where[each], e.where[earlier])


def has_entry(e, row, column):
    """Return True if a row has a block in a column."""
    body, other = e.body[row], e.body[column]
    if body == NONE or other == NONE:
        return False
    # The row of a cluster's first body holds the momentum balance of all.
    return e.joined[body, other] == 1 or e.cluster[other] == body


def build_rows(e):
    """List the columns of each row's blocks in ascending order; return False without room."""
    n, end = e.place.shape[0], 0
    for row in range(n):
        e.lower[row] = end
        for column in range(n):
            if column == row:
                e.upper[row] = end
            elif has_entry(e, row, column):
                if end == e.column.shape[0]:
                    return False
                e.column[end] = column
                end += 1
    e.lower[n] = end
    return True


def find_pattern(scene, work):
    """Order the bodies and lay out the blocks unless the present pattern fits; return False without
    room."""
    if pattern_fits(scene, work):
        return True
    e, index = work.elimination, 0
    join_pairs(scene, work)
    body = next_body(scene, work)
    while body != NONE:
        eliminate(e, body, index)
        index += 1
        body = next_body(scene, work)
    if build_rows(e):
        return True
    # The caller pauses the run; it is resumed with larger arrays.
    e.pattern[0] = 0
    work.tally.full = BLOCKS_FULL
    return False
