"""The tuples of numbers and arrays that kernels and drivers see, and where things lie in them.

Imported as ``at``, so that ``work.place[at.NOW]`` says where the name comes from.
"""

import math
from collections import namedtuple
from functools import cache
from typing import Annotated, Any, NamedTuple

import numpy as np

from flocsim.records import Record, clear


class BodyConstants(Record):
    """What does not change of a body in a run; the numbers of its drag as BodyView has them."""

    mass: float  # [kg]
    buoyant_mass: float  # what gravity pulls at [kg]
    inertia: float  # about the centroid [kg m²]
    free: float  # 1 for a body that moves, 0 for a fixed one
    equivalent_radius: float  # of the disc of its area [m]
    bounding_radius: float  # of the circle around the centroid that holds it [m]
    radius: float  # the spheroradius [m]
    elongation: float  # (M₁ − M₂)/(M₁ + M₂) of the principal second moments of area
    long_axis: float  # the angle of its long axis [rad]
    identity: float  # the number that its random forces go by
    resistance_xx: float  # over the viscosity: 0 where no drag follows shapes [m]
    resistance_xy: float  # [m]
    resistance_yy: float  # [m]
    resistance_xs: float  # [m²]
    resistance_ys: float  # [m²]
    resistance_ss: float  # [m³]
    strain_xx_x: float  # [m²]
    strain_xx_y: float  # [m²]
    strain_xx_s: float  # [m³]
    strain_xy_x: float  # [m²]
    strain_xy_y: float  # [m²]
    strain_xy_s: float  # [m³]
    shielding_xx: float  # Q of a body in a cluster of a swarm; 1, 0 and 1 of one alone
    shielding_xy: float
    shielding_yy: float


RESISTANCE_COLUMNS = 12
"""How many numbers a body's resistance has: six of R, six of Γ."""

UNSHIELDED = (1.0, 0.0, 1.0)

# Axes of places and angles, of velocities and spins, of forces and torques.
(
    X,  # [m]
    Y,  # [m]
    ANGLE,  # counter-clockwise [rad]
) = range(3)

# Columns of motions (n, 6) outside of a run, behind those of places.
(
    VX,  # [m/s]
    VY,  # [m/s]
    SPIN,  # [rad/s]
    MOTION_COLUMNS,
) = range(3, 7)

# First columns of a record.
(
    RECORD_TIME,  # [s]
    RECORD_MOTION,  # from here on, of one body after another
) = range(2)

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


class ContactState(Record):
    """What a pair that touches, grazes or has just parted carries from step to step."""

    slip_offset: float  # error that ξ was carried with, less that of places along t [m]
    grazing_force: float  # tangential force of a pair that grazes, now [N]
    fresh: float  # 1 where it has only just begun to graze
    grazing_resistance: float  # by how much that force falls with the rate of the gap [N s/m]
    gap_offset: float  # gap at which the pair has been held, which counts as none [m]
    flight: float  # how far the pair has been apart since it last parted [m]
    flights: float  # how often that was next to nothing (events.grazes)
    cycle_slip: float  # ξ at the end of the last cycle of switches (events.cycles) [m]
    cycle_slip_before: float  # ξ at the end of the cycle before [m]
    cycle_gap: float  # gap at the end of the last cycle [m]
    cycle_gap_before: float  # gap at the end of the cycle before [m]
    flown_at: float  # when the pair last touched again after a flight next to nothing [s]
    sampled: float  # its margin (events.crossings) at the last place looked at in a step [m]
    sampled_rate: float  # rate of that margin [m/s]


