"""The stated error of a run: the accumulated effect of the errors of its steps and switches.

Sums. A displacement error of a step stays; a velocity error moves the body until drag has used it
up after a relaxation time τ:

    dE_x/dt = E_v,   dE_v/dt = −E_v/τ.

Each step adds its estimate to both. A switch adds to E_v: a touch detected g too deep, or a parting
detected g too late, at speed v, omits (or adds) the contact's force for a time g/v. A contact whose
overlap is within the uncertainty of its gap may in fact be open; its force is uncertain for the
whole step, and if the step does not resolve its vibration, the load decides. A grazing contact
(events/grazes.py) has a tangential force that the law would take away whenever it parts: all of it
counts as an error, and so does the load that it lifts.

Vector. The sums know neither that contacts absorb errors nor that errors cancel. A method with the
forces' derivatives also propagates the error as a vector δ,

    M δv̇ = −D δv − K δx + FORCING,   δẋ = δv

(radau/carried_error.py), and the smaller of both is stated. SWITCH_AMPLIFICATION, VECTOR_SAFETY and
a method's ``estimate_share`` were calibrated on random runs that amplify a perturbation less than
tenfold (benchmarks/accuracy/stated_error.py). A run that amplifies it more, such as a doublet that
tips over one way or the other, is detected only by a perturbed companion run (amplification.py).
"""

import math

from flocsim.compiler.linker import apart
from flocsim.constants import TINY
from flocsim.geometry.contact.points import length_of, normal_component, tangential_component
from flocsim.hooks import SLIP_LIMIT, contact_force, has
from flocsim.integrators.events.crossings import any_touching
from flocsim.integrators.exponential.collocation import nothing_swings, propagate_with_series
from flocsim.integrators.radau.carried_error import add_step_error, overlap_error, propagate_error
from flocsim.integrators.rhs.contact_stiffness import unresolved_fraction
from flocsim.integrators.rhs.error import NEGLIGIBLE, outline_size
from flocsim.integrators.rhs.friction import AT_LIMIT, grazing_force, slip_limit_at
from flocsim.integrators.rhs.propagated_error import (
    GRAZING_AMPLIFICATION,
    SWITCH_AMPLIFICATION,
    VECTOR_SAFETY,
    bound_propagated,
    lifted_load,
)
from flocsim.integrators.rhs.views import (
    contact_view,
    lever,
    normal_rate,
    pair_loads,
    tangential_rate,
)
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.clock import PLAIN, RADAU
from flocsim.state.contacts import CLOSED, GRAZING, OPEN
from flocsim.state.work import CHANGE, FORCING, NOW, PROPAGATED, STEP_ERROR

LEAST_VECTOR = 0.01
"""Lower bound of the vector's size, since its parts may cancel by chance, as a fraction of the
tolerance, and of the sum of switching errors (a dozen grazes push it to and fro)."""

LEAST_STATED = 0.1
"""Least stated error once bodies have touched, over the tolerance."""

UNCERTAIN_OVERLAP = 2.0
"""A contact may be open if its overlap is below this multiple of its gap's error."""


FRICTION_UNCERTAINTY = 0.1
"""Fraction of the friction of a sliding contact that counts as uncertain in steps across events.
As much as .04 was lacking in a limit cycle that took 90,000 steps to resolve; with 0.1 the stated
error covered 100 random pairs that slide on each other."""

SLOWEST_OPENING = 0.25
"""Least rate with which a contact may have opened in a step, over that at its end. Without
it a long step in which the gap hardly changed counted as uncertain all along."""


def propagate_sums(work, body, step):
    """Propagate the sums of a body's errors over a step: E_x += E_v τ (1 − e^(−h/τ)), E_v *=
    e^(−h/τ)."""
    errors = work.errors[body]
    relaxation = max(errors.relaxation_time, TINY)
    decay, effective_time = (
        math.exp(-step / relaxation),
        -relaxation * math.expm1(-step / relaxation),
    )
    errors.displacement += errors.velocity * effective_time
    errors.velocity *= decay
    errors.switch_displacement += errors.switch_velocity * effective_time
    errors.switch_velocity *= decay
    errors.uncertain_displacement += errors.uncertain_velocity * effective_time
    errors.uncertain_velocity *= decay


