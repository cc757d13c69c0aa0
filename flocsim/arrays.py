"""The tuples of numbers and arrays that kernels and drivers see, and where things lie in them."""

from typing import Annotated, Any, NamedTuple

import numpy as np

(
    MASS, BUOYANT_MASS, INERTIA, FREE, EQUIVALENT_RADIUS, BOUNDING_RADIUS, RADIUS,
    ELONGATION, LONG_AXIS, IDENTITY,
) = range(10)  # fmt: skip
"""Columns of ``Scene.bodies``; FREE is 1 for a body that moves, 0 for a fixed one; then a shape's
elongation and the angle of its long axis [rad]; the number that a body's random forces go by."""

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

(
    START, CHANGE, DEVIATION, CARRIED, FORCING, LAST_RATES, LOOKED, CYCLE_LAST, CYCLE_BEFORE,
    MOTION_ROWS,
) = range(STATES, STATES + 10)  # fmt: skip
"""Rows of ``Work.motion`` alone: the state in which the step began whose stages are still there; a
change of velocities that Newton's method makes; by how much NEW is likely to be wrong; what all
such errors, carried on with the motion, have become; in the columns of velocities, forces by which
it is carried otherwise than a change of the start [N, N, N m], the accelerations of the last step
across switches [m/s², 1/s²], and the velocities when a method last looked how far it has come; the
motion at the ends of the last cycle of switches and of the one before."""

SLIP_RATES = STATES
"""Row ``SLIP_RATES + state`` of ``Work.slip`` holds the rates of the displacements in a state."""

(
    SLIP_OFFSET, GRAZING_FORCE, FRESH, GRAZING_RESISTANCE, GAP_OFFSET, FLIGHT, FLIGHTS,
    OVERLAP, PART, GAIN, LEFT, RUBBING, AHEAD, BEHIND,
    KEPT_SLIP, KEPT_OFFSET, KEPT_FORCE, KEPT_GAP, KEPT_FLIGHTS,
    CYCLE_SLIP, CYCLE_SLIP_BEFORE, CYCLE_GAP, CYCLE_GAP_BEFORE, FLOWN_AT, SLIP_ROWS,
) = range(2 * STATES, 2 * STATES + 25)  # fmt: skip
"""Rows of ``Work.slip``: the error that a displacement is carried with, less that of the places
along the tangent.  Of a pair that grazes: its tangential force now [N]; 1 where it has only just
begun; by how much that force falls with the rate of the gap [N s/m]; the gap at which it has been
held, which counts as none [m].  How far a pair has been apart since it last parted [m], how often
that was next to nothing (see events.grazes).  The overlap [m] and the part of the step that a
pair's friction goes by while the end of a step across switches is looked for, and how fast that
part follows (contact_mean.follow); of an interior-point method that finds out which pairs close and
slide: what is left of the gap [m], the share of what friction can hold, and how far the pair slides
ahead and behind [m].  Displacements, offsets, forces, gaps and flights that are set aside while the
list is made anew.  Displacements and gaps at the ends of the last cycle of switches and of the one
before [m]; when the pair last touched again behind a flight that was next to nothing [s]."""

(
    LISTED, COSINE, SINE, MEMORY, SHIFT_SUM, MASS_SUM,
    RELAXATION, STEP_PLACE, STEP_SPEED, ERROR_PLACE, ERROR_SPEED, SWITCH_PLACE, SWITCH_SPEED,
    DOUBT_PLACE, DOUBT_SPEED, SHORTENED, LEADER_FORCE, LEADER_RATE, KICK_AT, KICK_SPAN, KICK_X,
    KNOWN_ANGLE, KNOWN_COSINE, KNOWN_SINE, MOST_PLACE, STATED, FRAMES,
) = (
    0, 3, 4, 5, 6, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 21, 23, 24, 25, 28, 29, 30, 31, 32,
    33,
)  # fmt: skip
"""First columns in ``Work.bodies``: where a body was (x, y, angle) at the last listing; cosine and
sine of its angle; how long it remembers a velocity; sums over its cluster, of mass times shift (x,
y) and of mass; how long drag lets a velocity last [s]; the last step's errors of place [m] and of
velocity [m/s]; what all steps' errors, those of switches, and contacts that may have opened have
led to; of the first body of a cluster: the share to which the carried
error is shortened, the sums of forces, and of masses times accelerations (x, y); of body 0, where
the present kick begins and how long it is, in the shortest kicks; the noise in it (x, y, angle); an
angle, and its cosine and sine, as they are remembered; of the first body of a cluster, by how much
the place of one of its bodies may be wrong [m]; the stated error of a body [m]; its frames at an
implicit step's stages."""