class InteriorPoint(Record):
    """The unknowns of a contact in backward Euler's interior-point iteration, and its law there.

    All forces are over ``normal_stiffness``, and so are lengths [m].
    """

    overlap: float  # δ, complementary to the slack [m]
    slack: float  # s, what is left of the gap: gap = s − δ [m]
    friction: float  # tangential force as a share of its limit, from −1 to 1
    slide_ahead: float  # how far the pair slides along the tangent [m]
    slide_behind: float  # how far it slides against it [m]
    normal_stiffness: float  # what the other forces are divided by [N/m]
    friction_limit: float  # largest tangential force that friction bears [m]
    stick_force: float  # tangential force if the pair stuck [m]
    stick_slope: float  # derivative of the stick force by the tangential velocity [s]
    held_overlap: float  # overlap by which friction goes from now on; 0: by δ [m]
    step_share: float  # share of the step in which the pair touches
    fading_gap: float  # gap within which that share falls to half as the pair opens [m]


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

MOST_FRAMES = 3
"""Stages for which a body keeps a frame."""


class Frame(Record):
    """How a body's contacts follow it through a stage of an implicit step."""

    turn_cosine: float  # of the turn of their normals
    turn_sine: float
    shift_x: float  # [m]
    shift_y: float  # [m]


class Pose(Record):
    """How a body lies, and where it lay when pairs were last listed."""

    listed_x: float  # at the last listing [m]
    listed_y: float  # [m]
    listed_angle: float  # [rad]
    cosine: float  # of its angle
    sine: float
    known_angle: float  # an angle whose cosine and sine are remembered [rad]
    known_cosine: float
    known_sine: float
    way: float  # how far its points move at most in a step that is a series [m]


class BodyErrors(Record):
    """What the errors of steps, and of the times of switches, have led to, at a body's outline."""

    memory: float  # how long the body remembers a velocity [s]
    relaxation: float  # how long drag lets a velocity last [s]
    step_place: float  # the last step's error of place [m]
    step_speed: float  # and of velocity [m/s]
    place: float  # what all steps' errors have led to [m]
    speed: float  # [m/s]
    switch_place: float  # what those of switches have led to [m]
    switch_speed: float  # [m/s]
    doubt_place: float  # what contacts that may have opened have led to [m]
    doubt_speed: float  # [m/s]
    stated: float  # the body's stated error [m]


class Cluster(Record):
    """Sums over bodies that act on each other, with the first of them, their leader."""

    mass: float  # [kg]
    shift_x: float  # mass times shift [kg m]
    shift_y: float  # [kg m]
    force_x: float  # [N]
    force_y: float  # [N]
    rate_x: float  # masses times accelerations [N]
    rate_y: float  # [N]
    shortened: float  # the share to which the carried error is shortened
    most_place: float  # by how much a place in it may be wrong [m]


class Kick(Record):
    """The noise in the present thermal kick of a body."""

    x: float  # [1/√s]
    y: float  # [1/√s]
    turn: float  # [1/√s]


class KickTime(Record):
    """When the present thermal kick is."""

    at: float  # its beginning, in the shortest kicks
    span: float  # and how long it is


class Candidate(Record):
    """A vertex of one body and an edge of another, which may touch."""

    vertex_body: int
    vertex: int  # its core point
    edge_body: int
    edge_start: int  # first core point of the edge
    edge_end: int  # its last
    closed: int  # how the pair touches in this step, see OPEN
    near: int  # 1 where it may have a share of a surface force in it
    sliding: int  # ±1 where it slides in it, in the direction of ξ, 0 where it sticks
    pair: int  # the row of the two bodies in ``Work.pairs``


# What Candidate.closed says.
(
    OPEN,  # the pair is apart
    TOUCHES,  # it touches, with the whole contact law
    GRAZES,  # borne by a share of it (flocsim.integrators.rhs.friction)
) = range(3)

# Columns of ``Scene.pieces``: segments and arcs of an outline, in the frame of its body.
(
    PLACE_X,  # of a segment its middle, of an arc the centre of its circle [m]
    PLACE_Y,
    WAY_X,  # of a segment its unit tangent, the body on its left; of an arc the outward …
    WAY_Y,  # … direction of its middle
    SIZE,  # of a segment half its length [m], of an arc tan(α/2), 2 α being its angle
    BEND,  # the radius of an arc [m], 0 of a segment
    MIDDLE_X,  # the centre of a circle that holds the piece [m]
    MIDDLE_Y,
    EXTENT,  # and its radius [m]
    INWARD,  # how far behind the piece the core lies that it is the offset of [m]
    PIECE_COLUMNS,
) = range(11)

