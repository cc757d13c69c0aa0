"""Grazing: what a contact does that closes under its load and opens under its own tangential force.

The tangential force of the contact law acts wherever bodies overlap, however little. Where the load
on a contact has all but gone, that force alone may lift the bodies apart; apart, it is gone, the
load closes the contact again, and so on without end: a sliding mode in the sense of Filippov, whose
cycle is as short as it is resolved finely. In its limit the bodies neither part nor overlap,

    d(gap)/dt = 0,  N = 0,  and a tangential force T of between nothing and that of the closed law

is what it takes for that. T is an unknown of the step; here it is the force of a dashpot across,
T = T₀ − K d(gap)/dt, so stiff that the gap changes by a small share of the tolerance alone. The
bodies slide against each other meanwhile. Such a pair opens for good where T has come to nothing;
where it ceases to slide it sticks again, T being taken over by its spring.
"""

from flocsim.arrays import (
    CLOSED,
    EDGE_ARM_N,
    EDGE_ARM_T,
    EDGE_BODY,
    FREE,
    GRAZES,
    GRAZING_FORCE,
    GRAZING_RESISTANCE,
    HELD,
    INERTIA,
    MASS,
    NOW,
    VERTEX_ARM_N,
    VERTEX_ARM_T,
    VERTEX_BODY,
)
from flocsim.integrators.rhs.views import normal_rate

STIFFER = 1e5
"""The gap of a pair that grazes is held so many times as stiffly as by inertia, drag and the other
contacts in a step."""


def stays(work, row):
    """Whether a pair grazes, or is held: it is neither open nor closed by its gap."""
    return work.candidates[row, CLOSED] == GRAZES or work.slip[HELD, row] != 0.0


def grazing_force(work, state, row):
    """T of a pair that grazes, in a state [N]."""
    force = work.slip[GRAZING_FORCE, row]
    if state == NOW:
        return force
    return force - work.slip[GRAZING_RESISTANCE, row] * normal_rate(work, state, row)


def normal_mobility(scene, work, row):
    """Acceleration of the gap for every newton along the normal of a pair [1/kg]."""
    total, g = 0.0, work.geometry
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    if scene.bodies[a, FREE] == 1.0:
        arm = g[NOW, row, VERTEX_ARM_N]
        total += 1.0 / scene.bodies[a, MASS] + arm * arm / scene.bodies[a, INERTIA]
    if scene.bodies[b, FREE] == 1.0:
        arm = g[NOW, row, EDGE_ARM_N]
        total += 1.0 / scene.bodies[b, MASS] + arm * arm / scene.bodies[b, INERTIA]
    return total


def coupling(scene, work, row):
    """Acceleration of the gap for every newton along the tangent of a pair [1/kg]."""
    total, g = 0.0, work.geometry
    a, b = work.candidates[row, VERTEX_BODY], work.candidates[row, EDGE_BODY]
    if scene.bodies[a, FREE] == 1.0:
        arms = g[NOW, row, VERTEX_ARM_N] * g[NOW, row, VERTEX_ARM_T]
        total += arms / scene.bodies[a, INERTIA]
    if scene.bodies[b, FREE] == 1.0:
        arms = g[NOW, row, EDGE_ARM_N] * g[NOW, row, EDGE_ARM_T]
        total += arms / scene.bodies[b, INERTIA]
    return total