TURN_COSINE, TURN_SINE, SHIFT_X, SHIFT_Y, FRAME_COLUMNS = range(5)
"""Columns of a frame: cosine and sine of the turn, and both entries of the shift."""

MOST_FRAMES = 3
"""Stages for which a body keeps a frame."""

BODY_COLUMNS = FRAMES + MOST_FRAMES * FRAME_COLUMNS

(
    VERTEX_BODY, VERTEX, EDGE_BODY, EDGE_START, EDGE_END, CLOSED, NEAR, SLIDING, PAIR,
    DOES, CANDIDATE_COLUMNS,
) = range(11)  # fmt: skip
"""Columns of ``Work.candidates``: body and core point of the vertex; body, first and last core
point of the edge; how the pair touches in this step, see OPEN; 1 where it may have a share of a
surface force in it; ±1 where it slides in it, in the direction of ξ, 0 where it sticks; the row of
the two bodies in ``Work.pairs``; in an iteration of backward Euler, what the pair does (see
contact_mean.mode_of)."""

OPEN, TOUCHES, GRAZES = range(3)
"""What ``CLOSED`` says: the pair is apart; it touches, with the whole contact law; it grazes, borne
by a share of it (flocsim.integrators.rhs.grazing)."""

LATER, EARLIER, ACTING, PAIR_COLUMNS = range(4)
"""Columns of ``Work.pairs``: two bodies, the later one first; 1 where they act on each other in
this step."""

(
    NORMAL_X,
    NORMAL_Y,
    GAP,
    VERTEX_ARM_N,
    VERTEX_ARM_T,
    EDGE_ARM_N,
    EDGE_ARM_T,
    TURNING,
    FOOT,
    SIDE,
    SHARE,
    GEOMETRY_COLUMNS,
) = range(12)
"""Columns of ``Work.geometry``: unit normal from the foot on the edge to the vertex; gap [m]; arms
[m], which are the moments of unit forces along n and t, applied at the middle of the overlap, about
the centroid of the vertex's body and about that of the edge's; the angle by which the normal turns
for every metre of the vertex along t [1/m]; how far along the edge the foot
lies [m], and ±1 where t goes along the edge or against it; the share of a surface force that acts
through it.  See flocsim.geometry.contact.points."""

KEPT_LATER, KEPT_EARLIER, KEPT_VERTEX, KEPT_EDGE, KEPT_MODE, KEPT_COLUMNS = range(6)
"""Columns of ``Work.kept``: the two bodies, the later one first; core point of the vertex, first
core point of the edge; how the pair touched."""

DAMPING, STIFFNESS = range(2)
"""Matrices in ``Work.jacobian``: minus the derivatives of the forces by velocity and by place."""

CANDIDATES, PAIRS, EVALUATIONS, REBUILDS, SOLVES, KEPT, FULL, TALLY_SIZE = range(8)
"""Places in ``Work.tally``: pairs of features and pairs of bodies listed; forces evaluated, lists
made, systems solved so far; one more than the displacements set aside for a list that found no room
(0: none are); what has found no room."""