def error_growth_rate(scene, work):
    """Return the rate at which the propagated error grew in velocity over a step, per unit of its
    displacement [1/s]: e·Δė/e², CHANGE being what PROPAGATED has become.

    It is positive where forces drive bodies apart, or together, the more the further they are off.
    It is 0 if tangential displacements are in error, too, as growth then does not follow from the
    positions, and where the error of the velocity shrinks, as where a contact damps it.
    """
    pushed = size = grown = 0.0
    for body in range(work.place.shape[1]):
        for axis in range(3):
            if work.velocity[FORCING, body, axis] != 0.0:
                return 0.0
            # Angles count as displacements of the outline.
            square = lever(scene, body, axis) ** 2
            now, later = work.place[PROPAGATED, body, axis], work.place[CHANGE, body, axis]
            more = work.velocity[CHANGE, body, axis]
            more -= work.velocity[PROPAGATED, body, axis]
            pushed += 0.5 * square * (now + later) * more
            grown += square * (
                work.velocity[CHANGE, body, axis] ** 2 - work.velocity[PROPAGATED, body, axis] ** 2
            )
            size += square * 0.25 * (now + later) ** 2
    return pushed / size if min(pushed, size, grown) > 0.0 else 0.0


def amplify_sums(scene, work, step):
    """Amplify the sums of errors as the vector grows in a step in which nothing vibrates.

    Without it the sums miss the growth of errors by an attraction that gets steeper.
    """
    rate = min(error_growth_rate(scene, work), 1.0 / step)
    for body in range(work.poses.shape[0]):
        errors = work.errors[body]
        errors.velocity += rate * errors.displacement
        errors.switch_velocity += rate * errors.switch_displacement
        errors.uncertain_velocity += rate * errors.uncertain_displacement


def propagate_vector(scene, work, clock, step):
    """Propagate the error as a vector over an accepted step; return its largest displacement of an
    outline [m], inf where nothing is known of the motion inside the step."""
    if work.tally.kind == PLAIN:
        return math.inf
    # Radau: a rational approximation of the exponential, with the factors of the step.
    if work.tally.kind == RADAU:
        return propagate_error(scene, work, clock, step)
    # Series: the derivatives of the power series are known exactly. The step may have been cut, so
    # propagate over the fraction of the series that was used.
    bound_propagated(scene, work)
    full = work.tally.series_step
    propagate_with_series(work, clock, full, step / full)
    # Let the scalar sums grow at the rate of the vector, for example towards an attraction.
    # A contact that is closed resists an error.
    if nothing_swings(clock) and not any_touching(work):
        amplify_sums(scene, work, step)
    add_step_error(work)
    return bound_propagated(scene, work)


@apart
def propagate_errors(scene, work, clock, step):
    """Propagate every body's errors over an accepted step, and add the step's own."""
    known = False
    # Estimates count in full for steps across switches, which have no propagated vector, and for
    # surface forces, whose fractions may change inside a step.
    across = clock.across == 1.0
    share = 1.0 if scene.surface_reach > 0.0 else clock.estimate_share
    weight = SWITCH_AMPLIFICATION / share if across else 1.0
    # Sums: propagate, then add the estimate of this step (in full across switches: 1/share undoes
    # share).
    for body in range(work.poses.shape[0]):
        errors = work.errors[body]
        propagate_sums(work, body, step)
        errors.displacement += weight * errors.step_displacement
        errors.velocity += weight * errors.step_velocity
        known = known or errors.step_displacement + errors.step_velocity > 0.0
    # The stated error by sums is that of the worst body, as contacts hand errors on.
    largest = 0.0
    for body in range(work.poses.shape[0]):
        errors = work.errors[body]
        # A method that estimates no error per body gives one number for all.
        if not known:
            errors.displacement += clock.step_error
        stated = share * errors.displacement
        stated += SWITCH_AMPLIFICATION * (
            errors.switch_displacement + errors.uncertain_displacement
        )
        largest = max(largest, stated)
        if across:
            for axis in range(3):
                work.place[PROPAGATED, body, axis] += work.place[STEP_ERROR, body, axis]
                work.velocity[PROPAGATED, body, axis] += work.velocity[STEP_ERROR, body, axis]
    # State the vector instead where it is smaller, with its safety factor and lower bounds.
    vector = propagate_vector(scene, work, clock, step)
    clock.error = 0.0
    for body in range(work.poses.shape[0]):
        errors = work.errors[body]
        stated = largest
        if vector < math.inf:
            least = LEAST_VECTOR * max(clock.tolerance, errors.switch_displacement)
            own = max(outline_size(scene, work.place, PROPAGATED, body), least)
            stated = min(stated, VECTOR_SAFETY * own)
        # Once bodies have touched, iterations and located events leave what no estimate sees.
        if errors.switch_displacement > 0.0:
            stated = max(stated, LEAST_STATED * clock.tolerance)
        errors.stated = stated
        clock.error = max(clock.error, stated)


