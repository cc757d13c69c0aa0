"""Work: all that changes in a run, and the scratch space of the methods.

Motion, forces, contact geometry and displacements exist in several *states*, rows of their arrays:
NOW, NEW (the end of the step), a trial state and the stages of the method. More rows of place and
velocity hold errors and other vectors of the same shape.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np

from flocsim.compiler.by_pointer import clear
from flocsim.state.bodies import MOST_FRAMES, BodyErrors, Cluster, Disc, Frame, Kick, KickTime, Pose
from flocsim.state.clock import BLOCKS_FULL, NOTHING_FULL, PAIRS_FULL, Tally
from flocsim.state.contacts import (
    BodyPair,
    Candidate,
    ContactState,
    InteriorPoint,
    SavedContact,
    VertexAtEdge,
)
from flocsim.state.outlines import (
    MOST_FEET,
    MOST_ORDER,
    Listed,
    NearPieces,
    Nodes,
    gauss_rules,
    nodes_of,
)
from flocsim.state.records import copied
from flocsim.state.scene import Scene

# States: rows of ``place``, ``velocity``, ``force``, ``geometry`` and ``slip`` in Work.
(
    NOW,  # the accepted state
    NEW,  # at the end of the step
    TRIAL,  # any other instant within the step
    FIRST_STAGE,  # first stage of the method
) = range(4)


MOST_STAGES = 6
"""Largest number of stages of an integrator besides NOW and NEW."""


STATES = FIRST_STAGE + MOST_STAGES
"""Number of states with forces, geometry and displacements."""


# Further rows of ``place`` and ``velocity`` alone.
(
    START,  # start of the step whose stages are stored
    CHANGE,  # increment by a Newton iteration, and scratch of the error propagation
    STEP_ERROR,  # error estimate of NEW
    PROPAGATED,  # errors of all steps and switches, propagated with the motion
    FORCING,  # velocity rows: source term of the error-propagation equation [N, N, N m]
    LAST_RATES,  # velocity rows: accelerations of the last step across switches [m/s², 1/s²]
    AT_LAST_CHECK,  # velocity rows: velocities at the last check of progress
    CYCLE_LAST,  # end of the last cycle of switches
    CYCLE_BEFORE,  # end of the cycle before
    ALL_STATES,
) = range(STATES, STATES + 10)


TERMS = 44
"""Most terms of a step's power series: enough for ω h up to 12 (exponential.series)."""


# The series in ``Work.series``, and the nonlinear forces behind them in ``Work.remainder``.
(
    MOTION,  # the motion in the step
    CHANGED,  # a small change of it, by an iteration or an error
) = range(2)


# Rows of ``Work.weights``.
(
    MOVED,  # h²/m of each coordinate [m/N, rad/(N m)]
    LEVER,  # displacement of the outline per unit of a coordinate [1, 1, m]
) = range(2)


SQUARES = 6
"""Squares that the resistance of two bodies is a sum of, rows of ``Work.squares``; one more row
holds the tension that a strain exerts on both."""


# Matrices in ``Work.jacobian``: minus the derivatives of the forces.
(
    DAMPING,  # −∂F/∂v
    STIFFNESS,  # −∂F/∂q
) = range(2)


class Elimination(NamedTuple):
    """Sparse linear systems of a step of many bodies: flocsim.integrators.radau.elimination."""

    place: np.ndarray  # (n,): index of a body in the elimination order; −1 if fixed
    body: np.ndarray  # (n,): body at an index, the inverse of ``place``
    lower: np.ndarray  # (n + 1,): first entry in ``column`` of a row's blocks left of the diagonal
    upper: np.ndarray  # (n,): first entry of those right of it
    column: np.ndarray  # (room,): column indices of the blocks
    blocks: Annotated[np.ndarray, (3, "n + room", 3, 4)]  # see elimination.REAL_PART
    where: np.ndarray  # (n,): block of the row being eliminated, by column
    pairs: np.ndarray  # (pairs,): 1 if a pair of bodies is in the pattern
    graph: np.ndarray  # (room,): scratch of the ordering
    nodes: np.ndarray  # (8, n + 1): scratch of the ordering
    found: np.ndarray  # (3,): see elimination.PATTERN


