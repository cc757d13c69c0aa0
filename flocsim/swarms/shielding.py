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
from flocsim.swarms.clusters import Gauge, placed_together

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
        label, places = placed_together(len(free), near.among(free))
        size = np.bincount(label)
        size[label[near.pairs[~free[near.pairs].all(axis=1)]]] = 1  # on a wall
        known[:, at.SHIELDING : at.SHIELDING + 3] = at.UNSHIELDED
        members = np.flatnonzero((size[label] > 1) & free)
        if not len(members):
            return
        _, own_label = np.unique(label[members], return_inverse=True)
        resistance = self.resistances(known[members], position[members, 2], members)
        own = packed(np.linalg.inv(resistance))
        found = mobilities(own_label, places[members], self.radii[members], own)
        together = np.zeros((len(found), 2, 2))
        np.add.at(together, own_label, resistance)
        shielding = between(together, np.linalg.inv(unpacked(found)))
        known[members, at.SHIELDING : at.SHIELDING + 3] = packed(shielding)[own_label]

    def resistances(self, known: np.ndarray, angle: np.ndarray, members: np.ndarray) -> np.ndarray:
        """(n, 2, 2) of every one's drag alone, held from turning, over the viscosity."""
        if not self.shaped:
            return 6.0 * math.pi * self.radii[members, None, None] * np.eye(2)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.moveaxis(np.array([[c, -s], [s, c]]), 2, 0)
        own = unpacked(known[:, at.RESISTANCE : at.RESISTANCE + 3])
        return turn @ own @ np.swapaxes(turn, 1, 2)


def unpacked(columns: np.ndarray) -> np.ndarray:
    """Symmetric matrices (n, 2, 2) of their (xx, xy, yy) (n, 3)."""
    return columns[:, [0, 1, 1, 2]].reshape(-1, 2, 2)


def packed(matrices: np.ndarray) -> np.ndarray:
    """The other way round."""
    return matrices[:, [0, 0, 1], [0, 1, 1]]


def between(together: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Q (n, 2, 2) with Q K Q = R, of K ``together`` and R ``wanted``: K⁻½ (K½ R K½)½ K⁻½."""
    outer = roots(together)
    inverse = np.linalg.inv(outer)
    return inverse @ roots(outer @ wanted @ outer) @ inverse


def roots(matrices: np.ndarray) -> np.ndarray:
    """Square roots of positive ones (n, 2, 2): (M + √det 1)/√(tr M + 2 √det)."""
    root = np.sqrt(np.linalg.det(matrices))[:, None, None]
    trace = np.trace(matrices, axis1=1, axis2=2)[:, None, None]
    return (matrices + root * np.eye(2)) / np.sqrt(trace + 2.0 * root)