# Rows of ``Work.near``, each with its number of pieces in front (rhs.outline_sum).
(
    NEAR_A,  # of the body that is gone along, those that may be near the other one
    NEAR_B,  # of that one
    AROUND,  # of these, those that may be near the piece that is gone along
    SEEN,  # those that may be near any piece that has been
) = range(4)

# Places in ``Work.listed``: for what the first two hold.
(
    LISTED_A,  # the bodies
    LISTED_B,
    LISTED_X,  # where the first one was, in the frame of the second [m]
    LISTED_Y,
    LISTED_COSINE,  # and how it was turned
    LISTED_SINE,
    LISTED_REACH,  # how near to each other pieces that are listed may have been [m]
    LISTED_SIZE,
) = range(8)

# Rows of ``Work.nodes``: places along an outline at which the other one is looked at.
(
    NODE_X,  # [m]
    NODE_Y,
    NODE_NORMAL_X,  # the outward normal
    NODE_NORMAL_Y,
    NODE_WEIGHT,  # how much of the outline it stands for [m]
    NODE_GAP,  # how far the other outline is [m]
    NODE_SUM,  # what attraction comes to there: geometry.contact.attraction [1/m³]
    NODE_PLATES,  # at which gap plates attract each other as strongly [m]
    NODE_LOG_SHARE,  # scratch of that: what a logarithm counts for
    NODE_LOG_OF,  # and of what it is; below 0 where there is none
    CELL_X,  # of a charge, where it lies in a cell of a field: from its corner, of a step
    CELL_Y,
    FIRST_CORNER,  # from here on the columns of ``Scene.field`` at all four corners
) = range(13)

MOST_NODES = 144
"""Nodes at a time."""

MOST_ORDER = 16
"""Nodes of a rule at most."""

# Columns of ``Scene.charges``: up to GROUP neighbours, in the frame of their body.
(
    GROUP_X,  # the centre of a circle that holds them [m]
    GROUP_Y,
    GROUP_EXTENT,  # and its radius [m]
    GROUP_COUNT,  # how many there are
    FIRST_CHARGE,  # from here on, of each x, y [m], and its charge: geometry.contact.charges
) = range(5)

GROUP = 8
"""Charges in a row at most."""

CHARGE_COLUMNS = FIRST_CHARGE + 3 * GROUP

# Columns of ``Scene.grids``: where the field of a body's charges is known, in its own frame.
(
    GRID_X,  # the lower left corner [m]
    GRID_Y,
    GRID_STEP,  # from node to node [m]
    GRID_ACROSS,  # how many tiles there are along x
    GRID_UP,  # and along y
    GRID_TILE,  # where they begin in ``tiles``
    GRID_FINENESS,  # one over the step [1/m]
    GRID_COLUMNS,
) = range(8)

TILE_BITS = 3
TILE = 1 << TILE_BITS
"""Steps along a tile; its nodes are (TILE + 1)², those along its edges being its own."""

# Columns of ``Scene.field``: of charges that make a potential of 1 on their outline.
(
    POTENTIAL,  # [-]
    BY_X,  # its derivatives, of a step
    BY_Y,
    BY_XY,
    FIELD_COLUMNS,
) = range(5)

NODE_ROWS = FIRST_CORNER + 4 * FIELD_COLUMNS

# Places in ``Scene.water``: what two bodies' resistance follows from beside ``Scene.pair_table``.
(
    VISCOSITY,  # [Pa s]
    MEAN_RADIUS,  # of the two [m]
    FLOOR,  # the gap below which it stays what it is [m]
    CUT,  # the gap at which it ends [m]; 0: there is none
    NEAR_CUT,  # the gap of outlines up to which they count [m]; 0: of two spheres
    FLOW,  # from here on: Fluid.flow
) = range(6)

