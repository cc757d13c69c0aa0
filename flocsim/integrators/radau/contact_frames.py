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

import flocsim.arrays as at
from flocsim.geometry.contact.points import length_of
from flocsim.hooks import CENTRE_FORCE, has

LEADING_SHARE = 0.2
"""Share of a surface force from which on a pair's normal counts among those that bodies follow,
…"""

LEADING_GAP = 0.1
"""… and the gap, over the smaller one's size, up to which it does: what acts farther away is not
stiff, and drag, which is the same whatever way a pair lies, would be taken along."""


def acts(work, row):
    return work.candidates[row, at.CLOSED] + work.candidates[row, at.NEAR] > 0


def leads(scene, work, row):
    """Whether a pair acts on its bodies strongly enough to tell how they turn."""
    if work.candidates[row, at.CLOSED] != at.OPEN:
        return True
    if work.candidates[row, at.NEAR] == 0 or work.geometry[at.NOW, row, at.SHARE] <= LEADING_SHARE:
        return False
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    size = min(scene.bodies[a, at.BOUNDING_RADIUS], scene.bodies[b, at.BOUNDING_RADIUS])
    return work.geometry[at.NOW, row, at.GAP] < LEADING_GAP * size


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
    a, b = work.pairs[pair, at.LATER], work.pairs[pair, at.EARLIER]
    work.pairs[pair, at.ACTING] = 1
    if scene.bodies[a, at.FREE] * scene.bodies[b, at.FREE] == 1.0:
        unite(work.cluster, a, b)


def gather_clusters(scene, work):
    """Name, for each free body, the first one of those that it acts on, directly or not; flag the
    pairs that act."""
    for body in range(work.bodies.shape[0]):
        work.cluster[body] = body
    for pair in range(work.tally[at.PAIRS]):
        work.pairs[pair, at.ACTING] = 0
        if has(scene, CENTRE_FORCE):
            join(scene, work, pair)
    for row in range(work.tally[at.CANDIDATES]):
        if acts(work, row) and work.pairs[work.candidates[row, at.PAIR], at.ACTING] == 0:
            join(scene, work, work.candidates[row, at.PAIR])
    for body in range(work.bodies.shape[0]):
        work.cluster[body] = work.cluster[work.cluster[body]]


def add_frame(work, row, stage):
    """Add how a pair's normal has turned, and its contact point wandered, to both of its bodies."""
    g, state = work.geometry, at.FIRST_STAGE + stage
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    across = g[at.NOW, row, at.VERTEX_ARM_N] - g[state, row, at.VERTEX_ARM_N]
    along = g[at.NOW, row, at.VERTEX_ARM_T] - g[state, row, at.VERTEX_ARM_T]
    add_to_body(work, row, stage, a, across, along)
    across = g[at.NOW, row, at.EDGE_ARM_N] - g[state, row, at.EDGE_ARM_N]
    along = g[at.NOW, row, at.EDGE_ARM_T] - g[state, row, at.EDGE_ARM_T]
    add_to_body(work, row, stage, b, across, along)


def add_to_body(work, row, stage, body, across, along):
    """Add the turn of a pair's normal to a body's frame, and what its arms have changed by."""
    g, state = work.geometry, at.FIRST_STAGE + stage
    ox, oy = g[at.NOW, row, at.NORMAL_X], g[at.NOW, row, at.NORMAL_Y]
    nx, ny = g[state, row, at.NORMAL_X], g[state, row, at.NORMAL_Y]
    frame = at.FRAMES + at.FRAME_COLUMNS * stage
    work.bodies[body, frame + at.TURN_COSINE] += ox * nx + oy * ny
    work.bodies[body, frame + at.TURN_SINE] += ox * ny - oy * nx
    work.bodies[body, frame + at.SHIFT_X] += across * nx - along * ny
    work.bodies[body, frame + at.SHIFT_Y] += across * ny + along * nx


def average_shifts(work):
    """Make means of the sums of s, and add each body's turns to its cluster's."""
    for body in range(work.bodies.shape[0]):
        leader = work.cluster[body]
        for frame in range(at.FRAMES, at.BODY_COLUMNS, at.FRAME_COLUMNS):
            cosine = work.bodies[body, frame + at.TURN_COSINE]
            sine = work.bodies[body, frame + at.TURN_SINE]
            size = length_of(cosine, sine)
            if size > 0.0:
                work.bodies[body, frame + at.SHIFT_X] /= size
                work.bodies[body, frame + at.SHIFT_Y] /= size
            if leader != body:
                work.bodies[leader, frame + at.TURN_COSINE] += cosine
                work.bodies[leader, frame + at.TURN_SINE] += sine


def share_turns(work):
    """Give each body its cluster's turns; none where nothing touches."""
    for body in range(work.bodies.shape[0]):
        leader = work.cluster[body]
        for frame in range(at.FRAMES, at.BODY_COLUMNS, at.FRAME_COLUMNS):
            # Leaders come first, and have the cosine and sine of their sums by then.
            cosine = work.bodies[leader, frame + at.TURN_COSINE]
            sine = work.bodies[leader, frame + at.TURN_SINE]
            size = length_of(cosine, sine)
            work.bodies[body, frame + at.TURN_COSINE] = cosine / size if size > 0.0 else 1.0
            work.bodies[body, frame + at.TURN_SINE] = sine / size if size > 0.0 else 0.0


def follow_contacts(scene, work):
    """Frames of all bodies at the three stages: the means over their acting pairs."""
    for body in range(work.bodies.shape[0]):
        for column in range(at.FRAMES, at.FRAMES + at.MOST_FRAMES * at.FRAME_COLUMNS):
            work.bodies[body, column] = 0.0
    for row in range(work.tally[at.CANDIDATES]):
        if leads(scene, work, row):
            for stage in range(3):
                add_frame(work, row, stage)
    average_shifts(work)
    share_turns(work)


def turn_at(work, body, stage):
    """Cosine and sine of the turn of a body's frame at a stage."""
    frame = at.FRAMES + at.FRAME_COLUMNS * stage
    return work.bodies[body, frame + at.TURN_COSINE], work.bodies[body, frame + at.TURN_SINE]


def shift_at(work, body, stage):
    """s of a body's frame at a stage [m]."""
    frame = at.FRAMES + at.FRAME_COLUMNS * stage
    return work.bodies[body, frame + at.SHIFT_X], work.bodies[body, frame + at.SHIFT_Y]


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
    change, bodies = work.motion, work.bodies
    for body in range(bodies.shape[0]):
        bodies[body, at.MASS_SUM] = 0.0
        for axis in range(2):
            bodies[body, at.SHIFT_SUM + axis] = 0.0
    for body in range(bodies.shape[0]):
        leader = work.cluster[body]
        mass, spin = scene.bodies[body, at.MASS], change[at.CHANGE, body, at.SPIN]
        bodies[leader, at.MASS_SUM] += mass
        for axis in range(2):
            shift = spin * bodies[body, at.FRAMES + at.FRAME_COLUMNS * stage + at.SHIFT_X + axis]
            bodies[leader, at.SHIFT_SUM + axis] += mass * shift
            change[at.CHANGE, body, at.VELOCITY + axis] += shift
    for body in range(bodies.shape[0]):
        leader = work.cluster[body]
        if scene.bodies[body, at.FREE] == 1.0:
            for axis in range(2):
                mean = bodies[leader, at.SHIFT_SUM + axis] / bodies[leader, at.MASS_SUM]
                change[at.CHANGE, body, at.VELOCITY + axis] -= mean
