"""The error of a run as a vector (PROPAGATED): its size, its bounds, and what grazing adds to it.

The vector stays within the sums of the same errors (loop/stated_error.py), body by body.
"""

import math

from flocsim.geometry.contact.points import normal_component, tangential_component
from flocsim.integrators.rhs.error import outline_size
from flocsim.integrators.rhs.friction import gap_responses
from flocsim.integrators.rhs.views import velocity_lifetime_of
from flocsim.state.work import NOW, PROPAGATED

SWITCH_AMPLIFICATION = 1.5
"""Factor by which motion may have amplified the errors of switches."""

VECTOR_SAFETY = 13.0
"""Safety factor on the size of the propagated vector: the true error may be larger by this."""

GRAZING_AMPLIFICATION = 2.5
"""Factor by which motion may have amplified the error due to grazing: the propagated error does not
know that contacts end sooner or later because of it. It is a bound already, so that VECTOR_SAFETY
must not multiply it: it enters the vector divided by that."""


def certain_bound(work, body):
    """Return the bound of a body's displacement error by steps and switches alone [m]."""
    errors = work.errors[body]
    return errors.displacement + SWITCH_AMPLIFICATION * errors.switch_displacement


def displacement_bound(work, body):
    """Return the bound of a body's displacement error by all its sums, uncertain contacts included
    [m]."""
    return (
        certain_bound(work, body) + SWITCH_AMPLIFICATION * work.errors[body].uncertain_displacement
    )


def scale_down_clusters(scene, work):
    """Scale the propagated error of every cluster of contacting bodies down to its bound.

    The bound of a body is its own, or the largest certain one in its cluster, as bodies in contact
    hand errors on. Uncertain contacts count for their own bodies only. One factor scales
    displacements and velocities of the whole cluster: anything else would give it a momentum that
    no error has caused, and velocities of vibrations belong to their displacements.
    """
    for body in range(work.poses.shape[0]):
        work.clusters[body].scale, work.clusters[body].largest_displacement = 1.0, 0.0
    # The largest certain bound in each cluster.
    for body in range(work.poses.shape[0]):
        leader = work.cluster[body]
        bound = max(work.clusters[leader].largest_displacement, certain_bound(work, body))
        work.clusters[leader].largest_displacement = bound
    # The smallest factor that its bodies need.
    for body in range(work.poses.shape[0]):
        leader, size = work.cluster[body], outline_size(scene, work.place, PROPAGATED, body)
        bound = max(work.clusters[leader].largest_displacement, displacement_bound(work, body))
        if size > bound:
            work.clusters[leader].scale = min(work.clusters[leader].scale, bound / size)
    # Scale displacements, velocities, and offsets of tangential displacements.
    for body in range(work.poses.shape[0]):
        share = work.clusters[work.cluster[body]].scale
        if share < 1.0:
            for axis in range(3):
                work.place[PROPAGATED, body, axis] *= share
                work.velocity[PROPAGATED, body, axis] *= share
    for row in range(work.tally.candidates):
        share = work.clusters[work.cluster[work.candidates[row].vertex_body]].scale
        if share < 1.0:
            work.contacts[row].slip_offset *= share


def bound_propagated(scene, work):
    """Keep the propagated vector within the sums; return its largest displacement of an outline
    [m].

    A contact mode that switches again and again would otherwise pump the vector up.
    """
    largest = 0.0
    scale_down_clusters(scene, work)
    for body in range(work.poses.shape[0]):
        size = outline_size(scene, work.place, PROPAGATED, body)
        # What it still exceeds its bound by is an error that other bodies have handed on.
        work.errors[body].displacement += max(size - displacement_bound(work, body), 0.0)
        largest = max(largest, size)
    return largest


def lifted_load(scene, work, row, tangential):
    """Return the load [N] that a tangential force lifts, and that presses where the force is
    absent."""
    by_normal, by_tangential = gap_responses(scene, work, row)
    return tangential * by_tangential / by_normal


def grazing_error_source(scene, work, row, tangential):
    """Return the source (normal, tangential) of the propagated error by a grazing pair [N].

    Its tangential force may not have existed, its load pressing instead. The sign is chosen so that
    the error grows: the losses of different contacts and times must not cancel. An impulse [N s]
    may be given instead of a force.
    """
    normal, memory = -lifted_load(scene, work, row, tangential), velocity_lifetime_of(work, row)
    # Work of the source on the present error, velocities included over their lifetime.
    opening = normal_component(work, row, work.place, PROPAGATED, NOW)
    opening += memory * normal_component(work, row, work.velocity, PROPAGATED, NOW)
    slipping = tangential_component(work, row, work.place, PROPAGATED, NOW)
    slipping += memory * tangential_component(work, row, work.velocity, PROPAGATED, NOW)
    share = math.copysign(
        GRAZING_AMPLIFICATION / VECTOR_SAFETY, normal * opening + tangential * slipping
    )
    return share * normal, share * tangential