FIRST_RADIUS = FLOW + 6
"""And behind it, of either body, the radius of the sphere that has its drag [m]."""

WATER_SIZE = FIRST_RADIUS + 2

TABLE_COLUMNS = 20
"""Columns of ``Scene.pair_table``: flocsim.hydrodynamics.pair.COLUMNS."""

SQUARES = 6
"""Terms of the resistance of two bodies, rows of ``Work.squares``; in the last row stands what a
strain pulls at them with, and the smooth gap of the last two bodies that were asked for one."""

SOFT_GAP = 6
"""Column of that gap [m]."""


class BodyPair(Record):
    """Two bodies that may come near each other."""

    later: int  # the body of the larger number
    earlier: int
    acting: int  # 1 where they act on each other in this step


class VertexAtEdge(Record):
    """Where a vertex is beside an edge (flocsim.geometry.contact.points)."""

    normal_x: float  # unit normal from the foot on the edge to the vertex
    normal_y: float
    gap: float  # [m]
    vertex_arm_n: (
        float  # the moment about the vertex's body of a unit force along n, at the middle …
    )
    vertex_arm_t: float  # … of the overlap, and along t [m]
    edge_arm_n: float  # the same about the edge's body [m]
    edge_arm_t: float
    turning: float  # the angle by which n turns for every metre of the vertex along t [1/m]
    foot: float  # how far along the edge the foot lies [m]
    side: float  # ±1 where t goes along the edge or against it
    share: float  # of a surface force, that acts through it


class KeptContact(Record):
    """A pair whose displacement is set aside while the list is made anew."""

    later: int  # the body of the larger number
    earlier: int
    vertex: int  # core point of the vertex
    edge: int  # first core point of the edge
    mode: int  # how the pair touched, see OPEN
    slip: float  # its displacement [m]
    slip_offset: float  # see ContactState
    grazing_force: float
    gap_offset: float
    flights: float


# Matrices in ``Work.jacobian``: minus the derivatives of the forces …
(
    DAMPING,  # … by velocity
    STIFFNESS,  # … by place
) = range(2)


class Tally(Record):
    """What a run's lists and sums have come to."""

    candidates: int  # pairs of features listed
    pairs: int  # pairs of bodies listed
    evaluations: int  # forces summed so far
    rebuilds: int  # lists made so far
    solves: int  # systems solved so far
    kept: int  # one more than displacements set aside for a list that found no room; 0: none are
    full: int  # what has found no room, see NOTHING_FULL
    series_terms: int  # terms of the last step's series in ``Work.series``; 0: it was none


# What Tally.full says.
(
    NOTHING_FULL,
    CANDIDATES_FULL,
    PAIRS_FULL,
    BLOCKS_FULL,
    NOT_COMPILED,  # what the engine has left out until it is reached
) = range(5)


