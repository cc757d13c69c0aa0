"""The tuples of scalars and of arrays that kernels and drivers see, and where things lie in them.

Few arrays with named places, because every array that a compiled function is handed costs compile
time in all of its callers.
"""

from typing import Any, NamedTuple

import numpy as np

MASS, BUOYANT_MASS, INERTIA, FREE, EQUIVALENT_RADIUS, BOUNDING_RADIUS, RADIUS = range(7)
"""Columns of ``Scene.bodies``; FREE is 1 for a body that moves, 0 for a fixed one."""

X, Y, ANGLE, VX, VY, SPIN, MOTION_COLUMNS = range(7)
"""Columns of ``Work.motion``: place [m], counter-clockwise angle [rad] and their rates."""

RECORD_TIME, RECORD_MOTION = range(2)
"""First columns of a record: time, then the motion of one body after another."""

VELOCITY = VX
"""First column of the velocity in ``Work.motion``, for loops over axes."""

FX, FY, TORQUE = range(3, 6)
"""Columns of the force in ``Work.rates``, behind those of the velocity [N, N m]."""

FORCE = FX
"""First column of the force in ``Work.rates``, for loops over axes."""

NOW, NEW, TRIAL, FIRST_STAGE = range(4)
"""States, rows of ``motion``, ``rates``, ``geometry`` and ``slip`` in Work: now, at the end of the
step, wherever something is tried out in it, and the first of its stages."""

MOST_STAGES = 6
"""Most stages of an integrator that are neither NOW nor NEW."""

STATES = FIRST_STAGE + MOST_STAGES
"""How many states there are with all that belongs to them."""

START, CHANGE, DEVIATION, CARRIED, FORCING, MOTION_ROWS = range(STATES, STATES + 6)
"""Rows of ``Work.motion`` alone: the state in which the step began whose stages are still there; a
change of velocities that Newton's method makes; by how much NEW is likely to be wrong; what all
such errors, carried on with the motion, have become; forces by which it is carried otherwise than a
change of the start [N, N, N m], in the columns of velocities."""

SLIP_RATES = STATES
"""Row ``SLIP_RATES + state`` of ``Work.slip`` holds the rates of the displacements in a state."""

SLIP_OFFSET, KEPT_SLIP, KEPT_OFFSET, SLIP_ROWS = range(2 * STATES, 2 * STATES + 4)
"""Rows of ``Work.slip``: the error that a displacement is carried with, less that of the places
along the tangent; displacements and such offsets that are set aside while the list is made anew."""

(
    LISTED, COSINE, SINE, MEMORY, SHIFT_SUM, MASS_SUM,
    RELAXATION, STEP_PLACE, STEP_SPEED, ERROR_PLACE, ERROR_SPEED, SWITCH_PLACE, SWITCH_SPEED,
    FRAMES,
) = 0, 3, 4, 5, 6, 8, 9, 10, 11, 12, 13, 14, 15, 16  # fmt: skip
"""First columns in ``Work.bodies``: where a body was (x, y, angle) at the last listing; cosine and
sine of its angle; how long it remembers a velocity; sums over its cluster, of mass times shift
(x, y) and of mass; how long drag lets a velocity last [s]; the last step's errors of place [m] and
of velocity [m/s]; what all steps' errors, and those of switches, have led to; its frames at the
stages of an implicit step."""

TURN_COSINE, TURN_SINE, SHIFT_X, SHIFT_Y, FRAME_COLUMNS = range(5)
"""Columns of a frame: cosine and sine of the turn, and both entries of the shift."""

MOST_FRAMES = 3
"""Stages for which a body keeps a frame."""

BODY_COLUMNS = FRAMES + MOST_FRAMES * FRAME_COLUMNS

VERTEX_BODY, VERTEX, EDGE_BODY, EDGE_START, EDGE_END, CLOSED, NEAR, SLIDING = range(8)
"""Columns of ``Work.candidates``: body and core point of the vertex; body, first and last core
point of the edge; 1 where the pair is closed in this step, 1 where it may have a share of a surface
force in it; ±1 where it slides in it, in the direction of ξ, 0 where it sticks."""

(
    NORMAL_X,
    NORMAL_Y,
    GAP,
    VERTEX_ARM_N,
    VERTEX_ARM_T,
    EDGE_ARM_N,
    EDGE_ARM_T,
    TURNING,
    SHARE,
    GEOMETRY_COLUMNS,
) = range(10)
"""Columns of ``Work.geometry``: unit normal from the foot on the edge to the vertex; gap [m]; arms
[m], which are the moments of unit forces along n and t, applied at the middle of the overlap, about
the centroid of the vertex's body and about that of the edge's; the angle by which the normal turns
for every metre of the vertex along t [1/m]; the share of a surface force that
acts through it.  See flocsim.geometry.contact.points."""