class Work(NamedTuple):
    """All that changes in a run of n bodies, and scratch space; every array is reused."""

    place: Annotated[np.ndarray, ("rows", "n", 3)]  # positions and angles in all states [m, m, rad]
    velocity: Annotated[np.ndarray, ("rows", "n", 3)]  # velocities and spins [m/s, m/s, rad/s]
    force: Annotated[np.ndarray, ("states", "n", 3)]  # forces and torques [N, N, N m]
    series: Annotated[np.ndarray, (2, TERMS, "few", 3)]  # terms of a motion, see MOTION [m, m, rad]
    remainder: Annotated[
        np.ndarray, (2, 4, "few", 3)
    ]  # R₀, r₁, r₂, r₃ of its nonlinear force [N, N m]
    weights: Annotated[np.ndarray, (2, "few", 3)]  # see MOVED
    linear: Annotated[np.ndarray, (2, "few", "few", 3, 3)]  # h²K/M and h D/M, see DAMPING
    slip: np.ndarray  # (states, capacity): tangential displacements ξ [m]
    slip_rate: np.ndarray  # (states, capacity): their rates [m/s]
    contacts: np.ndarray  # (capacity,) of ContactState
    interior: np.ndarray  # (capacity,) of InteriorPoint
    poses: np.ndarray  # (n,) of Pose
    frames: np.ndarray  # (n, MOST_FRAMES) of Frame
    errors: np.ndarray  # (n,) of BodyErrors
    clusters: np.ndarray  # (n,) of Cluster
    kicks: np.ndarray  # (n,) of Kick
    kick: KickTime
    cluster: np.ndarray  # (n,): first body of the cluster of bodies that act on each other
    jacobian: Annotated[np.ndarray, (2, "blocks", 3, 3)]  # 3 × 3 blocks, see rhs.blocks
    loads: np.ndarray  # (2, 3 n), complex: right-hand sides, then solutions
    system: np.ndarray  # (2, 3 n, 3 n), complex: dense systems of few bodies, factorised
    pivots: np.ndarray  # (2, 3 n): row exchanges of these
    elimination: Elimination  # sparse systems of many bodies
    candidates: np.ndarray  # (capacity,) of Candidate
    geometry: np.ndarray  # (states, capacity) of VertexAtEdge
    kept: np.ndarray  # (capacity,) of SavedContact
    near: NearPieces
    listed: Listed
    feet: np.ndarray  # (MOST_FEET,): parameters of the feet on a piece: rhs.outline_nodes
    nodes: Nodes
    rules: Annotated[np.ndarray, (MOST_ORDER + 1, 2, MOST_ORDER)]  # Gauss rules: nodes, weights
    squares: Annotated[np.ndarray, (SQUARES + 1, 7)]  # rows q of rhs.pair_resistance
    pairs: np.ndarray  # (pairs,) of BodyPair
    cycle_coordinates: Annotated[np.ndarray, (12,)]  # of two bodies, see events.cycles
    budget: np.ndarray  # (pairs,): relative motion for which a pair's list is valid [m]
    # Forces along outlines and oriented forces now: F_x, F_y on the later body [N], torques on the
    # later and on the earlier body [N m].
    outline_forces: Annotated[np.ndarray, ("pairs", 4)]
    discs: np.ndarray  # (n,) of Disc
    order: np.ndarray  # (n,): discs in the order of their left ends
    starts: np.ndarray  # (n + 1,): index of a disc's first pair in ``pairs``
    tally: Tally


ALL_PAIRS = 12
"""Up to this number of bodies all pairs are watched; above it, only those that may come near."""


DENSE = 6
"""Up to this number of bodies linear systems are dense, and steps may be power series."""