class Clock(Record):
    """The times, steps and errors of a run."""

    time: float  # [s]
    until: float  # end of the run, or a stop on the way [s]
    horizon: float  # end of the run where ``until`` is a stop on the way; 0: it is not one [s]
    step: float  # next step [s]
    tolerance: float  # error that a step may have [m]; inf: steps are fixed
    error: float  # stated error of the motion so far [m]
    largest_step: float  # [s]
    bearable_step: float  # largest step that is expected to work at all [s]
    step_error: float  # error of the step just taken [m]
    estimate_share: float  # share of the method's own estimate that counts in the stated error
    # The last steps: what the next one is chosen by.
    previous_step: float  # size of the step before [s]; inf: there was none, 0: a trial has failed
    previous_ratio: float  # its error over the tolerance
    rejected_step: float  # size of the trial that was just rejected [s]; 0: none was
    rejected_ratio: float  # its error over the tolerance
    settling: float  # steps in a row that ended at a switch, until one has been taken that did not
    settled_step: float  # size of the last such step [s]
    flying_step: float  # step that was planned when the last flight ended [s]
    # Newton's method and the stages of Radau IIA.
    pace: float  # factor by which each iteration shrinks the last change
    seen_pace: float  # that of the last second iteration; 0: not known
    seen_step: float  # size of the step in which it was seen [s]
    staged_step: float  # size of the step whose stages are still there [s]; 0: none are
    staged_at: float  # time at which that step began [s]
    # Motion as a series.
    longest_series: float  # longest step whose motion may be a series; inf: any [s]
    series_step: float  # size of the step of the series in ``Work.series`` [s]
    series_turns: float  # that size times a bound of its fastest rate
    # Backward Euler, whose steps go on across switches.
    across: float  # 1 where steps go on across switches, 0 where they end there
    rates_known: float  # 1 where the rates of the last such step (LAST_RATES) are known
    switches: float  # switches since a method last looked how far it had come
    looked_at: float  # when that was [s]; inf: it is to look anew
    # Cycles of switches that are left out (events.cycles).
    cycle_at: float  # end of the last cycle [s]
    cycle_at_before: float  # end of the one before [s]
    cycle_error: float  # stated error at the end of the last [m]


class Counts(Record):
    """What a run has counted, and its budgets."""

    steps: int  # steps taken
    rejected: int  # steps tried in vain
    max_steps: int  # budget of both and of located events
    recorded: int  # rows in the record
    pause_at: int  # steps after which to pause
    code: int  # what the observer has said last
    located: int  # events located
    still: int  # steps in a row by which no time has passed
    look_at: int  # steps after which a method looks how far it has come
    looked_tried: int  # steps that had been tried when it last looked
    cycle_modes: int  # contact modes in which a cycle of switches begins; 0: none has begun
    cycle_code: int  # number that stands for what has switched since
    cycle_code_before: int  # the same of the cycle before
    cycle_switches: int  # switches since the cycle began
    cycles_seen: int  # cycles that have ended
    cycle_returns: int  # how often those modes have come again


