"""Frames that go with a body's contacts from the start of a step to its stages.

A stiff contact is stiff along one direction of its bodies' coordinates only. Where it turns or
rolls, derivatives from the start of the step point the wrong way at the stages, and Newton's method
fails once the turn ω h is more than 1/√(ω0 h), however smooth the motion. Seen from the contact
points, in frames that turn with the normals, the directions stay what they were:

    v = R v' + s ω − mean of all s ω,  s = ẑ × (R p_start − p_stage)

for a velocity v of the centroid, R being the turn of the normals and p the arm to the contacts. R
and the mean, weighted by the masses, are those of all bodies that act on one another, so that what
Newton's method adds keeps their momentum however far it has come.
"""

from flocsim.geometry.contact.points import length_of
from flocsim.hooks import CENTRE_FORCE, has
from flocsim.state.bodies import ANGLE, MOST_FRAMES, X, Y
from flocsim.state.contacts import OPEN
from flocsim.state.work import CHANGE, FIRST_STAGE, NOW

LEADING_SHARE = 0.2
"""Share of a surface force from which on a pair's normal counts among those that bodies follow,
…"""

LEADING_GAP = 0.1
"""… and the gap, over the smaller one's size, up to which it does: what acts farther away is not
stiff, and drag, which is the same whatever way a pair lies, would be taken along."""


def acts(work, row):
    candidate = work.candidates[row]
    return candidate.contact_mode + candidate.surface_active > 0


def leads(scene, work, row):
    """Whether a pair acts on its bodies strongly enough to tell how they turn."""
    candidate = work.candidates[row]
    geometry = work.geometry[NOW, row]
    if candidate.contact_mode != OPEN:
        return True
    if candidate.surface_active == 0 or geometry.force_share <= LEADING_SHARE:
        return False
    a, b = candidate.vertex_body, candidate.edge_body
    size = min(scene.bodies[a].bounding_radius, scene.bodies[b].bounding_radius)
    return geometry.gap < LEADING_GAP * size


def first_of(labels, body):
    """The first body of the cluster so far, by those that bodies have been joined to."""
    while labels[body] != body:
        labels[body] = labels[labels[body]]
        body = labels[body]
    return body


def unite(labels, a, b):
    """Make one cluster of those of two bodies."""
    one, other = first_of(labels, a), first_of(labels, b)
    labels[max(one, other)] = min(one, other)


def join(scene, work, pair):
    """Make one cluster of those of the bodies of a pair, if both are free."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    work.pairs[pair].acting = 1
    if scene.bodies[a].free * scene.bodies[b].free == 1.0:
        unite(work.cluster, a, b)


def gather_clusters(scene, work):
    """Name, for each free body, the first one of those that it acts on, directly or not; flag the
    pairs that act."""
    for body in range(work.poses.shape[0]):
        work.cluster[body] = body
    for pair in range(work.tally.pairs):
        work.pairs[pair].acting = 0
        if has(scene, CENTRE_FORCE):
            join(scene, work, pair)
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if acts(work, row) and work.pairs[candidate.pair].acting == 0:
            join(scene, work, candidate.pair)
    for body in range(work.poses.shape[0]):
        work.cluster[body] = work.cluster[work.cluster[body]]


def add_frame(work, row, stage):
    """Add how a pair's normal has turned, and its contact point wandered, to both of its bodies."""
    candidate = work.candidates[row]
    g, state = work.geometry, FIRST_STAGE + stage
    a, b = candidate.vertex_body, candidate.edge_body
    across = g[NOW, row].vertex_arm_n - g[state, row].vertex_arm_n
    along = g[NOW, row].vertex_arm_t - g[state, row].vertex_arm_t
    add_to_body(work, row, stage, a, across, along)
    across = g[NOW, row].edge_arm_n - g[state, row].edge_arm_n
    along = g[NOW, row].edge_arm_t - g[state, row].edge_arm_t
    add_to_body(work, row, stage, b, across, along)


