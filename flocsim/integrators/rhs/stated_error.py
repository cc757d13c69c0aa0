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
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.contacts import GRAZES, OPEN, TOUCHES
from flocsim.state.work import CARRIED, CHANGE, DEVIATION, FORCING, NOW

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


def carry_body(work, body, step):
    """Carry the sums of a body's errors over a step."""
    errors = work.errors[body]
    lasting = errors.relaxation
    left = math.exp(-step / lasting) if step < LONG * lasting else 0.0
    way = step if lasting > LONG * step else lasting * (1.0 - left)
    errors.place += errors.speed * way
    errors.speed *= left
    errors.switch_place += errors.switch_speed * way
    errors.switch_speed *= left
    errors.doubt_place += errors.doubt_speed * way
    errors.doubt_speed *= left


def rate_of_growth(scene, work):
    """By how much the velocity of the error changes over a step, along its place and over that
    [1/s]: CHANGE is what CARRIED has become; above 0 where forces drive bodies apart, or together,
    the more, the farther they are off. 0 where tangential displacements are wrong, too: the error
    does not follow from what it was, then."""
    pushed = size = 0.0
    for body in range(work.place.shape[1]):
        for axis in range(3):
            if work.velocity[FORCING, body, axis] != 0.0:
                return 0.0
            square = lever(scene, body, axis) ** 2
            now, later = work.place[CARRIED, body, axis], work.place[CHANGE, body, axis]
            more = work.velocity[CHANGE, body, axis]
            more -= work.velocity[CARRIED, body, axis]
            pushed += 0.5 * square * (now + later) * more
            size += square * 0.25 * (now + later) ** 2
    return pushed / size if pushed > 0.0 and size > 0.0 else 0.0


def grow_sums(scene, work, step):
    """Make the sums of errors grow as the vector of them does in a step in which nothing swings:
    they know nothing else of an attraction that gets steeper."""
    rate = min(rate_of_growth(scene, work), 1.0 / step)
    for body in range(work.poses.shape[0]):
        errors = work.errors[body]
        errors.speed += rate * errors.place
        errors.switch_speed += rate * errors.switch_place
        errors.doubt_speed += rate * errors.doubt_place


@hook
def carry_vector(scene, work, clock, step):
    """Carry the error as a vector, too, where the method has the forces' derivatives; how large it
    is in the place of an outline [m], inf where it has not."""
    return math.inf


@apart
def carry_errors(scene, work, clock, step):
    """Carry every body's errors over a step that has been accepted, and add the step's own."""
    known = False
    # All counts that is estimated where features come to share in a surface force inside of steps,
    # and of steps across switches, of which nothing is carried on with motion.
    across = clock.across == 1.0
    share = 1.0 if scene.surface_reach > 0.0 else clock.estimate_share
    weight = 1.0 / share if across else 1.0
    for body in range(work.poses.shape[0]):
        errors = work.errors[body]
        carry_body(work, body, step)
        errors.place += weight * errors.step_place
        errors.speed += weight * errors.step_speed
        known = known or errors.step_place + errors.step_speed > 0.0
    largest = 0.0
    for body in range(work.poses.shape[0]):
        errors = work.errors[body]
        if not known:
            errors.place += clock.step_error
        stated = share * errors.place
        stated += OF_SWITCHES * (errors.switch_place + errors.doubt_place)
        largest = max(largest, stated)
        if across:
            for axis in range(3):
                work.place[CARRIED, body, axis] += work.place[DEVIATION, body, axis]
                work.velocity[CARRIED, body, axis] += work.velocity[DEVIATION, body, axis]
    vector = math.inf if across else carry_vector(scene, work, clock, step)
    clock.error = 0.0
    for body in range(work.poses.shape[0]):
        errors = work.errors[body]
        stated = largest
        if vector < math.inf:
            least = max(
                LEAST * clock.tolerance,
                OF_SUMS * errors.switch_place,
            )
            own = max(carried_size(scene, work, body), least)
            stated = min(stated, OF_VECTOR * own)
        errors.stated = stated
        clock.error = max(clock.error, stated)


@hook
def overlap_error(scene, work, clock, row):
    """By how much a method may have the overlap of a contact wrong beside its motion [m]."""
    return 0.0


