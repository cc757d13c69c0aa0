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

import flocsim.arrays as at
from flocsim.integrators.rhs.views import normal_rate

STIFFER = 1e5
"""The gap of a pair that grazes is held so many times as stiffly as by inertia, drag and the other
contacts in a step."""


def grazing_force(work, state, row):
    """T of a pair that grazes, in a state [N]."""
    force = work.slip[at.GRAZING_FORCE, row]
    if state == at.NOW:
        return force
    return force - work.slip[at.GRAZING_RESISTANCE, row] * normal_rate(work, state, row)


def normal_mobility(scene, work, row):
    """Acceleration of the gap for every newton along the normal of a pair [1/kg]."""
    total, g = 0.0, work.geometry
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    if scene.bodies[a, at.FREE] == 1.0:
        arm = g[at.NOW, row, at.VERTEX_ARM_N]
        total += 1.0 / scene.bodies[a, at.MASS] + arm * arm / scene.bodies[a, at.INERTIA]
    if scene.bodies[b, at.FREE] == 1.0:
        arm = g[at.NOW, row, at.EDGE_ARM_N]
        total += 1.0 / scene.bodies[b, at.MASS] + arm * arm / scene.bodies[b, at.INERTIA]
    return total


def coupling(scene, work, row):
    """Acceleration of the gap for every newton along the tangent of a pair [1/kg]."""
    total, g = 0.0, work.geometry
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    if scene.bodies[a, at.FREE] == 1.0:
        arms = g[at.NOW, row, at.VERTEX_ARM_N] * g[at.NOW, row, at.VERTEX_ARM_T]
        total += arms / scene.bodies[a, at.INERTIA]
    if scene.bodies[b, at.FREE] == 1.0:
        arms = g[at.NOW, row, at.EDGE_ARM_N] * g[at.NOW, row, at.EDGE_ARM_T]
        total += arms / scene.bodies[b, at.INERTIA]
    return total