NOTHING_FULL, CANDIDATES_FULL, PAIRS_FULL, BLOCKS_FULL = range(4)
"""What ``FULL`` says."""

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
    HORIZON,
    SEEN_PACE,
    SEEN_STEP,
    ACROSS,
    RATES_KNOWN,
    BUSY,
    SWITCHES,
    LOOKED_AT,
    CYCLE_AT,
    CYCLE_AT_BEFORE,
    CYCLE_ERROR,
    CLOCK_SIZE,
) = range(30)
"""The ``clock`` of a run: time and end [s], next step [s], tolerance [m] (inf: fixed steps), stated
error [m], largest step [s]; size of the step before (inf: none, 0: it was rejected) and its
error over the tolerance; by how much each of Newton's iterations shrinks the last change; size of
the step whose stages are still there (0: none are) and the time at which it began; the largest
step that is expected to work at all; the error of the step just taken [m]; size and error over
tolerance of the trial that was just rejected (0: none was); steps in a row that ended at a switch,
until one has been taken that does not; the size of the last such step; the share of what the method
estimates for its steps that counts in the stated error; until when the run goes on, where UNTIL is
but a stop on the way (0: it is not) [s]; the pace of the last second iteration that was made (0: it
is not known), and the size of its step; 1 where steps go on across switches, 0 where they end
there; of steps across them: 1 where LAST_RATES are known, 1 where so many contacts switch in a step
that Newton's method alone is slow, and the switches since a method last looked how far it has come;
when that was (inf: it is to do so anew) [s]; the ends of the last cycle of switches and of the one
before [s], and the stated error at the last [m]."""

(
    STEPS, REJECTED, MAX_STEPS, RECORDED, PAUSE_AT, CODE, LOCATED, STILL, LOOK_AT, LOOKED_TRIED,
    CYCLE_MODES, CYCLE_CODE, CYCLE_CODE_BEFORE, CYCLE_SWITCHES, CYCLES_SEEN, CYCLE_RETURNS,
    COUNTS_SIZE,
) = range(17)  # fmt: skip
"""The ``counts`` of a run: steps taken and rejected, their budget, rows recorded, steps after
which to pause, the observer's last code, events located, steps in a row by which no time has
gone by; steps after which a method looks how far it has come, and how many had been tried when it
last did; of cycles of switches (see events.cycles): the modes in which one begins (0: none has),
a number for what has switched since and one for the cycle before, how many switches there were, how
many cycles have ended, and how often those modes have come again."""