class BodyView(NamedTuple):
    """One body, as a BodyForce kernel sees it. SI units; angle and spin counter-clockwise.

    ``elongation`` is B = (M₁ − M₂)/(M₁ + M₂) of the shape's principal second moments of area, and
    ``angle + long_axis`` the angle of its long axis; ``kick_x``, ``kick_y`` and ``kick_turn``
    [1/√s] are means of white noise over the present kick, 0 where a scene has no random forces.

    ``resistance_xx`` … and ``strain_xx_x`` …: in the frame of the shape, over the viscosity, the
    symmetric R of (v_x, v_y, spin) [m, m², m³] and what E_xx = −E_yy, and E_xy, put on a body that
    goes along [m², m², m³] (flocsim.hydrodynamics.PrismDrag), 0 where no drag follows shapes.

    ``shielding_xx``, ``_xy`` and ``_yy``: Q, symmetric, by which the drag R of a body in a cluster
    of a swarm becomes Q R Q (flocsim.swarms.together.clusters); 1, 0 and 1 elsewhere.
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
    resistance_xx: float = 0.0
    resistance_xy: float = 0.0
    resistance_yy: float = 0.0
    resistance_xs: float = 0.0
    resistance_ys: float = 0.0
    resistance_ss: float = 0.0
    strain_xx_x: float = 0.0
    strain_xx_y: float = 0.0
    strain_xx_s: float = 0.0
    strain_xy_x: float = 0.0
    strain_xy_y: float = 0.0
    strain_xy_s: float = 0.0
    shielding_xx: float = 1.0
    shielding_xy: float = 0.0
    shielding_yy: float = 1.0


PlainBodyView: Any = namedtuple(  # type: ignore[misc]
    "PlainBodyView", BodyView._fields[: BodyView._fields.index("resistance_xx")]
)
"""BodyView without the numbers of its shape, where no kernel of a scene reads any."""

NUMBERS_OF_SHAPES = frozenset(BodyView._fields) - frozenset(PlainBodyView._fields)
"""What a BodyView has besides."""


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


class OrientedView(NamedTuple):
    """Two bodies and how they are turned, as an OrientedForce kernel sees them.

    i is the earlier of the two in the list of bodies. ``angle_i`` and ``angle_j`` [rad] are those
    of the bodies, counted from the line that leads from the centroid of i to that of j; ``gap`` [m]
    is d_c − r_i − r_j, and radii are equivalent radii.
    """

    time: float
    gap: float
    centre_distance: float
    angle_i: float
    angle_j: float
    radius_i: float
    radius_j: float
    reduced_radius: float
    effective_mass: float


class OutlineView(NamedTuple):
    """A point of one outline beside another, as an OutlineForce kernel sees it.

    ``gap`` [m] is how far the other outline is from the point, below 0 inside of it;
    ``parted_gap`` the same of outlines that are moved apart to d_min where they are nearer;
    ``plate_gap`` that of two plates which van der Waals forces pull at as strongly there, and
    ``depth_gap`` that of plates which lose as large a share to their depth; ``depth`` [m] that of
    the bodies along the third direction; radii are equivalent radii of both.
    """

    time: float
    gap: float
    parted_gap: float
    plate_gap: float
    depth_gap: float
    depth: float
    radius_i: float
    radius_j: float
    reduced_radius: float
    effective_mass: float


class ContactView(NamedTuple):
    """One contact point, as a ContactForce kernel sees it.

    ``overlap`` [m] > 0 and its rate; ``slip`` [m] the tangential elastic displacement ξ and its
    rate; ``effective_mass`` M = m_i m_j/(m_i + m_j) [kg] of the pair; ``radius_i`` and
    ``radius_j`` [m] are those of the outlines that touch (spheroradii), ``smaller_radius`` the
    equivalent radius of the smaller body.
    """

    overlap: float
    overlap_rate: float
    slip: float
    slip_rate: float
    effective_mass: float
    radius_i: float
    radius_j: float
    smaller_radius: float


def moved_contact(
    view: ContactView, overlap: float, overlap_rate: float, slip: float, slip_rate: float
) -> ContactView:
    """Return the view of the same contact with another overlap, slip, and rates of them."""
    return ContactView(
        overlap, overlap_rate, slip, slip_rate,
        view.effective_mass, view.radius_i, view.radius_j, view.smaller_radius,
    )  # fmt: skip


# What a Scene has where there are no such forces, and where nothing repeats.
NO_OUTLINES = (-1.0, 0.0, 0.0, 0.0)
NO_LAYER = (0.0, 0.0, -1.0)
NO_WATER = (np.zeros((0, TABLE_COLUMNS, 4)), np.zeros(WATER_SIZE))
NO_BOX = (math.inf, math.inf)


class Scene(NamedTuple):
    """What does not change in a run: n bodies, all their core points, the forces' numbers."""

    bodies: np.ndarray  # (n,) of BodyConstants
    first: np.ndarray  # (n + 1,): where a body's core points begin
    vertices: np.ndarray  # (points, 2 or more): geometry.contact.compounds.Outlines
    tree: Annotated[np.ndarray, ("nodes", 3)]  # see there
    pieces: Annotated[
        np.ndarray, ("pieces", PIECE_COLUMNS)
    ]  # see PLACE_X; none if nothing reads it
    first_piece: np.ndarray  # (n + 1,): where a body's pieces begin
    charges: Annotated[np.ndarray, ("groups", CHARGE_COLUMNS)]  # see GROUP_X; none likewise
    first_charge: np.ndarray  # (n + 1,): where a body's charges begin
    grids: Annotated[np.ndarray, ("n", GRID_COLUMNS)]  # see GRID_X; zeros likewise
    tiles: np.ndarray  # (tiles,): where the nodes of each begin in ``field``; −1: it has none
    field: Annotated[np.ndarray, ("nodes", FIELD_COLUMNS)]  # see POTENTIAL
    parameters: np.ndarray  # what the laws read of the forces
    laws: Any  # see flocsim.hooks
    surface_reach: float = -1.0  # the gap up to which surface forces act [m]; −1: there are none
    centre_reach: float = -1.0  # the same of centre forces [m]
    outlines: tuple[float, float, float, float] = NO_OUTLINES  # of forces between: forces.outline
    layer: tuple[float, float, float] = NO_LAYER  # of the charges' double layers: forces.outline
    smoothing: tuple[float, float, float] = (1.0, 0.0, 0.0)  # see flocsim.forces.outline
    events: int = 0  # how many the contact forces have
    box: tuple[float, float] = NO_BOX  # periods along x and y [m]
    # How long random forces stay (integrators.loop.kicks), and what they are drawn by.
    kicks: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    key: tuple[int, int] = (0, 0)
    pair_table: Annotated[np.ndarray, ("intervals", TABLE_COLUMNS, 4)] = NO_WATER[0]
    water: Annotated[np.ndarray, (WATER_SIZE,)] = NO_WATER[1]  # see VISCOSITY
    listed_reach: float = -1.0  # the gap up to which outlines are listed for what acts between them


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
    near: np.ndarray  # (4, pieces + 1): pieces of two bodies, see NEAR_A
    listed: np.ndarray  # see LISTED_A
    feet: np.ndarray  # scratch of rhs.outline_sum
    nodes: Annotated[np.ndarray, (NODE_ROWS, MOST_NODES)]  # see NODE_X
    rules: Annotated[np.ndarray, (MOST_ORDER + 1, 2, MOST_ORDER)]  # Gauss's: nodes, weights
    squares: Annotated[np.ndarray, (SQUARES + 1, 7)]  # of velocities of both bodies, and a load
    pairs: np.ndarray  # (pairs,) of BodyPair
    coordinates: Annotated[np.ndarray, (12,)]  # of two bodies: events.cycles
    budget: np.ndarray  # (pairs,): how far two bodies may move until a list is to be made anew [m]
    along: Annotated[np.ndarray, ("pairs", 4)]  # what acts along outlines now, and by how both are
    # turned: F_x, F_y on the later body [N], the torques on it and on the earlier one [N m]
    discs: Annotated[np.ndarray, ("n", 8)]  # what the sweep for pairs works on
    order: np.ndarray  # (n,): the same
    starts: np.ndarray  # (n + 1,): the same
    tally: Tally


