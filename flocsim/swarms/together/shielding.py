"""The drag of bodies in a cluster, at every common time of a swarm.

A cluster resists as much as `cluster_mobilities` says, R, in any direction of the plane. Its bodies
alone would resist by K = Σ R_i together; each has Q R_i Q instead, with the one symmetric Q for
which Q K Q = R. So a cluster settles at its own speed, every body keeps the share of the drag that
it had, and loads on bonds, which come from those shares, stay what they are. Q is positive and no
more than 1: such a drag takes energy from a body that moves, whatever its cluster.

Bodies are of a cluster where they touch or nearly do. Q follows from places alone and is kept for a
window, in the directions of the window's beginning. Where two clusters touch within a window, their
drag changes with the next one, at once: velocities relax to it, which takes microseconds, and
nothing else jumps.
"""

import math
from collections.abc import Sequence

import numpy as np

import flocsim.arrays as at
from flocsim.body import Body
from flocsim.forces.base import Force
from flocsim.forces.drag import drag_radius, follows_shape
from flocsim.hydrodynamics.clusters import mobilities
from flocsim.swarms.together.clusters import placed_together
from flocsim.swarms.together.contacts import Gauge, Neighbours

NEARLY = 0.01
"""Bodies count as touching up to this share of their mean r_eq: to the flow around both it is all
one, and a contact that opens for a moment changes no drag."""

WAY = 0.5
"""Bodies go so many mean bounding radii against each other in a window at most: by that much later
does the drag of those that meet change."""


class Shielding:
    """What clusters make of the drag of a swarm's ``bodies``, whose gaps ``gauge`` measures."""

    def __init__(self, bodies: Sequence[Body], forces: Sequence[Force], gauge: Gauge) -> None:
        self.gauge, self.shaped = gauge, follows_shape(forces)
        self.radii = np.array([1.0 if each.fixed else drag_radius(forces, each) for each in bodies])
        sizes = [body.shape.equivalent_radius for body in bodies if not body.fixed]
        self.nearly = NEARLY * float(np.mean(sizes))

    def apply(self, known: np.ndarray, position: np.ndarray) -> None:
        """Write Q of all bodies at ``position`` (n, 3) into what is ``known`` of them (n, …), as
        Scene.bodies has it. What hangs together with a fixed body does not settle, and keeps the
        drag of its bodies."""
        free = known[:, at.FREE] == 1.0
        near = self.gauge.neighbours(position, self.nearly)
        both = free[near.pairs].all(axis=1)
        held = Neighbours(near.pairs[both], near.gap[both], near.vector[both])
        label, places = placed_together(len(free), held)
        size = np.bincount(label)
        on_wall = np.unique(label[near.pairs[~both]])
        size[on_wall] = 1
        known[:, at.SHIELDING : at.SHIELDING + 3] = at.UNSHIELDED
        members = np.flatnonzero((size[label] > 1) & free)
        if not len(members):
            return
        _, own_label = np.unique(label[members], return_inverse=True)
        resistance = self.resistances(known[members], position[members, 2], members)
        found = mobilities(own_label, places[members], self.radii[members], inverses(resistance))
        together = np.column_stack([np.bincount(own_label, axis) for axis in resistance.T])
        shielding = between(together, inverses(found))
        known[members, at.SHIELDING : at.SHIELDING + 3] = shielding[own_label]

    def resistances(self, known: np.ndarray, angle: np.ndarray, members: np.ndarray) -> np.ndarray:
        """(xx, xy, yy) (n, 3) of every one's drag alone, held from turning, over the viscosity."""
        if not self.shaped:
            drag = 6.0 * math.pi * self.radii[members]
            return np.column_stack([drag, 0.0 * drag, drag])
        xx, xy, yy = known[:, at.RESISTANCE : at.RESISTANCE + 3].T
        c, s = np.cos(angle), np.sin(angle)
        return np.column_stack([
            c * c * xx - 2.0 * c * s * xy + s * s * yy,
            c * s * (xx - yy) + (c * c - s * s) * xy,
            s * s * xx + 2.0 * c * s * xy + c * c * yy,
        ])  # fmt: skip


def inverses(matrices: np.ndarray) -> np.ndarray:
    """Of symmetric ones (xx, xy, yy) (n, 3)."""
    xx, xy, yy = matrices.T
    return np.column_stack([yy, -xy, xx]) / (xx * yy - xy * xy)[:, None]


def between(together: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Q (n, 3) with Q K Q = R, of K ``together`` and R ``wanted``: K⁻½ (K½ R K½)½ K⁻½."""
    outer = roots(together)
    inner = roots(congruent(outer, wanted))
    return congruent(inverses(outer), inner)


def roots(matrices: np.ndarray) -> np.ndarray:
    """Square roots of positive ones (n, 3): (M + √det 1)/√(tr M + 2 √det)."""
    xx, xy, yy = matrices.T
    root = np.sqrt(xx * yy - xy * xy)
    return np.column_stack([xx + root, xy, yy + root]) / np.sqrt(xx + yy + 2.0 * root)[:, None]


def congruent(outer: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """A B A (n, 3) of symmetric A ``outer`` and B ``inner``."""
    a, b, c = outer.T
    d, e, f = inner.T
    return np.column_stack([
        a * a * d + 2.0 * a * b * e + b * b * f,
        a * b * d + (a * c + b * b) * e + b * c * f,
        b * b * d + 2.0 * b * c * e + c * c * f,
    ])  # fmt: skip
