"""Two bodies that may be bound, and the load on their bond, as the proofs see them.

The bodies are i and j, j being the later one; the work lists pairs of features of these two alone,
located where they are now.
"""

import math
from typing import NamedTuple

import flocsim.arrays as at
from flocsim.arrays import ContactView
from flocsim.geometry.contact.points import least_listed_gap
from flocsim.geometry.contact.separation import separation
from flocsim.integrators.rhs.surface_gap import flag_near, surface_view
from flocsim.integrators.rhs.views import centre_line, contact_view, effective_mass
from flocsim.laws import CONTACT_FORCE, contact_force, has

NO_BOND, CERTIFICATE, HOOK, REST = range(4)
"""Kinds of bond."""


class Bond(NamedTuple):
    """Bodies ``i`` and ``j``; the unit vector from i's centroid to j's, and their distance [m]; the
    least gap of their features [m], and ``surface_gap``, that by which surface forces go [m]."""

    i: int
    j: int
    nx: float
    ny: float
    distance: float
    gap: float
    surface_gap: float


class Load(NamedTuple):
    """What pulls at a bond: its largest ``force`` [N]; the ``drift`` of the two against each other
    [m/s], or of the bodies of their cluster; its direction (``x``, ``y``) on j, (0, 0) where it may
    have any; ``lever``, how long an arm the cluster gives it at least [m]; ``alone``, 1.0 where the
    two are all of their cluster; ``kicks``, k_B T [J], 0.0 without."""

    force: float
    drift: float
    x: float
    y: float
    lever: float
    alone: float
    kicks: float


def bond_between(scene, work, time, i, j):
    """The Bond of two bodies whose features are listed and located."""
    nx, ny, distance = centre_line(scene, work, at.NOW, j, i)
    gap = least_listed_gap(work)
    surface = gap
    if scene.surface_reach > 0.0 and work.tally[at.CANDIDATES] > 0:
        flag_near(scene, work, at.NOW, 0.0)
        surface = surface_view(scene, work, time, at.NOW, 0, work.tally[at.CANDIDATES]).gap
    return Bond(i, j, nx, ny, distance, gap, surface)


def is_closed(work, row):
    """Whether a listed pair of features touches now."""
    return work.geometry[at.NOW, row, at.GAP] < 0.0


def size_of(scene, i, j):
    """The smaller bounding radius [m]: by so much outlines move as the bodies turn by one."""
    return min(scene.bodies[i, at.BOUNDING_RADIUS], scene.bodies[j, at.BOUNDING_RADIUS])


def radii_of(scene, bond):
    """r_i + r_j, equivalent radii [m]."""
    return scene.bodies[bond.i, at.EQUIVALENT_RADIUS] + scene.bodies[bond.j, at.EQUIVALENT_RADIUS]


def are_spheres(scene, bond):
    """Whether both bodies are spheres."""
    count_i = scene.first[bond.i + 1] - scene.first[bond.i]
    return count_i == 1 and scene.first[bond.j + 1] - scene.first[bond.j] == 1


def speeds_of(scene, work, bond):
    """(along the line of centres, of any kind) speeds of j against i as a rigid doublet [m/s]."""
    v, i, j = work.motion, bond.i, bond.j
    ux, uy = v[at.NOW, j, at.VX] - v[at.NOW, i, at.VX], v[at.NOW, j, at.VY] - v[at.NOW, i, at.VY]
    rx, ry = bond.nx * bond.distance, bond.ny * bond.distance
    spin = v[at.NOW, i, at.SPIN]
    shear = math.hypot(ux + spin * ry, uy - spin * rx)
    turning = abs(v[at.NOW, j, at.SPIN] - spin) * size_of(scene, i, j)
    return abs(ux * bond.nx + uy * bond.ny), shear + turning


def doublet_pose(scene, work, state, i, j):
    """Place [m] and angle of body j in the frame of i, which turns with it, in a state."""
    x, y = separation(scene, work, state, j, i)
    turn = work.motion[state, i, at.ANGLE]
    c, s = math.cos(turn), math.sin(turn)
    return c * x + s * y, c * y - s * x, work.motion[state, j, at.ANGLE] - turn


def way_between(scene, i, j, pose, before):
    """By how much the outlines of two bodies have moved from one such pose to another [m]."""
    x, y, angle = pose
    was_x, was_y, was_angle = before
    return math.hypot(x - was_x, y - was_y) + abs(angle - was_angle) * size_of(scene, i, j)


def resting_contact(view, slip):
    """The ContactView of the same contact at rest, its tangential displacement given [m]."""
    return ContactView(
        view.overlap, 0.0, slip, 0.0, view.effective_mass, view.radius_i, view.radius_j
    )


def energy_of(scene, work, bond):
    """What the bodies have to climb out with [J]: the energy of their motion against each other, of
    their spins, and twice that of their contacts' springs."""
    v, i, j = work.motion, bond.i, bond.j
    ux, uy = v[at.NOW, j, at.VX] - v[at.NOW, i, at.VX], v[at.NOW, j, at.VY] - v[at.NOW, i, at.VY]
    total = 0.5 * effective_mass(scene, i, j) * (ux * ux + uy * uy)
    total += 0.5 * scene.bodies[i, at.INERTIA] * v[at.NOW, i, at.SPIN] * v[at.NOW, i, at.SPIN]
    total += 0.5 * scene.bodies[j, at.INERTIA] * v[at.NOW, j, at.SPIN] * v[at.NOW, j, at.SPIN]
    if not has(scene, CONTACT_FORCE):
        return total
    for row in range(work.tally[at.CANDIDATES]):
        if is_closed(work, row):
            view = contact_view(scene, work, at.NOW, row)
            normal, tangential = contact_force(scene, resting_contact(view, view.slip))
            total += abs(normal * view.overlap) + abs(tangential * view.slip)
    return total