ALL_PAIRS = 12
"""Of so many bodies at most, all pairs that count are watched; of more, those that may come
near."""

MOST_FEET = 16
"""Feet on one piece at most (rhs.outline_sum); more are left out, with nodes further apart."""

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


@cache
def gauss_rules() -> np.ndarray:
    """Nodes and weights of Gauss's rules on [−1, 1], by their numbers of nodes."""
    rules = np.zeros((MOST_ORDER + 1, 2, MOST_ORDER))
    for order in range(1, MOST_ORDER + 1):
        rules[order, :, :order] = np.polynomial.legendre.leggauss(order)
    return rules


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
        near=np.zeros((4, len(scene.pieces) + 1), dtype=np.int64),
        listed=np.zeros(LISTED_SIZE),
        feet=np.zeros(MOST_FEET),
        nodes=np.zeros((NODE_ROWS, MOST_NODES)),
        rules=gauss_rules(),
        squares=np.zeros((SQUARES + 1, 7)),
        pairs=BodyPair.rows(pairs),
        coordinates=np.zeros(12),
        budget=np.zeros(pairs),
        along=np.zeros((pairs, 4)),
        discs=np.zeros((n, 8)),
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
    work.listed.fill(-1.0)
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
    elimination = Elimination(*(array.copy() for array in work.elimination))
    copies = {name: array.copy() for name, array in work._asdict().items() if name != "elimination"}
    return Work(elimination=elimination, **copies)


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
