"""Which bodies of a swarm are near each other at an instant, the clusters that they make, and the
drag of bodies in these.

A cluster resists as much as `mobilities` says, R, in any direction of the plane. Its bodies alone
would resist by K = Σ R_i together; each has Q R_i Q instead, with the one symmetric Q for which
Q K Q = R. So a cluster settles at its own speed, every body keeps the share of the drag that it
had, and loads on bonds, which come from those shares, stay what they are. Q is positive and no
more than 1: such a drag takes energy from a body that moves, whatever its cluster.

Bodies are of a cluster where they touch or, for their drag, nearly do. Q follows from places alone
and is kept for a window, in the directions of the window's beginning. Where two clusters touch
within a window, their drag changes with the next one, at once: velocities relax to it, which takes
microseconds, and nothing else jumps.
"""

import math
from collections.abc import Callable, Sequence

import attrs
import numpy as np

from flocsim.body import Body
from flocsim.compiler.composer import compiled, compose
from flocsim.forces.base import Force
from flocsim.forces.drag import drag_radius, follows_shape
from flocsim.geometry.contact.body_pairs import list_near
from flocsim.geometry.contact.near_pairs import gap_between
from flocsim.geometry.contact.points import separation
from flocsim.hydrodynamics.rigid_bodies import mobilities
from flocsim.state.bodies import UNSHIELDED
from flocsim.state.scene import Scene
from flocsim.state.work import NOW, with_room, work_of

ROUNDING = 1e-6
"""Ways round a cluster that differ by less than this share of its extent differ by rounding: the
others by a whole box."""

DIRECTIONS = 256
"""In which the furthest point of a cluster is sought, for its convex hull."""

NEARLY = 0.01
"""Bodies count as touching up to this share of their mean r_eq: to the flow around both it is all
one, and a contact that opens for a moment changes no drag."""

WAY = 0.5
"""Bodies go so many mean bounding radii against each other in a window at most: by that much later
does the drag of those that meet change."""


def measure_gaps(scene, work, within):
    """List the pairs whose bounding circles are nearer than that: their gaps as budgets, and first
    in ``along`` the ways from the earlier to the later body, by the nearest image [m]; False
    without room."""
    if not list_near(scene, work, within):
        return False
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        work.budget[pair] = gap_between(scene, work, a, b)
        work.outline_forces[pair, 0], work.outline_forces[pair, 1] = separation(
            scene, work, NOW, a, b
        )
    return True


@attrs.frozen(eq=False)
class Neighbours:
    """Pairs of bodies, not both fixed, that are near each other: ``pairs`` (m, 2), the later one
    first; ``gap`` (m,) [m] between their outlines, below 0 where they overlap; ``vector`` (m, 2)
    [m] from the centroid of the earlier one to that of the later one's nearest image."""

    pairs: np.ndarray
    gap: np.ndarray
    vector: np.ndarray

    def among(self, chosen: np.ndarray) -> "Neighbours":
        """Those pairs of which both bodies are ``chosen`` (n,) bool."""
        both = chosen[self.pairs].all(axis=1)
        return Neighbours(self.pairs[both], self.gap[both], self.vector[both])


class Gauge:
    """Measures the gaps of a scene's bodies, wherever they are."""

    def __init__(self, scene: Scene, fillings: dict[Callable, Callable]) -> None:
        self.scene = scene
        geometry = {hook: fillings[hook] for hook in (gap_between, separation) if hook in fillings}
        self.measure = compose(measure_gaps, geometry)
        n = len(scene.bodies)
        self.work = work_of(scene, np.zeros((n, 3)), np.zeros((n, 3)), 1, blocks=0, all_pairs=False)

    def neighbours(self, position: np.ndarray, within: float = 0.0) -> Neighbours:
        """The pairs nearer than a gap [m] where the bodies are at ``position`` (n, 3)."""
        self.work.place[NOW] = position
        while not self.measure(self.scene, self.work, within):
            self.work = with_room(self.work)
        gaps = self.work.budget[: self.work.tally.pairs]
        near = np.flatnonzero(gaps < within if within > 0.0 else gaps <= 0.0)
        listed = self.work.pairs[near]
        pairs = np.column_stack([listed["later"], listed["earlier"]])
        return Neighbours(pairs, gaps[near], self.work.outline_forces[near, :2])


def walk_together(pairs, vectors, first, other, way, labels, places, queue):
    """``labels`` (n,) of clusters in the order of their first bodies, and ``places`` (n, 2) as seen
    from those along contacts from ``pairs[k, 1]`` to ``pairs[k, 0]``; the rest is scratch."""
    for body in range(first.shape[0]):
        first[body] = 0
    for pair in range(pairs.shape[0]):
        first[pairs[pair, 0] + 1] += 1
        first[pairs[pair, 1] + 1] += 1
    for body in range(labels.shape[0]):
        first[body + 1] += first[body]
        queue[body] = first[body]
        labels[body] = -1
    for pair in range(pairs.shape[0]):
        for end in range(2):
            body, sign = pairs[pair, end], 1.0 if end == 1 else -1.0
            row = queue[body]
            other[row] = pairs[pair, 1 - end]
            way[row, 0], way[row, 1] = sign * vectors[pair, 0], sign * vectors[pair, 1]
            queue[body] += 1
    clusters = 0
    for start in range(labels.shape[0]):
        if labels[start] >= 0:
            continue
        labels[start], queue[0], done, known = clusters, start, 0, 1
        while done < known:
            body = queue[done]
            done += 1
            for row in range(first[body], first[body + 1]):
                next_ = other[row]
                if labels[next_] < 0:
                    labels[next_] = clusters
                    places[next_, 0] = places[body, 0] + way[row, 0]
                    places[next_, 1] = places[body, 1] + way[row, 1]
                    queue[known] = next_
                    known += 1
        clusters += 1


