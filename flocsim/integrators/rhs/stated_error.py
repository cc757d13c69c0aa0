"""The error that a run states: what the errors of its steps and of its switches have led to by now.

A step's error of place stays, one of velocity goes on moving a body until drag has used it up:

    dE_x/dt = E_v,  dE_v/dt = −E_v/τ,

with what every step adds to both. A switch adds to E_v: a touch that is noticed g too deep, or a
parting g too late, at the speed v, leaves out (or adds) the contact's force for a time g/v.
A contact that may be open, because it overlaps by no more than its gap may be wrong by, leaves the
force in doubt for all of the step; where a step leaves its vibration out, the load decides.
One that grazes (events/grazes.py) has a tangential force that it may have lost by the law, where it
parts again and again: all of it counts as an error, and the load that it lifts.

These sums know nothing of what contacts take up, nor that errors cancel. A method that has the
forces' derivatives carries the error on as a vector, too (radau/carried_error.py), and the smaller
of both is stated. OF_VECTOR, OF_SWITCHES, and a method's ``estimate_share`` of
what it estimates for its steps, were found on random runs that make a nudge grow less than tenfold
(benchmarks/accuracy/stated_error.py); what amplifies it more, as a doublet that tips over one way
or the other, is told by a nudged companion alone.
"""

import math

import flocsim.arrays as at
from flocsim.compiler.linker import apart
from flocsim.geometry.contact.candidates import slip_error
from flocsim.geometry.contact.points import length_of
from flocsim.hooks import CONTACT_FORCE, contact_force, has, hook
from flocsim.integrators.rhs.friction import coupling, grazing_force, normal_mobility
from flocsim.integrators.rhs.views import (
    along_normal,
    contact_view,
    lever,
    memory_of,
    normal_rate,
    pressed_view,
)

OF_SWITCHES = 1.5
"""By how much motion may have made the errors of switches grow."""

OF_VECTOR = 13.0
"""By how much the error may be larger than the vector of it that is carried along, …"""

OF_LOST = 2.5
"""By how much motion may have made that grow which pairs that graze have lost: a
carried error does not know that contacts end sooner or later by it, …"""

OF_BOUNDS = OF_LOST / OF_VECTOR
"""… and has it by this share, for it is a bound, and no estimate that the vector has to cover."""

LEAST, OF_SUMS = 0.006, 0.15 / OF_VECTOR
"""… which, for its parts may cancel by chance, counts as this share of the tolerance at least, and
as that of the sum of what switches have added: a dozen grazes kick it to and fro."""

DOUBT = 2.0
"""A contact that overlaps by less than so many times what its gap may be wrong by may be open."""

UNRESOLVED = 50.0
"""A step of so many times 1/ω0 leaves a contact's vibration out; a shorter one in part."""

LONG = 1e6
"""A relaxation so many times as long as a step counts as none."""


def carried(work, body, place, speed, step):
    """Carry one kind of error of a body over a step."""
    errors, lasting = work.bodies, work.bodies[body, at.RELAXATION]
    left = math.exp(-step / lasting) if step < LONG * lasting else 0.0
    way = step if lasting > LONG * step else lasting * (1.0 - left)
    errors[body, place] += errors[body, speed] * way
    errors[body, speed] *= left


def rate_of_growth(scene, work):
    """By how much the velocity of the error changes over a step, along its place and over that
    [1/s]: CHANGE is what CARRIED has become; above 0 where forces drive bodies apart, or together,
    the more, the farther they are off. 0 where tangential displacements are wrong, too: the error
    does not follow from what it was, then."""
    pushed = size = 0.0
    for body in range(work.motion.shape[1]):
        for axis in range(3):
            if work.motion[at.FORCING, body, at.VELOCITY + axis] != 0.0:
                return 0.0
            square = lever(scene, body, axis) ** 2
            now, later = work.motion[at.CARRIED, body, axis], work.motion[at.CHANGE, body, axis]
            more = work.motion[at.CHANGE, body, at.VELOCITY + axis]
            more -= work.motion[at.CARRIED, body, at.VELOCITY + axis]
            pushed += 0.5 * square * (now + later) * more
            size += square * 0.25 * (now + later) ** 2
    return pushed / size if pushed > 0.0 and size > 0.0 else 0.0


def grow_sums(scene, work, step):
    """Make the sums of errors grow as the vector of them does in a step in which nothing swings:
    they know nothing else of an attraction that gets steeper."""
    rate = min(rate_of_growth(scene, work), 1.0 / step)
    for body in range(work.bodies.shape[0]):
        work.bodies[body, at.ERROR_SPEED] += rate * work.bodies[body, at.ERROR_PLACE]
        work.bodies[body, at.SWITCH_SPEED] += rate * work.bodies[body, at.SWITCH_PLACE]
        work.bodies[body, at.DOUBT_SPEED] += rate * work.bodies[body, at.DOUBT_PLACE]