class BodyView(NamedTuple):
    """One body, as a BodyForce kernel sees it. SI units; angle and spin counter-clockwise.

    ``elongation`` is B = (M₁ − M₂)/(M₁ + M₂) of the shape's principal second moments of area, and
    ``angle + long_axis`` the angle of its long axis; ``kick_x``, ``kick_y`` and ``kick_turn``
    [1/√s] are means of white noise over the present kick, 0 where a scene has no random forces.
    """

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
    elongation: float
    long_axis: float
    kick_x: float = 0.0
    kick_y: float = 0.0
    kick_turn: float = 0.0


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

    ``bodies`` (n, 10): see flocsim.arrays; ``first``, ``vertices`` and ``tree``: see
    flocsim.geometry.contact.circle_tree.Outlines; ``laws``: see flocsim.laws; ``surface_reach``
    and ``centre_reach``: the gaps up to which such forces act [m], −1 where there are none;
    ``smoothing``: see flocsim.forces.smoothing; ``box``: periods along x and y [m], inf where
    nothing repeats; ``kicks`` and ``key``: how long random forces stay the same, and what they
    are drawn by, see flocsim.integrators.loop.kicks.
    """

    bodies: Annotated[np.ndarray, ("n", 10)]
    first: np.ndarray
    vertices: np.ndarray
    tree: Annotated[np.ndarray, ("nodes", 3)]
    parameters: np.ndarray
    laws: Any
    surface_reach: float
    centre_reach: float
    smoothing: tuple[float, float, float]
    events: int
    box: tuple[float, float]
    kicks: tuple[float, float, float, float]
    key: tuple[int, int]


class Elimination(NamedTuple):
    """The sparse systems of a step of many bodies: flocsim.integrators.radau.elimination.

    ``place`` (n,): where a body comes in the order of elimination, −1 for a fixed one; ``body``:
    the body at a place.  ``lower`` (n + 1,) and ``upper`` (n,): where the blocks of a row left and
    right of the diagonal begin in ``column`` (room,), which holds their places, and in ``blocks``
    (room, 3, 3, 3): the parts of a block (see sparse REAL_PART), rows, columns.  ``pivot``
    (n, 3, 3, 3): the inverses of the diagonal blocks; ``row``: the row that is worked on.
    ``pairs`` (pairs,): 1 where a pair of bodies is in the pattern.  ``graph`` (room,) and
    ``nodes`` (8, n + 1): scratch of the ordering.  ``found``: see elimination.PATTERN.
    """

    place: np.ndarray
    body: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    column: np.ndarray
    blocks: Annotated[np.ndarray, ("room", 3, 3, 3)]
    pivot: Annotated[np.ndarray, ("n", 3, 3, 3)]
    row: Annotated[np.ndarray, ("n", 3, 3, 3)]
    pairs: np.ndarray
    graph: np.ndarray
    nodes: np.ndarray
    found: np.ndarray


class Work(NamedTuple):
    """What changes in a run, and the scratch space of the drivers; all arrays are reused.

    ``motion`` (18, n, 6): places and velocities in the states, then see START.
    ``rates`` (9, n, 6): velocity and force (with torque) in the states.
    ``slip`` (42, capacity): tangential displacements in the states, their rates there, then see
    SLIP_OFFSET.
    ``bodies`` (n, 45): see LISTED.  ``cluster`` (n,): first of the bodies that one acts on,
    directly or through others.
    ``jacobian`` (2, 2 n + 2 pairs, 3, 3): blocks of DAMPING and STIFFNESS, see rhs.blocks.
    ``loads`` (2, 3 n), complex: right-hand sides of the linear systems, then their solutions.
    ``system`` (2, 3 n, 3 n), complex: few bodies' factorised systems, and ``pivots`` (2, 3 n),
    which rows have changed places; ``elimination``: those of many.
    ``candidates`` (capacity, 10): see VERTEX_BODY.  ``geometry`` (9, capacity, 11): see NORMAL_X.
    ``kept`` (capacity, 5): the pairs whose displacements are set aside.
    ``pairs`` (pairs, 3): the pairs of bodies that may come near each other, see LATER; ``budget``
    (pairs,): how far two bodies may move until the list must be made anew; ``discs`` (n, 8),
    ``order`` (n,) and ``starts`` (n + 1,): what the sweep for them works on.
    ``tally``: counts, see CANDIDATES.
    """

    motion: Annotated[np.ndarray, ("rows", "n", MOTION_COLUMNS)]
    rates: Annotated[np.ndarray, ("states", "n", MOTION_COLUMNS)]
    slip: np.ndarray
    bodies: Annotated[np.ndarray, ("n", BODY_COLUMNS)]
    cluster: np.ndarray
    jacobian: Annotated[np.ndarray, (2, "blocks", 3, 3)]
    loads: np.ndarray
    system: np.ndarray
    pivots: np.ndarray
    elimination: Elimination
    candidates: Annotated[np.ndarray, ("capacity", CANDIDATE_COLUMNS)]
    geometry: Annotated[np.ndarray, ("states", "capacity", GEOMETRY_COLUMNS)]
    kept: Annotated[np.ndarray, ("capacity", KEPT_COLUMNS)]
    pairs: Annotated[np.ndarray, ("pairs", PAIR_COLUMNS)]
    budget: np.ndarray
    discs: Annotated[np.ndarray, ("n", 8)]
    order: np.ndarray
    starts: np.ndarray
    tally: np.ndarray


ALL_PAIRS = 12
"""Of so many bodies at most, all pairs that count are watched; of more, those that may come
near."""

DENSE = 6
"""Of so many bodies at most, the linear systems are dense."""

PAIRS_A_BODY, BLOCKS_A_BODY = 8, 24
"""Room at first for the pairs of bodies, and for the blocks of sparse systems, of a body."""


def counts_as_pair(bodies: np.ndarray, a: int, b: int) -> bool:
    """Whether two bodies can act on each other: one of them is free."""
    return bool(bodies[a, FREE] + bodies[b, FREE] > 0.0)


def all_counting(bodies: np.ndarray, pairs: np.ndarray) -> int:
    """Write all (later, earlier) that can act on each other, sorted; how many there are."""
    count = 0
    for later in range(bodies.shape[0]):
        for earlier in range(later):
            if counts_as_pair(bodies, later, earlier):
                pairs[count, LATER], pairs[count, EARLIER] = later, earlier
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
        blocks=np.zeros((room, 3, 3, 3)),
        pivot=np.zeros((n, 3, 3, 3)),
        row=np.zeros((n, 3, 3, 3)),
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
    motion = np.zeros((MOTION_ROWS, n, MOTION_COLUMNS))
    motion[NOW] = np.hstack([position, velocity])
    dense = n if n <= DENSE else 0
    if n <= ALL_PAIRS and all_pairs:
        pairs = n * (n - 1) // 2
    elif pairs is None:
        pairs = PAIRS_A_BODY * n
    work = Work(
        motion=motion,
        rates=np.zeros((STATES, n, MOTION_COLUMNS)),
        slip=np.zeros((SLIP_ROWS, capacity)),
        bodies=np.zeros((n, BODY_COLUMNS)),
        cluster=np.zeros(n, dtype=np.int64),
        jacobian=np.zeros((2, 2 * n + 2 * pairs, 3, 3)),
        loads=np.zeros((2, 3 * n), dtype=complex),
        system=np.zeros((2, 3 * dense, 3 * dense), dtype=complex),
        pivots=np.zeros((2, 3 * dense), dtype=np.int64),
        elimination=elimination_of(n, pairs, BLOCKS_A_BODY * n if blocks is None else blocks),
        candidates=np.zeros((capacity, CANDIDATE_COLUMNS), dtype=np.int64),
        geometry=np.zeros((STATES, capacity, GEOMETRY_COLUMNS)),
        kept=np.zeros((capacity, KEPT_COLUMNS), dtype=np.int64),
        pairs=np.zeros((pairs, PAIR_COLUMNS), dtype=np.int64),
        budget=np.full(pairs, -1.0),
        discs=np.zeros((n, 8)),
        order=np.arange(n, dtype=np.int64),
        starts=np.zeros(n + 1, dtype=np.int64),
        tally=np.zeros(TALLY_SIZE, dtype=np.int64),
    )
    if n <= ALL_PAIRS and all_pairs:
        work.tally[PAIRS] = all_counting(scene.bodies, work.pairs)
    return work


def copy_of(work: Work) -> Work:
    """The same work in arrays of its own."""
    copies = {name: array.copy() for name, array in work._asdict().items() if name != "elimination"}
    elimination = Elimination(*(array.copy() for array in work.elimination))
    return Work(elimination=elimination, **copies)


def grown(array: np.ndarray, axis: int, size: int) -> np.ndarray:
    """The array with room for more along an axis, zeros behind what is there."""
    shape = list(array.shape)
    shape[axis] = size
    larger = np.zeros(shape, dtype=array.dtype)
    larger[tuple(slice(each) for each in array.shape)] = array
    return larger


def with_room(work: Work) -> Work:
    """The same work with twice the room for what has found none: see FULL."""
    full = work.tally[FULL]
    work.tally[FULL] = NOTHING_FULL
    if full == PAIRS_FULL:
        n, pairs = len(work.bodies), 2 * len(work.pairs)
        elimination = work.elimination._replace(pairs=grown(work.elimination.pairs, 0, pairs))
        return work._replace(
            jacobian=grown(work.jacobian, 1, 2 * n + 2 * pairs),
            pairs=grown(work.pairs, 0, pairs),
            budget=grown(work.budget, 0, pairs),
            elimination=elimination,
        )
    if full == BLOCKS_FULL:
        room = 2 * len(work.elimination.column)
        elimination = work.elimination._replace(
            column=grown(work.elimination.column, 0, room),
            blocks=grown(work.elimination.blocks, 0, room),
            graph=grown(work.elimination.graph, 0, room),
        )
        return work._replace(elimination=elimination)
    return with_capacity(work, 2 * len(work.candidates))


def with_capacity(work: Work, capacity: int) -> Work:
    """The same work arrays with room for more contact candidates."""
    return work._replace(
        slip=grown(work.slip, 1, capacity),
        candidates=grown(work.candidates, 0, capacity),
        geometry=grown(work.geometry, 1, capacity),
        kept=grown(work.kept, 0, capacity),
    )