def placed_together(count: int, neighbours: Neighbours) -> tuple[np.ndarray, np.ndarray]:
    """(label of every body's cluster (n,), the body's place (n, 2) [m] as seen from the cluster's
    first one, along the contacts): clusters are whole across the seams of a box, but for those that
    percolate."""
    ends = 2 * len(neighbours.pairs)
    labels, places = np.zeros(count, dtype=np.int64), np.zeros((count, 2))
    compiled(walk_together, what="the search for clusters")(
        neighbours.pairs, neighbours.vector, np.zeros(count + 1, dtype=np.int64),
        np.zeros(ends, dtype=np.int64), np.zeros((ends, 2)), labels, places,
        np.zeros(count, dtype=np.int64),
    )  # fmt: skip
    return labels, places


def percolating(neighbours: Neighbours, labels: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Whether every body's cluster percolates (n,), of what `placed_together` gives: round a box
    that repeats itself it hangs together with its own images, so that another way along the
    contacts leads to another place."""
    endless = np.zeros(len(labels), bool)
    if len(neighbours.pairs):
        later, earlier = neighbours.pairs.T
        astray = np.hypot(*(places[later] - places[earlier] - neighbours.vector).T)
        extent = np.hypot(*places.T).max() + np.hypot(*neighbours.vector.T).max()
        endless[labels[later[astray > ROUNDING * extent]]] = True
    return endless[labels]


@attrs.frozen(eq=False, repr=False)
class Clusters:
    """The clusters of bodies that hang together at one time; fixed bodies hold nothing together.

    ``label`` (n,): the cluster of every body, −1 for fixed ones; of every cluster: ``size`` (c,)
    its bodies; ``mass`` [kg]; ``area`` [m²] of its bodies; ``gyration`` [m], the radius of gyration
    R_g = √(Σ (m ρ² + I)/Σ m) about its centre of mass, that of a body by itself included;
    ``hydrodynamic`` [m], R_h of the sphere that is as hard to move in the mean of all directions of
    the plane, of bodies that are spheres of r_eq (flocsim.hydrodynamics.rigid_bodies);
    ``velocity`` (c, 2) [m/s] of its centre of mass; ``porosity``, 1 − area/area of the convex hull
    of its bodies' core points swept by their disks (0 for one convex body); ``percolates`` (c,),
    whether it hangs together with its own images round a box that repeats itself. Such a cluster
    has no end, so that ``gyration``, ``hydrodynamic`` and ``porosity`` are NaN.
    """

    label: np.ndarray
    size: np.ndarray
    mass: np.ndarray
    area: np.ndarray
    gyration: np.ndarray
    hydrodynamic: np.ndarray
    velocity: np.ndarray
    porosity: np.ndarray
    percolates: np.ndarray

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
        held = neighbours.among(free)
        labels, places = placed_together(len(bodies), held)
        endless = percolating(held, labels, places)
        names, firsts, label = np.unique(labels[free], return_index=True, return_inverse=True)
        count, percolates = len(names), endless[free][firsts]
        known = [body for body, moves in zip(bodies, free, strict=True) if moves]
        mass = np.array([body.mass for body in known])
        inertia = np.array([body.inertia for body in known])
        total = np.bincount(label, mass, count)

        def mean(values: np.ndarray) -> np.ndarray:
            return np.bincount(label, mass * values, count) / total

        own = places[free]
        centre = np.column_stack([mean(own[:, axis]) for axis in range(2)])
        away2 = np.sum((own - centre[label]) ** 2, axis=1)
        gyration = np.where(percolates, math.nan, np.sqrt(mean(away2 + inertia / mass)))
        motion = np.column_stack([mean(velocity[free, axis]) for axis in range(2)])
        area = np.bincount(label, [body.shape.area for body in known], count)
        hulls = hull_areas(known, own, position[free, 2], label, ~percolates)
        radius = hydrodynamic_radii(known, own, label, ~percolates)
        whole = np.full(len(bodies), -1)
        whole[free] = label
        size, porosity = np.bincount(label, minlength=count), np.clip(1.0 - area / hulls, 0.0, 1.0)
        return cls(whole, size, total, area, gyration, radius, motion, porosity, percolates)

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
        logarithms, without those that percolate; nan where fewer than three sizes are there."""
        chosen = (self.size >= least) & ~self.percolates
        if len(np.unique(self.size[chosen])) < 3:
            return math.nan
        slope, _ = np.polyfit(np.log(self.gyration[chosen]), np.log(self.mass[chosen]), 1)
        return float(slope)


def hydrodynamic_radii(
    bodies: list[Body], places: np.ndarray, label: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """R_h [m] of clusters of spheres of r_eq; NaN for those that have no ``ends`` (c,)."""
    radii = np.array([body.shape.equivalent_radius for body in bodies])
    found = np.where(ends, np.bincount(label, radii, len(ends)), math.nan)
    several = ends & (np.bincount(label, minlength=len(ends)) > 1)
    chosen = several[label]
    if chosen.any():
        _, number = np.unique(label[chosen], return_inverse=True)
        alone = 1.0 / (6.0 * math.pi * radii[chosen])
        own = np.column_stack([alone, 0.0 * alone, alone])
        moved = mobilities(number, places[chosen], radii[chosen], own)
        found[several] = 1.0 / (3.0 * math.pi * (moved[:, 0] + moved[:, 2]))
    return found


def support_areas(starts, first, points, radii, x, y, angle, furthest, areas):
    """Areas [m²] of the convex hulls of clusters, of their furthest points in many directions.

    Bodies of cluster c: ``starts[c]`` to before ``starts[c + 1]``; core points of a body, about its
    centroid, and the ``radii`` of their disks: from ``first[i]`` on; ``furthest`` (DIRECTIONS, 5)
    is scratch.
    """
    for k in range(furthest.shape[0]):
        turn = 2.0 * math.pi * k / furthest.shape[0]
        furthest[k, 3], furthest[k, 4] = math.cos(turn), math.sin(turn)
    for c in range(starts.shape[0] - 1):
        for k in range(furthest.shape[0]):
            furthest[k, 2] = -math.inf
        for i in range(starts[c], starts[c + 1]):
            cosine, sine = math.cos(angle[i]), math.sin(angle[i])
            for point in range(first[i], first[i + 1]):
                px = x[i] + cosine * points[point, 0] - sine * points[point, 1]
                py = y[i] + sine * points[point, 0] + cosine * points[point, 1]
                for k in range(furthest.shape[0]):
                    nx, ny = furthest[k, 3], furthest[k, 4]
                    far = nx * px + ny * py + radii[point]
                    if far > furthest[k, 2]:
                        furthest[k, 0] = px + radii[point] * nx
                        furthest[k, 1] = py + radii[point] * ny
                        furthest[k, 2] = far
        area = 0.0
        last = furthest.shape[0] - 1
        for k in range(furthest.shape[0]):
            area += furthest[last, 0] * furthest[k, 1] - furthest[k, 0] * furthest[last, 1]
            last = k
        areas[c] = 0.5 * area


def hull_areas(
    bodies: list[Body], places: np.ndarray, angles: np.ndarray, label: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """Areas [m²] of the convex hulls of clusters' core points swept by their disks; NaN for those
    that have no ``ends`` (c,)."""
    order = np.argsort(label, kind="stable")
    shapes = [bodies[each].shape for each in order.tolist()]
    rings = [ring for shape in shapes for part in shape.parts for ring in part.rings[:1]]
    swept = [part.radius for shape in shapes for part in shape.parts]
    sizes = np.array([len(ring) for ring in rings])
    parts = np.cumsum([0, *(len(shape.parts) for shape in shapes)])
    x, y = np.ascontiguousarray(places[order].T)
    areas = np.zeros(len(ends))
    compiled(support_areas, what="the hulls of clusters")(
        np.append(0, np.cumsum(np.bincount(label, minlength=len(ends)))),
        np.append(0, np.cumsum(sizes))[parts], np.concatenate(rings),
        np.repeat(np.array(swept), sizes), x, y, angles[order], np.zeros((DIRECTIONS, 5)), areas,
    )  # fmt: skip
    return np.where(ends, areas, math.nan)


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
        free = known["free"] == 1.0
        near = self.gauge.neighbours(position, self.nearly)
        label, places = placed_together(len(free), near.among(free))
        size = np.bincount(label)
        size[label[near.pairs[~free[near.pairs].all(axis=1)]]] = 1  # on a wall
        for name, alone in zip(SHIELDING, UNSHIELDED, strict=True):
            known[name] = alone
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
        for name, column in zip(SHIELDING, packed(shielding)[own_label].T, strict=True):
            known[name][members] = column

    def resistances(self, known: np.ndarray, angle: np.ndarray, members: np.ndarray) -> np.ndarray:
        """(n, 2, 2) of every one's drag alone, held from turning, over the viscosity."""
        if not self.shaped:
            return 6.0 * math.pi * self.radii[members, None, None] * np.eye(2)
        c, s = np.cos(angle), np.sin(angle)
        turn = np.moveaxis(np.array([[c, -s], [s, c]]), 2, 0)
        own = unpacked(np.column_stack([known[name] for name in RESISTANCE]))
        return turn @ own @ np.swapaxes(turn, 1, 2)


RESISTANCE = "resistance_xx", "resistance_xy", "resistance_yy"
SHIELDING = "shielding_xx", "shielding_xy", "shielding_yy"


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