@hook
def carry_vector(scene, work, clock, step):
    """Carry the error as a vector, too, where the method has the forces' derivatives; how large it
    is in the place of an outline [m], inf where it has not."""
    return math.inf


@apart
def carry_errors(scene, work, clock, step):
    """Carry every body's errors over a step that has been accepted, and add the step's own."""
    known, errors = False, work.bodies
    # All counts that is estimated where features come to share in a surface force inside of steps,
    # and of steps across switches, of which nothing is carried on with motion.
    across = clock[at.ACROSS] == 1.0
    share = 1.0 if scene.surface_reach > 0.0 else clock[at.ESTIMATE_SHARE]
    weight = 1.0 / share if across else 1.0
    for body in range(work.bodies.shape[0]):
        carried(work, body, at.ERROR_PLACE, at.ERROR_SPEED, step)
        carried(work, body, at.SWITCH_PLACE, at.SWITCH_SPEED, step)
        carried(work, body, at.DOUBT_PLACE, at.DOUBT_SPEED, step)
        errors[body, at.ERROR_PLACE] += weight * errors[body, at.STEP_PLACE]
        errors[body, at.ERROR_SPEED] += weight * errors[body, at.STEP_SPEED]
        known = known or errors[body, at.STEP_PLACE] + errors[body, at.STEP_SPEED] > 0.0
    largest = 0.0
    for body in range(work.bodies.shape[0]):
        if not known:
            errors[body, at.ERROR_PLACE] += clock[at.STEP_ERROR]
        stated = share * errors[body, at.ERROR_PLACE]
        stated += OF_SWITCHES * (errors[body, at.SWITCH_PLACE] + errors[body, at.DOUBT_PLACE])
        largest = max(largest, stated)
        if across:
            for axis in range(at.MOTION_COLUMNS):
                work.motion[at.CARRIED, body, axis] += work.motion[at.DEVIATION, body, axis]
    vector = math.inf if across else carry_vector(scene, work, clock, step)
    clock[at.ERROR] = 0.0
    for body in range(work.bodies.shape[0]):
        stated = largest
        if vector < math.inf:
            least = max(
                LEAST * clock[at.TOLERANCE],
                OF_SUMS * errors[body, at.SWITCH_PLACE],
            )
            own = max(carried_size(scene, work, body), least)
            stated = min(stated, OF_VECTOR * own)
        errors[body, at.STATED] = stated
        clock[at.ERROR] = max(clock[at.ERROR], stated)


@hook
def overlap_error(scene, work, clock, row):
    """By how much a method may have the overlap of a contact wrong beside its motion [m]."""
    return 0.0


def carried_size(scene, work, body):
    """How large a body's carried error is in the place of its outline [m]."""
    e = work.motion
    turn = scene.bodies[body, at.BOUNDING_RADIUS] * abs(e[at.CARRIED, body, at.ANGLE])
    return length_of(e[at.CARRIED, body, at.X], e[at.CARRIED, body, at.Y]) + turn


def certain_sum(work, body):
    """By how much the place of a body may be wrong, by the sums of its errors, if no contact has
    opened that may have [m]."""
    return work.bodies[body, at.ERROR_PLACE] + OF_SWITCHES * work.bodies[body, at.SWITCH_PLACE]


def sum_of_place(work, body):
    """By how much the place of a body may be wrong, by the sums of its errors [m]."""
    return certain_sum(work, body) + OF_SWITCHES * work.bodies[body, at.DOUBT_PLACE]


def hand_on(work, body, size):
    """Count as its own error of a body what others have handed on to it; ``size`` [m]: of its
    carried error."""
    more = size - sum_of_place(work, body)
    if more > 0.0:
        work.bodies[body, at.ERROR_PLACE] += more


