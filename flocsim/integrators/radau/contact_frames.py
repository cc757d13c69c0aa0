"""Corotational frames: how a body's contacts rotate and move from the start of a step to its
stages.

A stiff contact is stiff along one direction of its bodies' coordinates only. Where it turns or
rolls, derivatives from the start of the step point in the wrong direction at the stages, and the
simplified Newton iteration diverges once the turn ω h exceeds 1/√(ω0 h), however smooth the motion
is. In frames that rotate with the normals and move with the contact points, the derivatives stay
valid:

    v = R v' + s ω − mean(s ω),  s = ẑ × (R p_start − p_stage)

for a velocity v of the centroid, with the rotation R of the normals and the arm p of the contacts.
R and the mean over masses are common to all bodies of a cluster (bodies that act on one another,
directly or not). So a correction of the velocities conserves their momentum.
"""

from flocsim.geometry.contact.points import length_of
from flocsim.hooks import CENTRE_FORCE, has
from flocsim.state.bodies import ANGLE, MOST_FRAMES, X, Y
from flocsim.state.contacts import OPEN
from flocsim.state.work import CHANGE, FIRST_STAGE, NOW

MAX_RELATIVE_GAP = 0.1
"""Gap, over the radius of the smaller body, up to which a surface force counts for the frames.
Forces at larger gaps are not stiff. Following them would rotate the drag, too, which does not
depend on the direction of the pair, and would double the number of Newton iterations."""


def is_active(work, row):
    # Closed, grazing, or with a share in a surface force.
    candidate = work.candidates[row]
    return candidate.contact_mode + candidate.surface_active > 0


def frame_weight(scene, work, row):
    """Return the weight of a pair's normal in the frames of its bodies, 0 where its force is not
    stiff."""
    candidate = work.candidates[row]
    geometry = work.geometry[NOW, row]
    if candidate.contact_mode != OPEN:
        return 1.0
    a, b = candidate.vertex_body, candidate.edge_body
    size = min(scene.bodies[a].bounding_radius, scene.bodies[b].bounding_radius)
    stiff = candidate.surface_active == 1 and geometry.gap < MAX_RELATIVE_GAP * size
    return geometry.force_share if stiff else 0.0


def find_root(labels, body):
    """Return the first body of the cluster built so far (union-find, with path halving)."""
    while labels[body] != body:
        labels[body] = labels[labels[body]]
        body = labels[body]
    return body


def merge(labels, a, b):
    """Merge the clusters of two bodies; the lower index becomes the root."""
    one, other = find_root(labels, a), find_root(labels, b)
    labels[max(one, other)] = min(one, other)


def merge_pair(scene, work, pair):
    """Mark a pair of bodies as acting, and merge their clusters if both bodies are free."""
    a, b = work.pairs[pair].later, work.pairs[pair].earlier
    work.pairs[pair].acting = 1
    # A fixed body, a wall for example, takes any momentum: it joins nothing.
    if scene.bodies[a].free * scene.bodies[b].free == 1.0:
        merge(work.cluster, a, b)


def gather_clusters(scene, work):
    """Find the clusters: write the first body of each free body's cluster; mark the pairs that
    act."""
    for body in range(work.poses.shape[0]):
        work.cluster[body] = body
    for pair in range(work.tally.pairs):
        work.pairs[pair].acting = 0
        # Centre forces act at any distance.
        if has(scene, CENTRE_FORCE):
            merge_pair(scene, work, pair)
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if is_active(work, row) and work.pairs[candidate.pair].acting == 0:
            merge_pair(scene, work, candidate.pair)
    # Roots are lower than their members: one pass in ascending order resolves every chain.
    for body in range(work.poses.shape[0]):
        work.cluster[body] = work.cluster[work.cluster[body]]


def add_pair_to_frames(work, row, stage, weight):
    """Add the turn of a pair's normal, and the displacement of its contact point, to both bodies,
    with a weight."""
    candidate = work.candidates[row]
    g, state = work.geometry, FIRST_STAGE + stage
    a, b = candidate.vertex_body, candidate.edge_body
    change_normal = g[NOW, row].vertex_arm_n - g[state, row].vertex_arm_n
    change_tangential = g[NOW, row].vertex_arm_t - g[state, row].vertex_arm_t
    add_to_frame(work, row, stage, a, weight, change_normal, change_tangential)
    change_normal = g[NOW, row].edge_arm_n - g[state, row].edge_arm_n
    change_tangential = g[NOW, row].edge_arm_t - g[state, row].edge_arm_t
    add_to_frame(work, row, stage, b, weight, change_normal, change_tangential)