PAIRS_A_BODY, BLOCKS_A_BODY = 8, 24
"""Initial room per body for pairs of bodies, and for blocks of sparse systems."""


def counts_as_pair(bodies: np.ndarray, a: int, b: int) -> bool:
    """Return True if two bodies can act on each other: at least one of them is free."""
    return bool(bodies[a].free + bodies[b].free > 0.0)


def all_counting(bodies: np.ndarray, pairs: np.ndarray) -> int:
    """Write all pairs (later, earlier) that can act on each other, sorted; return their number."""
    count = 0
    for later in range(bodies.shape[0]):
        for earlier in range(later):
            if counts_as_pair(bodies, later, earlier):
                pairs[count].later, pairs[count].earlier = later, earlier
                count += 1
    return count


def elimination_of(n: int, pairs: int, room: int) -> Elimination:
    """Return arrays for the sparse systems of n bodies, empty ones for up to DENSE."""
    if n <= DENSE:
        n = pairs = room = 0
    return Elimination(
        place=np.zeros(n, dtype=np.int64),
        body=np.zeros(n, dtype=np.int64),
        lower=np.zeros(n + 1, dtype=np.int64),
        upper=np.zeros(n, dtype=np.int64),
        column=np.zeros(room, dtype=np.int64),
        blocks=np.zeros((3, n + room, 3, 4)),
        where=np.zeros(n, dtype=np.int64),
        pairs=np.zeros(pairs, dtype=np.int64),
        graph=np.zeros(room, dtype=np.int64),
        nodes=np.zeros((8, n + 1), dtype=np.int64),
        found=np.zeros(3, dtype=np.int64),
    )


def work_of(
    scene: Scene,
    position: np.ndarray,
    velocity: np.ndarray,
    capacity: int = 256,
    pairs: int | None = None,
    blocks: int | None = None,
    all_pairs: bool = True,
) -> Work:
    """Return work arrays for a scene at the given position and velocity (n, 3), without contacts.

    ``capacity``, ``pairs`` and ``blocks`` are the room for pairs of features, pairs of bodies and
    blocks of sparse systems; ``all_pairs`` is True if all pairs of few bodies are watched.
    """
    n = len(scene.bodies)
    dense = n if n <= DENSE else 0
    if n <= ALL_PAIRS and all_pairs:
        pairs = n * (n - 1) // 2
    elif pairs is None:
        pairs = PAIRS_A_BODY * n
    work = Work(
        place=np.zeros((ALL_STATES, n, 3)),
        velocity=np.zeros((ALL_STATES, n, 3)),
        force=np.zeros((STATES, n, 3)),
        series=np.zeros((2, TERMS, dense, 3)),
        remainder=np.zeros((2, 4, dense, 3)),
        weights=np.zeros((2, dense, 3)),
        linear=np.zeros((2, dense, dense, 3, 3)),
        slip=np.zeros((STATES, capacity)),
        slip_rate=np.zeros((STATES, capacity)),
        contacts=ContactState.rows(capacity),
        interior=InteriorPoint.rows(capacity),
        poses=Pose.rows(n),
        frames=Frame.rows(n, MOST_FRAMES),
        errors=BodyErrors.rows(n),
        clusters=Cluster.rows(n),
        kicks=Kick.rows(n),
        kick=KickTime.one(),
        cluster=np.zeros(n, dtype=np.int64),
        jacobian=np.zeros((2, 2 * n + 2 * pairs, 3, 3)),
        loads=np.zeros((2, 3 * n), dtype=complex),
        system=np.zeros((2, 3 * dense, 3 * dense), dtype=complex),
        pivots=np.zeros((2, 3 * dense), dtype=np.int64),
        elimination=elimination_of(n, pairs, BLOCKS_A_BODY * n if blocks is None else blocks),
        candidates=Candidate.rows(capacity),
        geometry=VertexAtEdge.rows(STATES, capacity),
        kept=SavedContact.rows(capacity),
        near=NearPieces(*np.zeros((4, len(scene.pieces) + 1), dtype=np.int64)),
        listed=Listed.one(),
        feet=np.zeros(MOST_FEET),
        nodes=nodes_of(),
        rules=gauss_rules(),
        squares=np.zeros((SQUARES + 1, 7)),
        pairs=BodyPair.rows(pairs),
        cycle_coordinates=np.zeros(12),
        budget=np.zeros(pairs),
        outline_forces=np.zeros((pairs, 4)),
        discs=Disc.rows(n),
        order=np.zeros(n, dtype=np.int64),
        starts=np.zeros(n + 1, dtype=np.int64),
        tally=Tally.one(),
    )
    begin(work, scene, position, velocity, all_pairs)
    return work


