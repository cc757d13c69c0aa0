"""The tuples of scalars and of arrays that kernels and drivers see."""

from typing import NamedTuple

import numpy as np

from flocsim.layout import NOW, TALLY_SIZE


class BodyView(NamedTuple):
    """One body, as a BodyForce kernel sees it. SI units; angle and spin counter-clockwise."""

    time: float
    x: float
    y: float
    angle: float
    vx: float
    vy: float
    spin: float
    mass: float
    buoyant_mass: float
    inertia: float
    radius: float


class PairView(NamedTuple):
    """Two bodies, as a CentreForce or SurfaceForce kernel sees them.

    ``gap`` [m] is d_c − r_i − r_j for a CentreForce, the distance between the outlines for a
    SurfaceForce; ``gap_rate`` [m/s] its rate of change; radii are equivalent radii.
    """

    time: float
    gap: float
    gap_rate: float
    centre_distance: float
    radius_i: float
    radius_j: float
    reduced_radius: float
    effective_mass: float


class ContactView(NamedTuple):
    """One contact point, as a ContactForce kernel sees it.

    ``overlap`` [m] > 0 and its rate; ``slip`` [m] the tangential elastic displacement ξ and its
    rate; ``effective_mass`` M = m_i m_j/(m_i + m_j) [kg] of the pair.
    """

    overlap: float
    overlap_rate: float
    slip: float
    slip_rate: float
    effective_mass: float
    radius_i: float
    radius_j: float


class Scene(NamedTuple):
    """What does not change in a run: n bodies, all their core points, the forces' numbers.

    ``bodies`` (n, 7) has the columns below; core points of body b are rows ``first[b]`` to
    ``first[b + 1]`` of ``vertices``. Few arrays, because every array that a compiled function is
    handed costs compile time in all of its callers.
    """

    bodies: np.ndarray
    first: np.ndarray
    vertices: np.ndarray
    parameters: np.ndarray


def scene_of(bodies, fluid, parameters):
    """The bodies as one Scene of fresh arrays; ``parameters`` are the forces' numbers."""
    shapes = [body.shape for body in bodies]
    sizes = [len(shape.vertices) for shape in shapes]

    columns = (
        [body.mass for body in bodies],
        [body.buoyant_mass(fluid) for body in bodies],
        [body.inertia for body in bodies],
        [0.0 if body.fixed else 1.0 for body in bodies],
        [shape.equivalent_radius for shape in shapes],
        [shape.bounding_radius for shape in shapes],
        [shape.radius for shape in shapes],
    )
    return Scene(
        bodies=np.ascontiguousarray(np.array(columns, dtype=float).T),
        first=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        vertices=np.concatenate([np.array(shape.vertices) for shape in shapes]),
        parameters=np.array(parameters, dtype=float),
    )


class Work(NamedTuple):
    """What changes in a run, and the scratch space of the drivers; all arrays are reused.

    ``motion`` (4, n, 6): states NOW, NEW, FULL, HALF of x, y, angle, vx, vy, spin.
    ``slip`` (4, capacity): tangential displacements of the listed pairs in these states.
    ``bodies`` (n, 8): force and torque, place at the last listing, cosine and sine of the angle.
    ``system`` (2, 3n, 3n + 1): linear systems BASE and NEWTON, the load in the last column.
    ``candidates`` (capacity, 6): body of the vertex, its core point, body of the edge, first and
    last core point of the edge, 1 where the contact acts in this step.
    ``geometry`` (capacity, 7): see flocsim.geometry.contacts.
    ``kept`` (capacity, 3): point, edge and displacement of pairs while the list is made anew.
    ``budget`` (n (n − 1)/2,): how far two bodies may move until it must be.
    ``placed`` (V, 2): core points at the listing.  ``tally``: counts, see flocsim.layout.
    """

    motion: np.ndarray
    slip: np.ndarray
    bodies: np.ndarray
    system: np.ndarray
    candidates: np.ndarray
    geometry: np.ndarray
    kept: np.ndarray
    budget: np.ndarray
    placed: np.ndarray
    tally: np.ndarray


def work_of(scene, position, velocity, capacity=256):
    """Work arrays for a scene at the given position and velocity (n, 3), no contact yet."""
    n = len(scene.bodies)
    motion = np.zeros((4, n, 6))
    motion[NOW] = np.hstack([position, velocity])
    return Work(
        motion=motion,
        slip=np.zeros((4, capacity)),
        bodies=np.zeros((n, 8)),
        system=np.zeros((2, 3 * n, 3 * n + 1)),
        candidates=np.zeros((capacity, 6), dtype=np.int64),
        geometry=np.zeros((capacity, 7)),
        kept=np.zeros((capacity, 3)),
        budget=np.full(n * (n - 1) // 2, -1.0),
        placed=np.zeros_like(scene.vertices),
        tally=np.zeros(TALLY_SIZE, dtype=np.int64),
    )


def with_capacity(work, capacity):
    """The same work arrays with room for more contact candidates."""

    def grown(array, axis):
        shape = list(array.shape)
        shape[axis] = capacity
        larger = np.zeros(shape, dtype=array.dtype)
        larger[tuple(slice(size) for size in array.shape)] = array
        return larger

    return work._replace(
        slip=grown(work.slip, 1),
        candidates=grown(work.candidates, 0),
        geometry=grown(work.geometry, 0),
        kept=grown(work.kept, 0),
    )