def add_to_frame(work, row, stage, body, weight, change_normal, change_tangential):
    """Add the turn of a pair's normal, and the change of its arm, to the frame of one body."""
    g, state = work.geometry, FIRST_STAGE + stage
    normal_x_start, normal_y_start = g[NOW, row].normal_x, g[NOW, row].normal_y
    nx, ny = weight * g[state, row].normal_x, weight * g[state, row].normal_y
    frame = work.frames[body, stage]
    # Cosine and sine are summed over pairs and normalised later: the mean of rotations.
    frame.rotation_cosine += normal_x_start * nx + normal_y_start * ny
    frame.rotation_sine += normal_x_start * ny - normal_y_start * nx
    frame.shift_x += change_normal * nx - change_tangential * ny
    frame.shift_y += change_normal * ny + change_tangential * nx


def average_frames(work):
    """Make s the mean over a body's pairs, and add its rotations to those of its cluster."""
    for body in range(work.poses.shape[0]):
        leader = work.cluster[body]
        for stage in range(MOST_FRAMES):
            frame = work.frames[body, stage]
            cosine, sine = frame.rotation_cosine, frame.rotation_sine
            size = length_of(cosine, sine)
            if size > 0.0:
                frame.shift_x /= size
                frame.shift_y /= size
            if leader != body:
                work.frames[leader, stage].rotation_cosine += cosine
                work.frames[leader, stage].rotation_sine += sine


def assign_rotations(work):
    """Give each body the mean rotation of its cluster; none where nothing is in contact."""
    for body in range(work.poses.shape[0]):
        leader = work.cluster[body]
        for stage in range(MOST_FRAMES):
            frame = work.frames[body, stage]
            # A leader has the lowest index of its cluster. Its sums are unit vectors by the time
            # that its members read them.
            cosine = work.frames[leader, stage].rotation_cosine
            sine = work.frames[leader, stage].rotation_sine
            size = length_of(cosine, sine)
            frame.rotation_cosine = cosine / size if size > 0.0 else 1.0
            frame.rotation_sine = sine / size if size > 0.0 else 0.0


def update_frames(scene, work):
    """Compute the frames of all bodies at the three stages from the pairs that define them."""
    for body in range(work.poses.shape[0]):
        for stage in range(MOST_FRAMES):
            frame = work.frames[body, stage]
            frame.rotation_cosine = frame.rotation_sine = frame.shift_x = frame.shift_y = 0.0
    for row in range(work.tally.candidates):
        weight = frame_weight(scene, work, row)
        if weight > 0.0:
            for stage in range(3):
                add_pair_to_frames(work, row, stage, weight)
    average_frames(work)
    assign_rotations(work)


def rotation_at(work, body, stage):
    """Return cosine and sine of the rotation of a body's frame at a stage."""
    frame = work.frames[body, stage]
    return frame.rotation_cosine, frame.rotation_sine


def shift_at(work, body, stage):
    """Return s of a body's frame at a stage [m]."""
    frame = work.frames[body, stage]
    return frame.shift_x, frame.shift_y


def velocity_at_stage(work, body, stage, x, y):
    """Rotate a velocity from the frame of the step's start to that of a stage."""
    cosine, sine = rotation_at(work, body, stage)
    return cosine * x - sine * y, sine * x + cosine * y


def force_at_start(work, body, stage, x, y, torque):
    """Return a stage's force and torque in the frame of the step's start, at equal power."""
    cosine, sine = rotation_at(work, body, stage)
    shift_x, shift_y = shift_at(work, body, stage)
    torque += x * shift_x + y * shift_y
    return cosine * x + sine * y, cosine * y - sine * x, torque


def add_shifts(scene, work, stage):
    """Add s ω minus its cluster mean to the velocity corrections in CHANGE."""
    for body in range(work.poses.shape[0]):
        cluster = work.clusters[body]
        cluster.mass = cluster.shift_x = cluster.shift_y = 0.0
    for body in range(work.poses.shape[0]):
        # Add s ω, and sum its momentum over the cluster.
        cluster, frame = work.clusters[work.cluster[body]], work.frames[body, stage]
        mass, spin = scene.bodies[body].mass, work.velocity[CHANGE, body, ANGLE]
        cluster.mass += mass
        shift_x, shift_y = spin * frame.shift_x, spin * frame.shift_y
        cluster.shift_x += mass * shift_x
        cluster.shift_y += mass * shift_y
        work.velocity[CHANGE, body, X] += shift_x
        work.velocity[CHANGE, body, Y] += shift_y
    # Subtract the mean, which leaves the momentum as it was.
    for body in range(work.poses.shape[0]):
        cluster = work.clusters[work.cluster[body]]
        if scene.bodies[body].free == 1.0:
            work.velocity[CHANGE, body, X] -= cluster.shift_x / cluster.mass
            work.velocity[CHANGE, body, Y] -= cluster.shift_y / cluster.mass
