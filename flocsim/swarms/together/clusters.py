"""Clusters of a swarm: which bodies hang together, how large, open and fast such clusters are."""

import math

import attrs
import numpy as np

from flocsim.body import Body
from flocsim.swarms.together.contacts import Neighbours


def placed_together(count: int, neighbours: Neighbours) -> tuple[np.ndarray, np.ndarray]:
    """(label of every body's cluster (n,), the body's place (n, 2) [m] as seen from the cluster's
    first one, along the contacts): clusters are whole across the seams of a box."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    later, earlier = neighbours.pairs.T
    graph = coo_array((np.ones(len(later)), (later, earlier)), shape=(count, count)).tocsr()
    _, labels = connected_components(graph, directed=False)
    apart = {}
    for (a, b), vector in zip(neighbours.pairs.tolist(), neighbours.vector, strict=True):
        apart[a, b], apart[b, a] = vector, -vector
    both = (graph + graph.T).tocsr()
    places = np.zeros((count, 2))
    _, firsts = np.unique(labels, return_index=True)
    for first in firsts:
        if both.indptr[first] == both.indptr[first + 1]:
            continue
        order, before = breadth_first_order(both, first, directed=False)
        for body in order[1:]:
            places[body] = places[before[body]] + apart[body, before[body]]
    return labels, places


@attrs.frozen(eq=False, repr=False)
class Clusters:
    """The clusters of bodies that hang together at one time; fixed bodies hold nothing together.

    ``label`` (n,): the cluster of every body, −1 for fixed ones; of every cluster: ``size`` (c,)
    its bodies; ``mass`` [kg]; ``area`` [m²] of its bodies; ``gyration`` [m], the radius of gyration
    R_g = √(Σ (m ρ² + I)/Σ m) about its centre of mass, that of a body by itself included;
    ``velocity`` (c, 2) [m/s] of its centre of mass; ``porosity``, 1 − area/area of the convex hull
    of its bodies' core points swept by their disks (0 for one convex body).
    """

    label: np.ndarray
    size: np.ndarray
    mass: np.ndarray
    area: np.ndarray
    gyration: np.ndarray
    velocity: np.ndarray
    porosity: np.ndarray

    @classmethod
    def of(
        cls, bodies: tuple[Body, ...], position: np.ndarray, velocity: np.ndarray,
        neighbours: Neighbours, present: np.ndarray | None = None,
    ) -> "Clusters":  # fmt: skip
        """The clusters of bodies at their places and velocities (n, 3); of those ``present`` (n,)
        bool, where not all are."""
        free = np.array([not body.fixed for body in bodies])
        if present is not None:
            free = free & present
        both = free[neighbours.pairs].all(axis=1)
        held = Neighbours(neighbours.pairs[both], neighbours.gap[both], neighbours.vector[both])
        labels, places = placed_together(len(bodies), held)
        names, label = np.unique(labels[free], return_inverse=True)
        count = len(names)
        known = [body for body, moves in zip(bodies, free, strict=True) if moves]
        mass = np.array([body.mass for body in known])
        inertia = np.array([body.inertia for body in known])
        total = np.bincount(label, mass, count)

        def mean(values: np.ndarray) -> np.ndarray:
            return np.bincount(label, mass * values, count) / total

        own = places[free]
        centre = np.column_stack([mean(own[:, axis]) for axis in range(2)])
        away2 = np.sum((own - centre[label]) ** 2, axis=1)
        gyration = np.sqrt(mean(away2 + inertia / mass))
        motion = np.column_stack([mean(velocity[free, axis]) for axis in range(2)])
        area = np.bincount(label, [body.shape.area for body in known], count)
        hulls = hull_areas(known, own, position[free, 2], label, count)
        whole = np.full(len(bodies), -1)
        whole[free] = label
        return cls(
            whole, np.bincount(label, minlength=count), total, area, gyration, motion,
            np.clip(1.0 - area / hulls, 0.0, 1.0),
        )  # fmt: skip

    def __len__(self) -> int:
        return len(self.size)

    def __repr__(self) -> str:
        return f"Clusters({len(self)} of {int(self.size.sum())} bodies, up to {self.size.max()})"

    @property
    def mean_size(self) -> float:
        """Bodies of the cluster that a body belongs to, in the mean over bodies: Σ s²/Σ s."""
        return float(np.sum(self.size.astype(float) ** 2) / np.sum(self.size))

    @property
    def sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """(sizes that there are, how many clusters of each)."""
        return np.unique(self.size, return_counts=True)

    def counts(self, bounds: np.ndarray) -> np.ndarray:
        """Clusters by class, for population balances: how many have an equivalent radius √(A/π)
        from ``bounds[k]`` to below ``bounds[k + 1]`` [m]."""
        return np.histogram(np.sqrt(self.area / math.pi), bounds)[0]

    def fractal_dimension(self, least: int = 4) -> float:
        """D_f of mass ∝ R_g^D_f over the clusters of at least so many bodies, by least squares in
        logarithms; nan where fewer than three sizes are there."""
        chosen = self.size >= least
        if len(np.unique(self.size[chosen])) < 3:
            return math.nan
        slope, _ = np.polyfit(np.log(self.gyration[chosen]), np.log(self.mass[chosen]), 1)
        return float(slope)


def hull_areas(
    bodies: list[Body], places: np.ndarray, angles: np.ndarray, label: np.ndarray, count: int
) -> np.ndarray:
    """Areas [m²] of the convex hulls of clusters' outlines, whose arcs are drawn by 64 points."""
    from scipy.spatial import ConvexHull

    areas = np.zeros(count)
    for cluster in range(count):
        rings = []
        for each in np.flatnonzero(label == cluster):
            x, y = places[each].tolist()
            rings += bodies[each].shape.outline(x, y, float(angles[each]))
        # In micrometres: the hull's own rounding is far below them.
        areas[cluster] = 1e-12 * ConvexHull(1e6 * np.concatenate(rings)).volume
    return areas