def shorten(scene, work):
    """Shorten the carried error of every cluster to what its places can be wrong by: each by its
    own sums, or by those of any other one, as bodies that hold each other hand their errors on.
    Doubts count for their own bodies alone: what they come to is no error until it happens.

    All of it by one factor, for it must not give the cluster a momentum that no step and no switch
    has given it, and velocities too: those of vibrations are what their places make them.
    """
    for body in range(work.bodies.shape[0]):
        work.bodies[body, at.SHORTENED], work.bodies[body, at.MOST_PLACE] = 1.0, 0.0
    for body in range(work.bodies.shape[0]):
        leader = work.cluster[body]
        most = max(work.bodies[leader, at.MOST_PLACE], certain_sum(work, body))
        work.bodies[leader, at.MOST_PLACE] = most
    for body in range(work.bodies.shape[0]):
        leader, size = work.cluster[body], carried_size(scene, work, body)
        most = max(work.bodies[leader, at.MOST_PLACE], sum_of_place(work, body))
        if size > most:
            work.bodies[leader, at.SHORTENED] = min(work.bodies[leader, at.SHORTENED], most / size)
    for body in range(work.bodies.shape[0]):
        share = work.bodies[work.cluster[body], at.SHORTENED]
        if share < 1.0:
            for axis in range(at.MOTION_COLUMNS):
                work.motion[at.CARRIED, body, axis] *= share
    for row in range(work.tally[at.CANDIDATES]):
        share = work.bodies[work.cluster[work.candidates[row, at.VERTEX_BODY]], at.SHORTENED]
        if share < 1.0:
            work.slip[at.SLIP_OFFSET, row] *= share


def bound_carried(scene, work):
    """Keep the vector of every cluster within the sums of its parts, which a mode that switches
    again and again would make it leave; the largest one of place [m]."""
    largest = 0.0
    shorten(scene, work)
    for body in range(work.bodies.shape[0]):
        size = carried_size(scene, work, body)
        hand_on(work, body, size)
        largest = max(largest, size)
    return largest


def add_impulse(scene, work, body, impulse, kind):
    """Add what an impulse at its outline [N s] does to a body's velocity to SWITCH_SPEED or
    DOUBT_SPEED."""
    if scene.bodies[body, at.FREE] == 1.0:
        size = scene.bodies[body, at.BOUNDING_RADIUS]
        share = 1.0 / scene.bodies[body, at.MASS] + size * size / scene.bodies[body, at.INERTIA]
        work.bodies[body, kind] += impulse * share


def kick(scene, work, body, x, y, turn):
    """Add an impulse [N s, N s, N m s] to a body's carried error."""
    if scene.bodies[body, at.FREE] == 1.0:
        e, inertia = work.motion, scene.bodies
        e[at.CARRIED, body, at.VX] += x / inertia[body, at.MASS]
        e[at.CARRIED, body, at.VY] += y / inertia[body, at.MASS]
        e[at.CARRIED, body, at.SPIN] += turn / inertia[body, at.INERTIA]


def kick_pair(scene, work, row, normal, tangential):
    """Add the impulses of a contact [N s] to the carried errors of its bodies."""
    g = work.geometry
    nx, ny = g[at.NOW, row, at.NORMAL_X], g[at.NOW, row, at.NORMAL_Y]
    x, y = nx * normal - ny * tangential, ny * normal + nx * tangential
    turn = g[at.NOW, row, at.VERTEX_ARM_N] * normal + g[at.NOW, row, at.VERTEX_ARM_T] * tangential
    back = g[at.NOW, row, at.EDGE_ARM_N] * normal + g[at.NOW, row, at.EDGE_ARM_T] * tangential
    kick(scene, work, work.candidates[row, at.VERTEX_BODY], x, y, turn)
    kick(scene, work, work.candidates[row, at.EDGE_BODY], -x, -y, -back)


def is_closed(work, row):
    """Whether a pair is flagged as one that touches."""
    return work.candidates[row, at.CLOSED] == at.TOUCHES


def has_switched(work, row):
    """Whether a pair touches, or no longer does, other than it is flagged."""
    closed = at.TOUCHES if work.geometry[at.NOW, row, at.GAP] < 0.0 else at.OPEN
    return closed != work.candidates[row, at.CLOSED]


def doubtful_time(work, row, step, doubt, resolved):
    """For how much of a step it is in doubt whether a pair touched [s].

    How finely its touch was located says nothing of that later on: a contact that rests in a hair's
    breadth of overlap, as the second one of two that an attraction presses, bears what it bears.
    """
    gap = work.geometry[at.NOW, row, at.GAP]
    if has_switched(work, row):
        speed = abs(normal_rate(work, at.NOW, row))
        return min((abs(gap) + doubt) / speed, step) if speed > 0.0 else step
    deepest = max(doubt, DOUBT * abs(along_normal(work, row, at.DEVIATION, at.X)) * resolved)
    return step if -deepest < gap < 0.0 else 0.0


def pressed(scene, view, overlap, overlap_rate):
    """The normal force of a contact with such an overlap [N]; 0 without a contact law."""
    if not has(scene, CONTACT_FORCE):
        return 0.0
    force, _ = contact_force(scene, pressed_view(view, overlap, overlap_rate))
    return force


def pressed_stiffness(scene, view, overlap):
    """The normal force of a contact pressed so far, over that [N/m]."""
    return pressed(scene, view, overlap, 0.0) / overlap


