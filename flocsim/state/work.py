"""What changes in a run, and the scratch space of the drivers: Work, in states of a step."""

from typing import Annotated, Any, NamedTuple

import numpy as np

from flocsim.state.bodies import MOST_FRAMES, BodyErrors, Cluster, Disc, Frame, Kick, KickTime, Pose
from flocsim.state.clock import BLOCKS_FULL, NOTHING_FULL, PAIRS_FULL, Tally
from flocsim.state.contacts import (
    BodyPair,
    Candidate,
    ContactState,
    InteriorPoint,
    KeptContact,
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
from flocsim.state.records import clear, copied
from flocsim.state.scene import Scene

# States: rows of ``place``, ``velocity``, ``force``, ``geometry`` and ``slip`` in Work.
(
    NOW,  # as it is
    NEW,  # at the end of the step
    TRIAL,  # wherever something is tried out in it
    FIRST_STAGE,  # the first of its stages
) = range(4)


MOST_STAGES = 6
"""Most stages of an integrator that are neither NOW nor NEW."""


STATES = FIRST_STAGE + MOST_STAGES
"""How many states there are with all that belongs to them."""


# States of places and velocities alone.
(
    START,  # where the step began whose stages are still there
    CHANGE,  # of velocities, by an iteration of Newton's method [m/s, rad/s]
    DEVIATION,  # by how much NEW is likely to be wrong
    CARRIED,  # what all such errors, carried on with the motion, have become
    FORCING,  # in the columns of velocities: by what it is carried beside its start [N, N, N m]
    LAST_RATES,  # there: accelerations of the last step across switches [m/s², 1/s²]
    LOOKED,  # there: the velocities when a method last looked how far it has come
    CYCLE_LAST,  # at the end of the last cycle of switches
    CYCLE_BEFORE,  # at the end of the one before
    ALL_STATES,
) = range(STATES, STATES + 10)


TERMS = 44
"""Terms of a step's series at most."""


# The series in ``Work.series``, and the forces they follow from in ``Work.remainder``.
(
    MOTION,  # of the motion in the step
    CHANGED,  # of a change of it: by an iteration, by an error
) = range(2)


# Rows of ``Work.weights``.
(
    MOVED,  # how far a force moves a body in the square of the step [m/N, rad/(N m)]
    LEVER,  # how far its outline moves for a unit of a coordinate [1, 1, m]
) = range(2)


SQUARES = 6
"""Terms of the resistance of two bodies, rows of ``Work.squares``; in the last row stands what a
strain pulls at them with."""


# Matrices in ``Work.jacobian``: minus the derivatives of the forces …
(
    DAMPING,  # … by velocity
    STIFFNESS,  # … by place
) = range(2)


class Elimination(NamedTuple):
    """The sparse systems of a step of many bodies: flocsim.integrators.radau.elimination."""

    place: np.ndarray  # (n,): where a body comes in the order; −1 for a fixed one
    body: np.ndarray  # (n,): the body at a place
    lower: np.ndarray  # (n + 1,): where a row's blocks left of the diagonal begin in ``column``
    upper: np.ndarray  # (n,): where those right of it begin
    column: np.ndarray  # (room,): places of the blocks
    blocks: Annotated[np.ndarray, (3, "n + room", 3, 4)]  # see elimination.REAL_PART
    where: np.ndarray  # (n,): the block of the row that is worked on in every column
    pairs: np.ndarray  # (pairs,): 1 where a pair of bodies is in the pattern
    graph: np.ndarray  # (room,): scratch of the ordering
    nodes: np.ndarray  # (8, n + 1): scratch of the ordering
    found: np.ndarray  # (3,): see elimination.PATTERN


class Work(NamedTuple):
    """What changes in a run, and the scratch space of the drivers; all arrays are reused."""

    place: Annotated[np.ndarray, ("rows", "n", 3)]  # in all states [m, m, rad]
    velocity: Annotated[np.ndarray, ("rows", "n", 3)]  # in all states [m/s, m/s, rad/s]
    force: Annotated[np.ndarray, ("states", "n", 3)]  # and torque [N, N, N m]
    series: Annotated[np.ndarray, (2, TERMS, "few", 3)]  # of a motion, see MOTION [m, m, rad]
    remainder: Annotated[np.ndarray, (2, 4, "few", 3)]  # R₀, r₁, r₂, r₃ [N, N m]
    weights: Annotated[np.ndarray, (2, "few", 3)]  # see MOVED
    linear: Annotated[np.ndarray, (2, "few", "few", 3, 3)]  # what it follows from, see DAMPING
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
    cluster: np.ndarray  # (n,): first of the bodies that one acts on, through others, too
    jacobian: Annotated[np.ndarray, (2, "blocks", 3, 3)]  # see DAMPING and rhs.blocks
    loads: np.ndarray  # (2, 3 n), complex: right-hand sides, then solutions
    system: np.ndarray  # (2, 3 n, 3 n), complex: few bodies' systems, factorised
    pivots: np.ndarray  # (2, 3 n): which rows have changed places
    elimination: Elimination  # systems of many bodies
    candidates: np.ndarray  # (capacity,) of Candidate
    geometry: np.ndarray  # (states, capacity) of VertexAtEdge
    kept: np.ndarray  # (capacity,) of KeptContact
    near: NearPieces
    listed: Listed
    feet: np.ndarray  # scratch of rhs.outline_sum
    nodes: Nodes
    rules: Annotated[np.ndarray, (MOST_ORDER + 1, 2, MOST_ORDER)]  # Gauss's: nodes, weights
    squares: Annotated[np.ndarray, (SQUARES + 1, 7)]  # of velocities of both bodies, and a load
    pairs: np.ndarray  # (pairs,) of BodyPair
    coordinates: Annotated[np.ndarray, (12,)]  # of two bodies: events.cycles
    budget: np.ndarray  # (pairs,): how far two bodies may move until a list is to be made anew [m]
    along: Annotated[np.ndarray, ("pairs", 4)]  # what acts along outlines now, and by how both are
    # turned: F_x, F_y on the later body [N], the torques on it and on the earlier one [N m]
    discs: np.ndarray  # (n,) of Disc
    order: np.ndarray  # (n,): discs by their left ends
    starts: np.ndarray  # (n + 1,): where the near ones of a disc begin in ``pairs``
    tally: Tally


ALL_PAIRS = 12
"""Of so many bodies at most, all pairs that count are watched; of more, those that may come
near."""


DENSE = 6
"""Of so many bodies at most, the linear systems are dense."""


PAIRS_A_BODY, BLOCKS_A_BODY = 8, 24
"""Room at first for the pairs of bodies, and for the blocks of sparse systems, of a body."""


def counts_as_pair(bodies: np.ndarray, a: int, b: int) -> bool:
    """Whether two bodies can act on each other: one of them is free."""
    return bool(bodies[a].free + bodies[b].free > 0.0)


def all_counting(bodies: np.ndarray, pairs: np.ndarray) -> int:
    """Write all (later, earlier) that can act on each other, sorted; how many there are."""
    count = 0
    for later in range(bodies.shape[0]):
        for earlier in range(later):
            if counts_as_pair(bodies, later, earlier):
                pairs[count].later, pairs[count].earlier = later, earlier
                count += 1
    return count


def elimination_of(n: int, pairs: int, room: int) -> Elimination:
    """Arrays for the sparse systems of n bodies (none for up to DENSE)."""
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
    """Work arrays for a scene at the given position and velocity (n, 3), no contact yet; room for
    so many pairs of features and of bodies, and blocks of sparse systems; ``all_pairs``: whether
    all pairs of few bodies are watched."""
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
        kept=KeptContact.rows(capacity),
        near=NearPieces(*np.zeros((4, len(scene.pieces) + 1), dtype=np.int64)),
        listed=Listed.one(),
        feet=np.zeros(MOST_FEET),
        nodes=nodes_of(),
        rules=gauss_rules(),
        squares=np.zeros((SQUARES + 1, 7)),
        pairs=BodyPair.rows(pairs),
        coordinates=np.zeros(12),
        budget=np.zeros(pairs),
        along=np.zeros((pairs, 4)),
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
    """Write into work arrays that are 0 where a run of a scene begins."""
    work.listed.first_body = -1
    work.budget.fill(-1.0)
    work.order[:] = range(len(work.order))
    work.place[NOW], work.velocity[NOW] = position, velocity
    if len(scene.bodies) <= ALL_PAIRS and all_pairs:
        work.tally.pairs = all_counting(scene.bodies, work.pairs)


def begin_anew(work: Work, scene: Scene, position: np.ndarray, velocity: np.ndarray) -> None:
    """Make work arrays what work_of makes them of a scene of as many bodies: that takes less time
    than to make new ones."""
    for name in Work._fields:
        if name not in ("elimination", "rules"):
            clear(getattr(work, name))
    begin(work, scene, position, velocity)


def motion_of(work: Work, state: int) -> np.ndarray:
    """Return places and velocities in a state (n, 6: x, y, angle, vx, vy, spin), a copy."""
    return np.hstack([work.place[state], work.velocity[state]])


def put_motion(work: Work, state: int, motion: np.ndarray) -> None:
    """Write a motion (n, 6) into a state."""
    work.place[state], work.velocity[state] = motion[:, :3], motion[:, 3:]


def copy_of(work: Work) -> Work:
    """The same work in arrays of its own."""
    copies: Work = copied(work)
    return copies


def grown(array: np.ndarray, axis: int, size: int) -> np.ndarray:
    """The array with room for more along an axis, zeros behind what is there."""
    shape = list(array.shape)
    shape[axis] = size
    larger = np.zeros(shape, dtype=array.dtype)
    larger[tuple(slice(each) for each in array.shape)] = array
    return larger


def wider(arrays: Any, size: int, **axes: int) -> Any:
    """A NamedTuple of arrays in which some {name: axis} have room for so many along an axis."""
    return arrays._replace(
        **{name: grown(getattr(arrays, name), axis, size) for name, axis in axes.items()}
    )


def with_room(work: Work) -> Work:
    """The same work with twice the room for what has found none (Tally.full)."""
    full, elimination = work.tally.full, work.elimination
    work.tally.full = NOTHING_FULL
    if full == PAIRS_FULL:
        pairs = 2 * len(work.pairs)
        work = wider(work, pairs, pairs=0, budget=0, along=0)
        work = wider(work, 2 * len(work.poses) + 2 * pairs, jacobian=1)
        return work._replace(elimination=wider(elimination, pairs, pairs=0))
    if full == BLOCKS_FULL:
        room = 2 * len(elimination.column)
        elimination = wider(elimination, len(elimination.body) + room, blocks=1)
        return work._replace(elimination=wider(elimination, room, column=0, graph=0))
    return with_capacity(work, 2 * len(work.candidates))


def with_capacity(work: Work, capacity: int) -> Work:
    """The same work arrays with room for more contact candidates."""
    by_row = dict.fromkeys(("candidates", "contacts", "interior", "kept"), 0)
    return wider(work, capacity, slip=1, slip_rate=1, geometry=1, **by_row)
