"""Records of one body: constants, pose, errors, cluster sums and thermal kicks."""

from flocsim.state.records import Record


class BodyConstants(Record):
    """Constants of a body in a run; its resistance as in BodyView."""

    mass: float  # [kg]
    buoyant_mass: float  # mass that gravity acts on, less buoyancy [kg]
    inertia: float  # about the centroid [kg m²]
    free: float  # 1 for a body that moves, 0 for a fixed one [-]
    equivalent_radius: float  # of the disc of the same area [m]
    bounding_radius: float  # largest distance of the outline from the centroid [m]
    radius: float  # spheroradius [m]
    elongation: float  # (M₁ − M₂)/(M₁ + M₂) of the principal second moments of area [-]
    long_axis: float  # angle of the long axis in the frame of the shape [rad]
    identity: float  # key of the body's random numbers
    resistance_xx: float  # R over the viscosity, 0 if no drag depends on the shape [m]
    resistance_xy: float  # [m]
    resistance_yy: float  # [m]
    resistance_xs: float  # [m²]
    resistance_ys: float  # [m²]
    resistance_ss: float  # [m³]
    strain_xx_x: float  # Γ: force by a strain rate over the viscosity [m²]
    strain_xx_y: float  # [m²]
    strain_xx_s: float  # [m³]
    strain_xy_x: float  # [m²]
    strain_xy_y: float  # [m²]
    strain_xy_s: float  # [m³]
    shielding_xx: float  # Q of a body in a cluster of a swarm; 1, 0, 1 alone [-]
    shielding_xy: float
    shielding_yy: float


RESISTANCE_COLUMNS = 12
"""Numbers of a body's resistance: six of R, six of Γ."""


UNSHIELDED = (1.0, 0.0, 1.0)


# Axes of positions and angles, velocities and spins, forces and torques.
(
    X,  # [m]
    Y,  # [m]
    ANGLE,  # counter-clockwise [rad]
) = range(3)


# Columns of motions (n, 6) outside a run, after those of positions.
(
    VX,  # [m/s]
    VY,  # [m/s]
    SPIN,  # [rad/s]
    MOTION_COLUMNS,
) = range(3, 7)


# First columns of a recorded row.
(
    RECORD_TIME,  # [s]
    RECORD_MOTION,  # from here on, six numbers per body
) = range(2)


MOST_FRAMES = 3
"""Stages of an implicit step for which a body has a frame."""


class Frame(Record):
    """Corotational frame of a body at a stage of an implicit step (radau/contact_frames.py)."""

    rotation_cosine: float  # of the rotation of the contact normals since the start of the step
    rotation_sine: float
    shift_x: float  # s, displacement of the contact point in the rotated frame [m]
    shift_y: float  # [m]


class Pose(Record):
    """Orientation of a body, and its position when pairs were last listed."""

    listed_x: float  # position at the last listing [m]
    listed_y: float  # [m]
    listed_angle: float  # [rad]
    cosine: float  # of its angle in the state located last
    sine: float
    known_angle: float  # nearby angle whose cosine and sine are stored [rad]
    known_cosine: float
    known_sine: float


class Disc(Record):
    """Circle of a body in the sweep for pairs that come near each other, with its displacement."""

    x: float  # centre at the start [m]
    y: float
    way_x: float  # its displacement [m]
    way_y: float
    reach: float  # its radius with a margin [m]
    moves: float  # 1 if it moves, 0 if fixed: two fixed ones are never a pair
    left: float  # its left end, along all of the displacement, within the box [m]
    right: float  # its right end [m]


class BodyErrors(Record):
    """Errors of a body's outline, accumulated over a run: see loop.stated_error."""

    velocity_lifetime: float  # time for which a velocity error goes on displacing it [s]
    relaxation_time: float  # of its slowest velocity component under drag [s]
    step_displacement: float  # estimated error of the last step [m]
    step_velocity: float  # [m/s]
    displacement: float  # accumulated from the errors of all steps [m]
    velocity: float  # [m/s]
    switch_displacement: float  # accumulated from errors of switching times [m]
    switch_velocity: float  # [m/s]
    uncertain_displacement: float  # accumulated from contacts that may have opened [m]
    uncertain_velocity: float  # [m/s]
    stated: float  # stated error of the body [m]


class Cluster(Record):
    """Sums over a cluster of bodies that act on each other, stored with its first body."""

    mass: float  # [kg]
    shift_x: float  # Σ mass · velocity by which contact frames shift [kg m/s]
    shift_y: float  # [kg m/s]
    force_x: float  # Σ force [N]
    force_y: float  # [N]
    rate_x: float  # Σ mass · acceleration of the stage [N]
    rate_y: float  # [N]
    scale: float  # factor that keeps the propagated error within its bound [-]
    largest_displacement: float  # bound of a displacement error in it [m]


class Kick(Record):
    """Mean white noise of a body in the present thermal kick."""

    x: float  # [1/√s]
    y: float  # [1/√s]
    turn: float  # [1/√s]


class KickTime(Record):
    """The present thermal kick, in units of the shortest kick."""

    start: float  # beginning of the kick, from time zero
    duration: float  # its length; 0: none has begun