def add_impulse_error(scene, work, body, impulse, switched):
    """Add the velocity error at the outline due to an impulse [N s] to the sums of switches, if a
    pair has ``switched``, else to those of uncertain contacts."""
    errors = work.errors[body]
    if scene.bodies[body].free == 1.0:
        size = scene.bodies[body].bounding_radius
        # Largest velocity of an outline point per unit impulse at the outline.
        share = 1.0 / scene.bodies[body].mass + size * size / scene.bodies[body].inertia
        if switched:
            errors.switch_velocity += impulse * share
        else:
            errors.uncertain_velocity += impulse * share


def add_impulse_errors(scene, work, row, impulse, switched):
    """Add the velocity errors due to an impulse [N s] at a contact to both of its bodies."""
    candidate = work.candidates[row]
    add_impulse_error(scene, work, candidate.vertex_body, impulse, switched)
    add_impulse_error(scene, work, candidate.edge_body, impulse, switched)


def add_propagated_impulse(scene, work, body, x, y, turn):
    """Add an impulse [N s, N s, N m s] to a body's propagated error."""
    if scene.bodies[body].free == 1.0:
        inertia = scene.bodies
        work.velocity[PROPAGATED, body, X] += x / inertia[body].mass
        work.velocity[PROPAGATED, body, Y] += y / inertia[body].mass
        work.velocity[PROPAGATED, body, ANGLE] += turn / inertia[body].inertia


def add_pair_impulse(scene, work, row, normal, tangential):
    """Add the impulses of a contact [N s] to the propagated errors of its bodies."""
    x, y, turn_a, turn_b = pair_loads(work, NOW, row, normal, tangential)
    candidate = work.candidates[row]
    add_propagated_impulse(scene, work, candidate.vertex_body, x, y, turn_a)
    add_propagated_impulse(scene, work, candidate.edge_body, -x, -y, -turn_b)


def has_switched(work, row):
    """Return True if the gap of a pair says otherwise than its flag."""
    closed = CLOSED if work.geometry[NOW, row].gap < 0.0 else OPEN
    return closed != work.candidates[row].contact_mode


def uncertain_time(work, row, step, overlap_uncertainty, resolved):
    """Return the time within a step for which it is uncertain whether a pair touched [s].

    How finely its touch was located does not matter later on: a contact that rests in a tiny
    overlap, such as the second of two that an attraction presses, bears what it bears.
    """
    gap = work.geometry[NOW, row].gap
    # It switched: detected too late by (|gap| + its error)/speed.
    if has_switched(work, row):
        # The rate at the end of a long step may be wrong by many times itself.
        way = abs(gap - work.contacts[row].start_gap)
        rate = abs(normal_rate(work, NOW, row))
        speed = max(min(rate, way / step), SLOWEST_OPENING * rate)
        return min((abs(gap) + overlap_uncertainty) / speed, step) if speed > 0.0 else step
    # It did not: uncertain all along if the overlap is within its error.
    deepest = max(
        overlap_uncertainty,
        UNCERTAIN_OVERLAP
        * abs(normal_component(work, row, work.place, STEP_ERROR, NOW))
        * resolved,
    )
    return step if -deepest < gap < 0.0 else 0.0