def carried_size(scene, work, body):
    """How large a body's carried error is in the place of its outline [m]."""
    turn = scene.bodies[body].bounding_radius * abs(work.place[CARRIED, body, ANGLE])
    return length_of(work.place[CARRIED, body, X], work.place[CARRIED, body, Y]) + turn


def certain_sum(work, body):
    """By how much the place of a body may be wrong, by the sums of its errors, if no contact has
    opened that may have [m]."""
    errors = work.errors[body]
    return errors.place + OF_SWITCHES * errors.switch_place


def sum_of_place(work, body):
    """By how much the place of a body may be wrong, by the sums of its errors [m]."""
    return certain_sum(work, body) + OF_SWITCHES * work.errors[body].doubt_place


def hand_on(work, body, size):
    """Count as its own error of a body what others have handed on to it; ``size`` [m]: of its
    carried error."""
    more = size - sum_of_place(work, body)
    if more > 0.0:
        work.errors[body].place += more


def shorten(scene, work):
    """Shorten the carried error of every cluster to what its places can be wrong by: each by its
    own sums, or by those of any other one, as bodies that hold each other hand their errors on.
    Doubts count for their own bodies alone: what they come to is no error until it happens.

    All of it by one factor, for it must not give the cluster a momentum that no step and no switch
    has given it, and velocities too: those of vibrations are what their places make them.
    """
    for body in range(work.poses.shape[0]):
        work.clusters[body].shortened, work.clusters[body].most_place = 1.0, 0.0
    for body in range(work.poses.shape[0]):
        leader = work.cluster[body]
        most = max(work.clusters[leader].most_place, certain_sum(work, body))
        work.clusters[leader].most_place = most
    for body in range(work.poses.shape[0]):
        leader, size = work.cluster[body], carried_size(scene, work, body)
        most = max(work.clusters[leader].most_place, sum_of_place(work, body))
        if size > most:
            work.clusters[leader].shortened = min(work.clusters[leader].shortened, most / size)
    for body in range(work.poses.shape[0]):
        share = work.clusters[work.cluster[body]].shortened
        if share < 1.0:
            for axis in range(3):
                work.place[CARRIED, body, axis] *= share
                work.velocity[CARRIED, body, axis] *= share
    for row in range(work.tally.candidates):
        share = work.clusters[work.cluster[work.candidates[row].vertex_body]].shortened
        if share < 1.0:
            work.contacts[row].slip_offset *= share


def bound_carried(scene, work):
    """Keep the vector of every cluster within the sums of its parts, which a mode that switches
    again and again would make it leave; the largest one of place [m]."""
    largest = 0.0
    shorten(scene, work)
    for body in range(work.poses.shape[0]):
        size = carried_size(scene, work, body)
        hand_on(work, body, size)
        largest = max(largest, size)
    return largest


def add_impulse(scene, work, body, impulse, switched):
    """Add what an impulse at its outline [N s] does to a body's velocity to the errors of pairs
    that have ``switched``, or of those that may have."""
    errors = work.errors[body]
    if scene.bodies[body].free == 1.0:
        size = scene.bodies[body].bounding_radius
        share = 1.0 / scene.bodies[body].mass + size * size / scene.bodies[body].inertia
        if switched:
            errors.switch_speed += impulse * share
        else:
            errors.doubt_speed += impulse * share


def kick(scene, work, body, x, y, turn):
    """Add an impulse [N s, N s, N m s] to a body's carried error."""
    if scene.bodies[body].free == 1.0:
        inertia = scene.bodies
        work.velocity[CARRIED, body, X] += x / inertia[body].mass
        work.velocity[CARRIED, body, Y] += y / inertia[body].mass
        work.velocity[CARRIED, body, ANGLE] += turn / inertia[body].inertia


def kick_pair(scene, work, row, normal, tangential):
    """Add the impulses of a contact [N s] to the carried errors of its bodies."""
    candidate = work.candidates[row]
    g = work.geometry
    nx, ny = g[NOW, row].normal_x, g[NOW, row].normal_y
    x, y = nx * normal - ny * tangential, ny * normal + nx * tangential
    turn = g[NOW, row].vertex_arm_n * normal + g[NOW, row].vertex_arm_t * tangential
    back = g[NOW, row].edge_arm_n * normal + g[NOW, row].edge_arm_t * tangential
    kick(scene, work, candidate.vertex_body, x, y, turn)
    kick(scene, work, candidate.edge_body, -x, -y, -back)


