"""What the engine knows of each body: its constants, how it lies, its errors, its thermal kicks."""

from flocsim.state.records import Record


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


class Disc(Record):
    """A body in the sweep for pairs that come near each other: its circle, and its way."""

    x: float  # where it begins [m]
    y: float
    way_x: float  # the way that it goes [m]
    way_y: float
    reach: float  # its radius [m]
    moves: float  # 1 where it moves, 0 where it is fixed: no two fixed ones are near
    left: float  # its left end, inside the box [m]
    right: float  # and its right end [m]


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