def add_to_body(work, row, stage, body, across, along):
    """Add the turn of a pair's normal to a body's frame, and what its arms have changed by."""
    g, state = work.geometry, FIRST_STAGE + stage
    ox, oy = g[NOW, row].normal_x, g[NOW, row].normal_y
    nx, ny = g[state, row].normal_x, g[state, row].normal_y
    frame = work.frames[body, stage]
    frame.turn_cosine += ox * nx + oy * ny
    frame.turn_sine += ox * ny - oy * nx
    frame.shift_x += across * nx - along * ny
    frame.shift_y += across * ny + along * nx


def average_shifts(work):
    """Make means of the sums of s, and add each body's turns to its cluster's."""
    for body in range(work.poses.shape[0]):
        leader = work.cluster[body]
        for stage in range(MOST_FRAMES):
            frame = work.frames[body, stage]
            cosine, sine = frame.turn_cosine, frame.turn_sine
            size = length_of(cosine, sine)
            if size > 0.0:
                frame.shift_x /= size
                frame.shift_y /= size
            if leader != body:
                work.frames[leader, stage].turn_cosine += cosine
                work.frames[leader, stage].turn_sine += sine


def share_turns(work):
    """Give each body its cluster's turns; none where nothing touches."""
    for body in range(work.poses.shape[0]):
        leader = work.cluster[body]
        for stage in range(MOST_FRAMES):
            frame = work.frames[body, stage]
            # Leaders come first, and have the cosine and sine of their sums by then.
            cosine = work.frames[leader, stage].turn_cosine
            sine = work.frames[leader, stage].turn_sine
            size = length_of(cosine, sine)
            frame.turn_cosine = cosine / size if size > 0.0 else 1.0
            frame.turn_sine = sine / size if size > 0.0 else 0.0


def follow_contacts(scene, work):
    """Frames of all bodies at the three stages: the means over their acting pairs."""
    for body in range(work.poses.shape[0]):
        for stage in range(MOST_FRAMES):
            frame = work.frames[body, stage]
            frame.turn_cosine = frame.turn_sine = frame.shift_x = frame.shift_y = 0.0
    for row in range(work.tally.candidates):
        if leads(scene, work, row):
            for stage in range(3):
                add_frame(work, row, stage)
    average_shifts(work)
    share_turns(work)


def turn_at(work, body, stage):
    """Cosine and sine of the turn of a body's frame at a stage."""
    frame = work.frames[body, stage]
    return frame.turn_cosine, frame.turn_sine


def shift_at(work, body, stage):
    """s of a body's frame at a stage [m]."""
    frame = work.frames[body, stage]
    return frame.shift_x, frame.shift_y


def velocity_on(work, body, stage, x, y):
    """A velocity of the start's frame as it stands at a stage."""
    cosine, sine = turn_at(work, body, stage)
    return cosine * x - sine * y, sine * x + cosine * y


def force_back(work, body, stage, x, y, torque):
    """A force with its torque at a stage, as it is in the start's frame: of the same power."""
    cosine, sine = turn_at(work, body, stage)
    shift_x, shift_y = shift_at(work, body, stage)
    torque += x * shift_x + y * shift_y
    return cosine * x + sine * y, cosine * y - sine * x, torque


def add_shifts(scene, work, stage):
    """Add s ω less its mean over the cluster, for the changes of velocity that CHANGE holds."""
    for body in range(work.poses.shape[0]):
        cluster = work.clusters[body]
        cluster.mass = cluster.shift_x = cluster.shift_y = 0.0
    for body in range(work.poses.shape[0]):
        cluster, frame = work.clusters[work.cluster[body]], work.frames[body, stage]
        mass, spin = scene.bodies[body].mass, work.velocity[CHANGE, body, ANGLE]
        cluster.mass += mass
        shift_x, shift_y = spin * frame.shift_x, spin * frame.shift_y
        cluster.shift_x += mass * shift_x
        cluster.shift_y += mass * shift_y
        work.velocity[CHANGE, body, X] += shift_x
        work.velocity[CHANGE, body, Y] += shift_y
    for body in range(work.poses.shape[0]):
        cluster = work.clusters[work.cluster[body]]
        if scene.bodies[body].free == 1.0:
            work.velocity[CHANGE, body, X] -= cluster.shift_x / cluster.mass
            work.velocity[CHANGE, body, Y] -= cluster.shift_y / cluster.mass