def is_closed(work, row):
    """Whether a pair is flagged as one that touches."""
    return work.candidates[row].closed == TOUCHES


def has_switched(work, row):
    """Whether a pair touches, or no longer does, other than it is flagged."""
    closed = TOUCHES if work.geometry[NOW, row].gap < 0.0 else OPEN
    return closed != work.candidates[row].closed


def doubtful_time(work, row, step, doubt, resolved):
    """For how much of a step it is in doubt whether a pair touched [s].

    How finely its touch was located says nothing of that later on: a contact that rests in a hair's
    breadth of overlap, as the second one of two that an attraction presses, bears what it bears.
    """
    gap = work.geometry[NOW, row].gap
    if has_switched(work, row):
        speed = abs(normal_rate(work, NOW, row))
        return min((abs(gap) + doubt) / speed, step) if speed > 0.0 else step
    deepest = max(doubt, DOUBT * abs(along_normal(work, row, work.place, DEVIATION)) * resolved)
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
    if work.tally.series_terms > 0:
        return 0.0
    view = contact_view(scene, work, NOW, row)
    stiffness = pressed_stiffness(scene, view, clock.tolerance)
    if not stiffness > 0.0:
        return 0.0
    turns = step * math.sqrt(stiffness / view.effective_mass) / UNRESOLVED
    return min(1.0, turns * turns)


def signed_time(work, row, step, depth, doubt):
    """The same, above 0 where the force has acted for too long, as the carried error has it."""
    gap, wrong = work.geometry[NOW, row].gap, along_normal(work, row, work.place, CARRIED)
    if has_switched(work, row):
        rate = normal_rate(work, NOW, row)
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
    apart = along_normal(work, row, work.place, CARRIED)
    apart += memory * along_normal(work, row, work.velocity, CARRIED)
    along = slip_error(work, row, work.place) + memory * slip_error(work, row, work.velocity)
    share = -OF_BOUNDS if normal * apart + tangential * along < 0.0 else OF_BOUNDS
    return share * normal, share * tangential


def doubt_tangential(scene, work, row, step):
    """Count as an error all that the tangential force of a pair that grazes has done in a step: by
    the law the pair loses it whenever it parts, and is pressed by what it has lifted instead."""
    candidate = work.candidates[row]
    force = grazing_force(work, NOW, row)
    impulse = step * length_of(lifted_load(scene, work, row, force), force)
    impulse *= OF_LOST / OF_SWITCHES
    add_impulse(scene, work, candidate.vertex_body, impulse, True)
    add_impulse(scene, work, candidate.edge_body, impulse, True)


def forget_offsets(work):
    """Of pairs that are open, or slide, no displacement knows of the error that there is already:
    ξ counts from where they will stick. By the law one that grazes has lost it."""
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.sliding != 0 or not is_closed(work, row):
            grazes = candidate.closed == GRAZES
            lost = OF_BOUNDS * work.slip[NOW, row] if grazes else 0.0
            work.contacts[row].slip_offset = lost - slip_error(work, row, work.place)


def add_switch_errors(scene, work, clock, step, depth):
    """Add the errors of pairs that have touched or parted, before they are flagged anew, and of
    those closed by so little that they may be open; ``depth`` [m]: to which switches are told."""
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.closed == GRAZES:
            doubt_tangential(scene, work, row, step)
            continue
        doubt = overlap_error(scene, work, clock, row) if is_closed(work, row) else 0.0
        resolved = 1.0 - unresolved(scene, work, clock, clock.staged_step, row)
        late = doubtful_time(work, row, step, doubt, resolved)
        signed = signed_time(work, row, step, depth, doubt)
        if late > 0.0 or signed != 0.0:
            normal, tangential = contact_force(scene, contact_view(scene, work, NOW, row))
            impulse = late * length_of(normal, tangential)
            switched = has_switched(work, row)
            add_impulse(scene, work, candidate.vertex_body, impulse, switched)
            add_impulse(scene, work, candidate.edge_body, impulse, switched)
            kick_pair(scene, work, row, signed * normal, signed * tangential)
