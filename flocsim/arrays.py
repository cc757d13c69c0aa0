"""The tuples of scalars and of arrays that kernels and drivers see.

Where things lie in the arrays that kernels and drivers share.

Few arrays with named places, because every array that a compiled function is handed costs compile
time in all of its callers.
"""

from typing import NamedTuple

import numpy as np

MASS, BUOYANT_MASS, INERTIA, FREE, EQUIVALENT_RADIUS, BOUNDING_RADIUS, RADIUS = range(7)
"""Columns of ``Scene.bodies``; FREE is 1 for a body that moves, 0 for a fixed one."""

NOW, FIRST, SECOND, NEW, SCRATCH, START = range(6)
"""States in ``Work.motion``; all but the last in ``geometry``, the first four in ``slip``: now,
inside the step twice, at its end; wherever something is tried out (or how wrong NEW is); where the
step began whose stages are still there."""

SLIP_RATES = 4
"""Rows of ``Work.slip`` from here on hold the rates of the displacements, one row a stage."""

STAGES = 7
"""Most stages of an integrator: places in ``Work.rates`` and behind ``SLIP_RATES``."""

LISTED, COSINE, SINE, MEMORY, CLUSTER, FRAMES, BODY_COLUMNS = 0, 3, 4, 5, 6, 7, 19
"""First columns in ``Work.bodies``, and how many there are."""

CLOSED, CLOSEST = 5, 6
"""Columns of ``Work.candidates`` that say how a listed pair acts in this step."""

DAMPING, STIFFNESS = range(2)
"""Matrices in ``Work.jacobian``: minus the derivatives of the forces by velocity and by place."""

CANDIDATES, EVALUATIONS, REBUILDS, SOLVES, KEPT, TALLY_SIZE = range(6)
"""Places in ``Work.tally``: pairs listed; forces evaluated, lists made, systems solved so far; one
more than the displacements set aside for a list that found no room (0: none are)."""

(
    TIME,
    UNTIL,
    STEP,
    TOLERANCE,
    ERROR,
    LARGEST_STEP,
    PREVIOUS_STEP,
    PREVIOUS_RATIO,
    PACE,
    STAGED_STEP,
    STAGED_AT,
    BEARABLE_STEP,
    STEP_ERROR,
    REJECTED_STEP,
    REJECTED_RATIO,
    SETTLING,
    SETTLED_STEP,
    CLOCK_SIZE,
) = range(18)
"""The ``clock`` of a run: time and end [s], next step [s], tolerance [m] (inf: fixed steps), summed
local error [m], largest step [s]; size of the step before (inf: none, 0: it was rejected) and its
error over the tolerance; by how much each of Newton's iterations shrinks the last change; size of
the step whose stages are still there (0: none are) and the time at which it began; the largest
step that is expected to work at all; the error of the step just taken [m]; size and error over
tolerance of the trial that was just rejected (0: none was); 1 from a switch until a step has been
taken behind it; the size of the last such step."""

STEPS, REJECTED, MAX_STEPS, RECORDED, PAUSE_AT, CODE, LOCATED, COUNTS_SIZE = range(8)
"""The ``counts`` of a run: steps taken and rejected, their budget, rows recorded, steps after
which to pause, the observer's last code, events located."""


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

    ``bodies`` (n, 7): see flocsim.arrays; ``first``, ``vertices`` and ``tree``: see
    flocsim.geometry.contact.circle_tree.Outlines. Few arrays, because every array that a compiled
    function is handed costs compile time in all of its callers.
    """

    bodies: np.ndarray
    first: np.ndarray
    vertices: np.ndarray
    tree: np.ndarray
    parameters: np.ndarray


class Work(NamedTuple):
    """What changes in a run, and the scratch space of the drivers; all arrays are reused.

    ``motion`` (6, n, 6): x, y, angle, vx, vy, spin in the states of flocsim.arrays.
    ``rates`` (7, n, 6): velocity and force (with torque) at the stages of a step.
    ``slip`` (11, capacity): tangential displacements in the four states, then their rates.
    ``bodies`` (n, 19): place at the last listing, cosine and sine of the angle, how long a velocity
    is remembered, first body of those it touches, then for each of three stages how its contacts
    have turned and wandered.
    ``jacobian`` (2, 3n, 3n): DAMPING and STIFFNESS.  ``system`` (2, 3n, 3n + 2), complex:
    factorised systems, then the load and the pivots.
    ``candidates`` (capacity, 7): body of the vertex, its core point, body of the edge, first and
    last core point of the edge, 1 where the pair is closed, 1 where its bodies are closest.
    ``geometry`` (5, capacity, 8): see flocsim.geometry.contact.points.
    ``kept`` (capacity, 3): point, edge and displacement of pairs while the list is made anew.
    ``budget`` (n (n − 1)/2,): how far two bodies may move until it must be.
    ``tally``: counts, see flocsim.arrays.
    """

    motion: np.ndarray
    rates: np.ndarray
    slip: np.ndarray
    bodies: np.ndarray
    jacobian: np.ndarray
    system: np.ndarray
    candidates: np.ndarray
    geometry: np.ndarray
    kept: np.ndarray
    budget: np.ndarray
    tally: np.ndarray


def work_of(scene, position, velocity, capacity=256):
    """Work arrays for a scene at the given position and velocity (n, 3), no contact yet."""
    n = len(scene.bodies)
    motion = np.zeros((6, n, 6))
    motion[NOW] = np.hstack([position, velocity])
    return Work(
        motion=motion,
        rates=np.zeros((STAGES, n, 6)),
        slip=np.zeros((SLIP_RATES + STAGES, capacity)),
        bodies=np.zeros((n, BODY_COLUMNS)),
        jacobian=np.zeros((2, 3 * n, 3 * n)),
        system=np.zeros((2, 3 * n, 3 * n + 2), dtype=complex),
        candidates=np.zeros((capacity, 7), dtype=np.int64),
        geometry=np.zeros((5, capacity, 8)),
        kept=np.zeros((capacity, 3)),
        budget=np.full(n * (n - 1) // 2, -1.0),
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
        geometry=grown(work.geometry, 1),
        kept=grown(work.kept, 0),
    )