def unresolved(scene, work, clock, step, row):
    """The share of a step in which a contact only holds what presses on it: 1 where the step leaves
    its vibration out, so that the load decides whether it is there."""
    if work.tally[at.SERIES_TERMS] > 0:
        return 0.0
    view = contact_view(scene, work, at.NOW, row)
    stiffness = pressed_stiffness(scene, view, clock[at.TOLERANCE])
    if not stiffness > 0.0:
        return 0.0
    turns = step * math.sqrt(stiffness / view.effective_mass) / UNRESOLVED
    return min(1.0, turns * turns)


def signed_time(work, row, step, depth, doubt):
    """The same, above 0 where the force has acted for too long, as the carried error has it."""
    gap, wrong = work.geometry[at.NOW, row, at.GAP], along_normal(work, row, at.CARRIED, at.X)
    if has_switched(work, row):
        rate = normal_rate(work, at.NOW, row)
        late = (gap - wrong) / rate if rate != 0.0 else 0.0
        if rate != 0.0:
            late += math.copysign(doubt / rate, late)
        late = min(max(late, -step), step)
        return -late if gap < 0.0 else late
    return step if -max(depth, doubt, DOUBT * abs(wrong)) < gap < 0.0 else 0.0


def lifted_load(scene, work, row, tangential):
    """The load [N] that a tangential force lifts, and which presses where that is not there."""
    return tangential * coupling(scene, work, row) / normal_mobility(scene, work, row)


def doubted(scene, work, row, tangential):
    """What the carried error is to know of a tangential force [N] that may not have been there, its
    load having pressed instead, or of an impulse [N s]: along the normal and the tangent, so that
    it enlarges the error. What different contacts and times have lost must not cancel."""
    normal, memory = -lifted_load(scene, work, row, tangential), memory_of(work, row)
    apart = along_normal(work, row, at.CARRIED, at.X)
    apart += memory * along_normal(work, row, at.CARRIED, at.VELOCITY)
    along = slip_error(work, row, at.X) + memory * slip_error(work, row, at.VELOCITY)
    share = -OF_BOUNDS if normal * apart + tangential * along < 0.0 else OF_BOUNDS
    return share * normal, share * tangential


def doubt_tangential(scene, work, row, step):
    """Count as an error all that the tangential force of a pair that grazes has done in a step: by
    the law the pair loses it whenever it parts, and is pressed by what it has lifted instead."""
    force = grazing_force(work, at.NOW, row)
    impulse = step * length_of(lifted_load(scene, work, row, force), force)
    impulse *= OF_LOST / OF_SWITCHES
    add_impulse(scene, work, work.candidates[row, at.VERTEX_BODY], impulse, at.SWITCH_SPEED)
    add_impulse(scene, work, work.candidates[row, at.EDGE_BODY], impulse, at.SWITCH_SPEED)


def forget_offsets(work):
    """Of pairs that are open, or slide, no displacement knows of the error that there is already:
    ξ counts from where they will stick. By the law one that grazes has lost it."""
    for row in range(work.tally[at.CANDIDATES]):
        if work.candidates[row, at.SLIDING] != 0 or not is_closed(work, row):
            grazes = work.candidates[row, at.CLOSED] == at.GRAZES
            lost = OF_BOUNDS * work.slip[at.NOW, row] if grazes else 0.0
            work.slip[at.SLIP_OFFSET, row] = lost - slip_error(work, row, at.X)


def add_switch_errors(scene, work, clock, step, depth):
    """Add the errors of pairs that have touched or parted, before they are flagged anew, and of
    those closed by so little that they may be open; ``depth`` [m]: to which switches are told."""
    for row in range(work.tally[at.CANDIDATES]):
        if work.candidates[row, at.CLOSED] == at.GRAZES:
            doubt_tangential(scene, work, row, step)
            continue
        doubt = overlap_error(scene, work, clock, row) if is_closed(work, row) else 0.0
        resolved = 1.0 - unresolved(scene, work, clock, clock[at.STAGED_STEP], row)
        late = doubtful_time(work, row, step, doubt, resolved)
        signed = signed_time(work, row, step, depth, doubt)
        if late > 0.0 or signed != 0.0:
            normal, tangential = contact_force(scene, contact_view(scene, work, at.NOW, row))
            impulse = late * length_of(normal, tangential)
            kind = at.SWITCH_SPEED if has_switched(work, row) else at.DOUBT_SPEED
            add_impulse(scene, work, work.candidates[row, at.VERTEX_BODY], impulse, kind)
            add_impulse(scene, work, work.candidates[row, at.EDGE_BODY], impulse, kind)
            kick_pair(scene, work, row, signed * normal, signed * tangential)