def begin(
    work: Work, scene: Scene, position: np.ndarray, velocity: np.ndarray, all_pairs: bool = True
) -> None:
    """Write the start of a run into work arrays that are 0."""
    work.listed.first_body = -1
    work.budget.fill(-1.0)
    work.order[:] = range(len(work.order))
    work.place[NOW], work.velocity[NOW] = position, velocity
    if len(scene.bodies) <= ALL_PAIRS and all_pairs:
        work.tally.pairs = all_counting(scene.bodies, work.pairs)


def begin_anew(work: Work, scene: Scene, position: np.ndarray, velocity: np.ndarray) -> None:
    """Reset kept work arrays (by_pointer.keep) to those of work_of for a scene of as many bodies,
    faster than new ones."""
    clear(work)
    begin(work, scene, position, velocity)


def motion_of(work: Work, state: int) -> np.ndarray:
    """Return a copy of positions and velocities in a state (n, 6: x, y, angle, vx, vy, spin)."""
    return np.concatenate([work.place[state], work.velocity[state]], axis=1)


def put_motion(work: Work, state: int, motion: np.ndarray) -> None:
    """Write a motion (n, 6) into a state."""
    work.place[state], work.velocity[state] = motion[:, :3], motion[:, 3:]


def copy_of(work: Work) -> Work:
    """Return the same work in arrays of its own."""
    copies: Work = copied(work)
    return copies


def grown(array: np.ndarray, axis: int, size: int) -> np.ndarray:
    """Return the array enlarged to ``size`` along an axis, with zeros at the end."""
    shape = list(array.shape)
    shape[axis] = size
    larger = np.zeros(shape, dtype=array.dtype)
    larger[tuple(slice(each) for each in array.shape)] = array
    return larger


def wider(arrays: Any, size: int, **axes: int) -> Any:
    """Return a NamedTuple of arrays in which those of {name: axis} are enlarged to ``size``."""
    return arrays._replace(
        **{name: grown(getattr(arrays, name), axis, size) for name, axis in axes.items()}
    )


def with_room(work: Work) -> Work:
    """Return the same work with twice the room in the arrays that were full (Tally.full)."""
    full, elimination = work.tally.full, work.elimination
    work.tally.full = NOTHING_FULL
    if full == PAIRS_FULL:
        pairs = 2 * len(work.pairs)
        work = wider(work, pairs, pairs=0, budget=0, outline_forces=0)
        work = wider(work, 2 * len(work.poses) + 2 * pairs, jacobian=1)
        return work._replace(elimination=wider(elimination, pairs, pairs=0))
    if full == BLOCKS_FULL:
        room = 2 * len(elimination.column)
        elimination = wider(elimination, len(elimination.body) + room, blocks=1)
        return work._replace(elimination=wider(elimination, room, column=0, graph=0))
    return with_capacity(work, 2 * len(work.candidates))


def with_capacity(work: Work, capacity: int) -> Work:
    """Return the same work with room for more candidate pairs of features."""
    by_row = dict.fromkeys(("candidates", "contacts", "interior", "kept"), 0)
    return wider(work, capacity, slip=1, slip_rate=1, geometry=1, **by_row)