KEPT_VERTEX, KEPT_EDGE = range(2)
"""Columns of ``Work.kept``: core point of the vertex, first core point of the edge."""

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
    ESTIMATE_SHARE,
    CLOCK_SIZE,
) = range(19)
"""The ``clock`` of a run: time and end [s], next step [s], tolerance [m] (inf: fixed steps), stated
error [m], largest step [s]; size of the step before (inf: none, 0: it was rejected) and its
error over the tolerance; by how much each of Newton's iterations shrinks the last change; size of
the step whose stages are still there (0: none are) and the time at which it began; the largest
step that is expected to work at all; the error of the step just taken [m]; size and error over
tolerance of the trial that was just rejected (0: none was); steps in a row that ended at a switch,
until one has been taken that does not; the size of the last such step; the share of what the method
estimates for its steps that counts in the stated error."""

STEPS, REJECTED, MAX_STEPS, RECORDED, PAUSE_AT, CODE, LOCATED, STILL, COUNTS_SIZE = range(9)
"""The ``counts`` of a run: steps taken and rejected, their budget, rows recorded, steps after
which to pause, the observer's last code, events located, steps in a row by which no time has
gone by."""


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

    ``gap`` [m] is d_c − r_i − r_j for a CentreForce, the smooth distance between the outlines for a
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
    flocsim.geometry.contact.circle_tree.Outlines; ``laws``: see flocsim.laws;
    ``smoothing``: see flocsim.forces.smoothing.
    """

    bodies: np.ndarray
    first: np.ndarray
    vertices: np.ndarray
    tree: np.ndarray
    parameters: np.ndarray
    laws: Any
    surface_reach: float
    smoothing: tuple[float, float, float]
    events: int


class Work(NamedTuple):
    """What changes in a run, and the scratch space of the drivers; all arrays are reused.

    ``motion`` (14, n, 6): places and velocities in the states, then START, CHANGE, DEVIATION,
    CARRIED, FORCING.
    ``rates`` (9, n, 6): velocity and force (with torque) in the states.
    ``slip`` (21, capacity): tangential displacements in the states, their rates there, then see
    SLIP_OFFSET.
    ``bodies`` (n, 31): see LISTED.  ``cluster`` (n,): first of the bodies that one acts on,
    directly or through others.
    ``jacobian`` (2, 3n, 3n): DAMPING and STIFFNESS.  ``system`` (2, 3n, 3n + 1), complex:
    factorised systems, then the load.  ``pivots`` (2, 3n): which rows have changed places.
    ``candidates`` (capacity, 8): see VERTEX_BODY.  ``geometry`` (9, capacity, 9): see NORMAL_X.
    ``kept`` (capacity, 2): the pairs whose displacements are set aside.
    ``budget`` (n (n − 1)/2,): how far two bodies may move until the list must be made anew.
    ``tally``: counts, see CANDIDATES.
    """

    motion: np.ndarray
    rates: np.ndarray
    slip: np.ndarray
    bodies: np.ndarray
    cluster: np.ndarray
    jacobian: np.ndarray
    system: np.ndarray
    pivots: np.ndarray
    candidates: np.ndarray
    geometry: np.ndarray
    kept: np.ndarray
    budget: np.ndarray
    tally: np.ndarray


def work_of(scene: Scene, position: np.ndarray, velocity: np.ndarray, capacity: int = 256) -> Work:
    """Work arrays for a scene at the given position and velocity (n, 3), no contact yet."""
    n = len(scene.bodies)
    motion = np.zeros((MOTION_ROWS, n, MOTION_COLUMNS))
    motion[NOW] = np.hstack([position, velocity])
    return Work(
        motion=motion,
        rates=np.zeros((STATES, n, MOTION_COLUMNS)),
        slip=np.zeros((SLIP_ROWS, capacity)),
        bodies=np.zeros((n, BODY_COLUMNS)),
        cluster=np.zeros(n, dtype=np.int64),
        jacobian=np.zeros((2, 3 * n, 3 * n)),
        system=np.zeros((2, 3 * n, 3 * n + 1), dtype=complex),
        pivots=np.zeros((2, 3 * n), dtype=np.int64),
        candidates=np.zeros((capacity, SLIDING + 1), dtype=np.int64),
        geometry=np.zeros((STATES, capacity, GEOMETRY_COLUMNS)),
        kept=np.zeros((capacity, 2), dtype=np.int64),
        budget=np.full(n * (n - 1) // 2, -1.0),
        tally=np.zeros(TALLY_SIZE, dtype=np.int64),
    )


def copy_of(work: Work) -> Work:
    """The same work in arrays of its own."""
    return Work(*(array.copy() for array in work))


def with_capacity(work: Work, capacity: int) -> Work:
    """The same work arrays with room for more contact candidates."""

    def grown(array: np.ndarray, axis: int) -> np.ndarray:
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