def signed_excess_time(work, row, step, depth, overlap_uncertainty):
    """Return the time for which the force of a pair acted too long, by the propagated error [s].

    The signed counterpart of uncertain_time: negative if the force acted for too short.
    """
    gap, gap_error = (
        work.geometry[NOW, row].gap,
        normal_component(work, row, work.place, PROPAGATED, NOW),
    )
    if has_switched(work, row):
        rate = normal_rate(work, NOW, row)
        # The true switch was (gap − its propagated error)/rate ago.
        delay = (gap - gap_error) / rate if rate != 0.0 else 0.0
        if rate != 0.0:
            delay += math.copysign(overlap_uncertainty / rate, delay)
        delay = min(max(delay, -step), step)
        return -delay if gap < 0.0 else delay
    return (
        step
        if -max(depth, overlap_uncertainty, UNCERTAIN_OVERLAP * abs(gap_error)) < gap < 0.0
        else 0.0
    )


def add_grazing_uncertainty(scene, work, row, step):
    """Count all that the tangential force of a grazing pair did in a step as an error: by the law
    the pair loses it whenever it parts, and what it lifted presses instead."""
    force = grazing_force(work, NOW, row)
    impulse = step * length_of(lifted_load(scene, work, row, force), force)
    impulse *= GRAZING_AMPLIFICATION / SWITCH_AMPLIFICATION
    add_impulse_errors(scene, work, row, impulse, True)


def reset_slip_offsets(work):
    """Set the offset of ξ for pairs that are open or slide: ξ counts anew from where they stick,
    and so knows nothing of the present error. A grazing pair has lost its ξ by the law."""
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.slide_direction != 0 or candidate.contact_mode != CLOSED:
            grazes = candidate.contact_mode == GRAZING
            lost = GRAZING_AMPLIFICATION / VECTOR_SAFETY * work.slip[NOW, row] if grazes else 0.0
            work.contacts[row].slip_offset = lost - tangential_component(
                work, row, work.place, PROPAGATED, NOW
            )


def add_friction_uncertainty(scene, work, clock, step):
    """Count part of the friction of contacts that slide in a step across events as an error: they
    may stick and slide in turn, by a vibration that the step damps, and bear less in the mean."""
    if not has(scene, SLIP_LIMIT):
        return
    for row in range(work.tally.candidates):
        if work.geometry[NOW, row].gap >= 0.0:
            continue
        slip, rate = work.slip[NOW, row], tangential_rate(work, NOW, row)
        slides = slip * rate > 0.0 and abs(slip) >= AT_LIMIT * slip_limit_at(scene, work, NOW, row)
        if slides and abs(rate) * step > NEGLIGIBLE * clock.tolerance:
            _, friction = contact_force(scene, contact_view(scene, work, NOW, row))
            impulse = FRICTION_UNCERTAINTY * step * abs(friction)
            add_impulse_errors(scene, work, row, impulse, False)


def add_switch_errors(scene, work, clock, step, depth):
    """Add the errors of pairs that have touched or parted in a step, and of those closed by so
    little that they may be open. Modes are still those of the step; ``depth`` [m] is the resolution
    of switches."""
    for row in range(work.tally.candidates):
        candidate = work.candidates[row]
        if candidate.contact_mode == GRAZING:
            add_grazing_uncertainty(scene, work, row, step)
            continue
        # Times for which the contact force is uncertain: without sign for the sums, signed for the
        # vector.
        closed = candidate.contact_mode == CLOSED
        overlap_uncertainty = overlap_error(scene, work, clock, row) if closed else 0.0
        resolved = 1.0 - unresolved_fraction(scene, work, clock, clock.stages_step, row)
        delay = uncertain_time(work, row, step, overlap_uncertainty, resolved)
        signed = signed_excess_time(work, row, step, depth, overlap_uncertainty)
        if delay > 0.0 or signed != 0.0:
            # Their impulses.
            normal, tangential = contact_force(scene, contact_view(scene, work, NOW, row))
            impulse = delay * length_of(normal, tangential)
            switched = has_switched(work, row)
            add_impulse_errors(scene, work, row, impulse, switched)
            add_pair_impulse(scene, work, row, signed * normal, signed * tangential)
