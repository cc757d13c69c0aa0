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

import math

from flocsim.arrays import (
    CANDIDATES,
    CLOSED,
    CLOSEST,
    CLUSTER,
    FIRST,
    FRAMES,
    FREE,
    MASS,
    NOW,
    SCRATCH,
)
from flocsim.hooks import has_centre_force

COLUMNS = 4
"""For each stage: cosine and sine of the turn, and both entries of s."""


def acts(work, row):
    """Whether a pair acts in this step."""
    return work.candidates[row, CLOSED] + work.candidates[row, CLOSEST] > 0


def join(scene, work, a, b):
    """Make one cluster of those of two bodies, named by its first body, if both are free."""
    one, other = work.bodies[a, CLUSTER], work.bodies[b, CLUSTER]
    if one != other and scene.bodies[a, FREE] * scene.bodies[b, FREE] == 1.0:
        for body in range(work.bodies.shape[0]):
            if work.bodies[body, CLUSTER] == max(one, other):
                work.bodies[body, CLUSTER] = min(one, other)


def gather_clusters(scene, work):
    """Name, for each free body, the first one of those that it acts on, directly or not."""
    for body in range(work.bodies.shape[0]):
        work.bodies[body, CLUSTER] = body
    if has_centre_force():
        for body in range(1, work.bodies.shape[0]):
            join(scene, work, body - 1, body)
    for row in range(work.tally[CANDIDATES]):
        if acts(work, row):
            join(scene, work, work.candidates[row, 0], work.candidates[row, 2])


def clear_frames(work):
    """No contact seen yet."""
    for body in range(work.bodies.shape[0]):
        for column in range(FRAMES, FRAMES + 3 * COLUMNS):
            work.bodies[body, column] = 0.0


def add_frame(work, row, stage):
    """Add how a pair's normal has turned, and its contact point wandered, to both of its bodies."""
    g = work.geometry
    ox, oy = g[NOW, row, 0], g[NOW, row, 1]
    nx, ny = g[FIRST + stage, row, 0], g[FIRST + stage, row, 1]
    column = FRAMES + COLUMNS * stage
    for which in range(2):
        body = work.candidates[row, 2 * which]
        across = g[NOW, row, 3 + 2 * which] - g[FIRST + stage, row, 3 + 2 * which]
        along = g[NOW, row, 4 + 2 * which] - g[FIRST + stage, row, 4 + 2 * which]
        work.bodies[body, column] += ox * nx + oy * ny
        work.bodies[body, column + 1] += ox * ny - oy * nx
        work.bodies[body, column + 2] += across * nx - along * ny
        work.bodies[body, column + 3] += across * ny + along * nx


def average_shifts(work):
    """Make means of the sums of s, and add each body's turns to its cluster's."""
    for body in range(work.bodies.shape[0]):
        leader = int(work.bodies[body, CLUSTER])
        for column in range(FRAMES, FRAMES + 3 * COLUMNS, COLUMNS):
            cosine, sine = work.bodies[body, column], work.bodies[body, column + 1]
            size = math.hypot(cosine, sine)
            if size > 0.0:
                work.bodies[body, column + 2] /= size
                work.bodies[body, column + 3] /= size
            if leader != body:
                work.bodies[leader, column] += cosine
                work.bodies[leader, column + 1] += sine


def share_turns(work):
    """Give each body its cluster's turns; none where nothing touches."""
    for body in range(work.bodies.shape[0]):
        leader = int(work.bodies[body, CLUSTER])
        for column in range(FRAMES, FRAMES + 3 * COLUMNS, COLUMNS):
            # Leaders come first, and have the cosine and sine of their sums by then.
            cosine, sine = work.bodies[leader, column], work.bodies[leader, column + 1]
            size = math.hypot(cosine, sine)
            work.bodies[body, column] = cosine / size if size > 0.0 else 1.0
            work.bodies[body, column + 1] = sine / size if size > 0.0 else 0.0


def follow_contacts(work):
    """Frames of all bodies at the three stages: the means over their acting pairs."""
    clear_frames(work)
    for row in range(work.tally[CANDIDATES]):
        if acts(work, row):
            for stage in range(3):
                add_frame(work, row, stage)
    average_shifts(work)
    share_turns(work)


def velocity_on(work, body, stage, x, y):
    """A velocity of the start's frame as it stands at a stage."""
    column = FRAMES + COLUMNS * stage
    cosine, sine = work.bodies[body, column], work.bodies[body, column + 1]
    return cosine * x - sine * y, sine * x + cosine * y


def force_back(work, body, stage, x, y, torque):
    """A force with its torque at a stage, as it is in the start's frame: of the same power."""
    column = FRAMES + COLUMNS * stage
    cosine, sine = work.bodies[body, column], work.bodies[body, column + 1]
    torque += x * work.bodies[body, column + 2] + y * work.bodies[body, column + 3]
    return cosine * x + sine * y, cosine * y - sine * x, torque


def add_shifts(scene, work, stage):
    """Add s ω less its mean over the cluster, for the changes of velocity that SCRATCH holds."""
    changes, column = work.motion, FRAMES + COLUMNS * stage + 2
    for body in range(work.bodies.shape[0]):
        for axis in range(3):
            changes[SCRATCH, body, axis] = 0.0
    for body in range(work.bodies.shape[0]):
        leader = int(work.bodies[body, CLUSTER])
        mass, spin = scene.bodies[body, MASS], changes[SCRATCH, body, 5]
        changes[SCRATCH, leader, 2] += mass
        for axis in range(2):
            shift = spin * work.bodies[body, column + axis]
            changes[SCRATCH, leader, axis] += mass * shift
            changes[SCRATCH, body, 3 + axis] += shift
    for body in range(work.bodies.shape[0]):
        leader = int(work.bodies[body, CLUSTER])
        if scene.bodies[body, FREE] == 1.0:
            for axis in range(2):
                mean = changes[SCRATCH, leader, axis] / changes[SCRATCH, leader, 2]
                changes[SCRATCH, body, 3 + axis] -= mean
