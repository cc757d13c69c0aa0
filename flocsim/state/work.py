"""Work: all that changes in a run, and the scratch space of the methods.

Motion, forces, contact geometry and displacements exist in several *states*, rows of their arrays:
NOW, NEW (the end of the step), a trial state and the stages of the method. More rows of place and
velocity hold errors and other vectors of the same shape.
"""

from typing import Annotated, NamedTuple

import numpy as np

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
from flocsim.state.declared import enlarged, zeros_of
from flocsim.state.outlines import (
    MOST_FEET,
    MOST_ORDER,
    Listed,
    NearFeatures,
    NearPieces,
    Nodes,
    gauss_rules,
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
    ALL_STATES,
) = range(STATES, STATES + 8)


TERMS = 44
"""Most terms of a step's power series: enough for ω h up to 12 (exponential.series)."""


# The series in ``Work.series``, and the nonlinear forces behind them in ``Work.remainder``.
(
    MOTION,  # the motion in the step
    CHANGED,  # a small change of it, by an error
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
    """Sparse linear systems of a step: flocsim.integrators.radau.elimination."""

    place: Annotated[np.ndarray, ("n",), np.int64]  # index in the elimination order; −1: fixed
    body: Annotated[np.ndarray, ("n",), np.int64]  # body at an index, the inverse of ``place``
    # First entry in ``column`` of a row's blocks left of the diagonal, and of those right of it.
    lower: Annotated[np.ndarray, ("after",), np.int64]
    upper: Annotated[np.ndarray, ("n",), np.int64]
    column: Annotated[np.ndarray, ("room",), np.int64]  # column indices of the blocks
    blocks: Annotated[np.ndarray, (3, "sparse", 3, 4)]  # see elimination.REAL_PART
    where: Annotated[np.ndarray, ("n",), np.int64]  # block of the current row, by column
    # Row swapped with each row of a diagonal block as it was factorised, in both systems.
    pivots: Annotated[np.ndarray, (2, "n", 3), np.int64]
    joined: Annotated[np.ndarray, ("n", "n"), np.int8]  # 1: the bodies are neighbours
    degree: Annotated[np.ndarray, ("n",), np.int64]  # number of neighbours not eliminated
    cluster: Annotated[np.ndarray, ("n",), np.int64]  # clusters that the pattern is made for
    pattern: Annotated[np.ndarray, (1,), np.int64]  # 1 if there is a pattern, else 0


class Work(NamedTuple):
    """All that changes in a run of n bodies, and scratch space; every array is reused.

    Sizes: ``n`` bodies; ``few``: those of a series, 0 for more than MOST_IN_SERIES; ``rows``:
    candidate pairs of features; ``pairs``: pairs of bodies.
    """

    place: Annotated[np.ndarray, (ALL_STATES, "n", 3)]  # positions, angles in all states [m, rad]
    velocity: Annotated[np.ndarray, (ALL_STATES, "n", 3)]  # velocities and spins [m/s, rad/s]
    force: Annotated[np.ndarray, (STATES, "n", 3)]  # forces and torques [N, N m]
    # Three coordinates and a 0 for each body: see exponential.series.write_term.
    series: Annotated[np.ndarray, (2, TERMS, "few", 4)]  # terms of a motion, see MOTION [m, rad]
    remainder: Annotated[np.ndarray, (2, 4, "few", 4)]  # R₀, r₁, r₂, r₃ of its force [N, N m]
    weights: Annotated[np.ndarray, (2, "few", 4)]  # see MOVED
    linear: Annotated[np.ndarray, (2, "few", "few", 3, 4)]  # D/h and K, see DAMPING
    slip: Annotated[np.ndarray, (STATES, "rows")]  # tangential displacements ξ [m]
    slip_rate: Annotated[np.ndarray, (STATES, "rows")]  # their rates [m/s]
    contacts: Annotated[np.ndarray, ("rows",), ContactState]
    interior: Annotated[np.ndarray, ("rows",), InteriorPoint]
    poses: Annotated[np.ndarray, ("n",), Pose]
    frames: Annotated[np.ndarray, ("n", MOST_FRAMES), Frame]
    errors: Annotated[np.ndarray, ("n",), BodyErrors]
    clusters: Annotated[np.ndarray, ("n",), Cluster]
    kicks: Annotated[np.ndarray, ("n",), Kick]
    kick: KickTime
    cluster: Annotated[np.ndarray, ("n",), np.int64]  # first body of those that act on each other
    jacobian: Annotated[np.ndarray, (2, "blocks", 3, 3)]  # 3 × 3 blocks, see rhs.blocks
    loads: Annotated[np.ndarray, (2, "unknowns"), complex]  # right-hand sides, then solutions
    elimination: Elimination  # linear systems of a step
    candidates: Annotated[np.ndarray, ("rows",), Candidate]
    geometry: Annotated[np.ndarray, (STATES, "rows"), VertexAtEdge]
    kept: Annotated[np.ndarray, ("rows",), SavedContact]
    near_features: NearFeatures
    near: NearPieces
    listed: Listed
    feet: Annotated[np.ndarray, (MOST_FEET,)]  # parameters of those on a piece: rhs.outline_nodes
    nodes: Nodes
    rules: Annotated[np.ndarray, (MOST_ORDER + 1, 2, MOST_ORDER)]  # Gauss rules: nodes, weights
    squares: Annotated[np.ndarray, (SQUARES + 1, 7)]  # rows q of rhs.pair_resistance
    pairs: Annotated[np.ndarray, ("pairs",), BodyPair]
    budget: Annotated[np.ndarray, ("pairs",)]  # relative motion while a pair's list is valid [m]
    # Forces along outlines and oriented forces now: F_x, F_y on the later body [N], torques on the
    # later and on the earlier body [N m].
    outline_forces: Annotated[np.ndarray, ("pairs", 4)]
    discs: Annotated[np.ndarray, ("n",), Disc]
    order: Annotated[np.ndarray, ("n",), np.int64]  # discs in the order of their left ends
    starts: Annotated[np.ndarray, ("after",), np.int64]  # first pair of a disc in ``pairs``
    tally: Tally


ALL_PAIRS = 12
"""Up to this number of bodies all pairs are watched; above it, only those that may come near."""


MOST_IN_SERIES = 6
"""Up to this number of bodies steps may be power series."""


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


def work_of(
    scene: Scene,
    position: np.ndarray,
    velocity: np.ndarray,
    capacity: int = 64,
    pairs: int | None = None,
    blocks: int | None = None,
    all_pairs: bool = True,
) -> Work:
    """Return work arrays for a scene at the given position and velocity (n, 3), without contacts.

    ``capacity``, ``pairs`` and ``blocks`` are the room for pairs of features, pairs of bodies and
    blocks of sparse systems; ``all_pairs`` is True if all pairs of few bodies are watched.
    """
    n = len(scene.bodies)
    few = n if n <= MOST_IN_SERIES else 0
    if n <= ALL_PAIRS and all_pairs:
        pairs = n * (n - 1) // 2
    elif pairs is None:
        pairs = PAIRS_A_BODY * n
    room = min(BLOCKS_A_BODY * n, n * (n - 1)) if blocks is None else blocks
    work: Work = zeros_of(
        Work,
        n=n, after=n + 1, unknowns=3 * n, few=few, rows=capacity, room=room,
        pieces=len(scene.pieces) + 1, features=len(scene.vertices) + 1,
        **sizes_of_pairs(n, pairs, room),
    )._replace(rules=gauss_rules())  # fmt: skip
    begin(scene, work, all_pairs)
    work.place[NOW], work.velocity[NOW] = position, velocity
    return work


def sizes_of_pairs(n: int, pairs: int, room: int) -> dict[str, int]:
    """Return the sizes that follow from the room for pairs of bodies, and for sparse blocks."""
    return {
        "pairs": pairs, "blocks": 2 * n + 2 * pairs, "sparse": n + room,
    }  # fmt: skip


def begin(scene: Scene, work: Work, all_pairs: bool) -> None:
    """Write what holds at the start of a run, but for its motion, into work arrays that are 0."""
    work.listed.first_body = -1
    for pair in range(work.budget.shape[0]):
        work.budget[pair] = -1.0
    for place in range(work.order.shape[0]):
        work.order[place] = place
    if scene.bodies.shape[0] <= ALL_PAIRS and all_pairs:
        work.tally.pairs = all_counting(scene.bodies, work.pairs)


def fitting(work: Work | None, scene: Scene) -> Work:
    """Return the work arrays, or larger ones, that have room for another scene of as many bodies;
    new ones if there are none."""
    if work is None:
        motion = np.zeros((len(scene.bodies), 3))
        return work_of(scene, motion, motion)
    needed = {"features": len(scene.vertices) + 1, "pieces": len(scene.pieces) + 1}
    room = {"features": len(work.near_features.later), "pieces": len(work.near.first)}
    if all(room[name] >= needed[name] for name in needed):
        return work
    sizes = {name: max(room[name], needed[name]) for name in needed}
    larger: Work = enlarged(work, **sizes)._replace(rules=work.rules)
    return larger


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


def with_room(work: Work) -> Work:
    """Return the same work with twice the room in the arrays that were full (Tally.full)."""
    full, n, pairs = work.tally.full, len(work.poses), len(work.pairs)
    room = len(work.elimination.column)
    work.tally.full = NOTHING_FULL
    sizes = {"rows": 2 * len(work.candidates)}
    if full == PAIRS_FULL:
        sizes = sizes_of_pairs(n, 2 * pairs, room)
    elif full == BLOCKS_FULL:
        sizes = {"room": 2 * room} | sizes_of_pairs(n, pairs, 2 * room)
    # Nothing is ever written to the rules, so that all can have the same.
    larger: Work = enlarged(work, **sizes)._replace(rules=work.rules)
    return larger
