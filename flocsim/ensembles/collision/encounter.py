"""The binary collision scene: one replicate from its random numbers to its outcome."""

import math

import attrs
import numpy as np

from flocsim import hooks as slots
from flocsim.arrays import (
    CODE,
    ERROR,
    NOW,
    PAUSE_AT,
    RECORDED,
    REJECTED,
    STEPS,
    TIME,
    UNTIL,
    with_capacity,
    work_of,
)
from flocsim.body import Body
from flocsim.ensembles.collision import outcomes
from flocsim.ensembles.collision.failures import collided, outcome_of
from flocsim.ensembles.collision.settling import terminal_motion, turn_time
from flocsim.ensembles.collision.start import largest_displacement, place_pair
from flocsim.ensembles.config.methods import make_integrator
from flocsim.errors import UsageError
from flocsim.integrators.base import Status
from flocsim.io.results.schema import NOT_APPLICABLE
from flocsim.system import System

OBSERVER = {slots.awaits_touch: outcomes.has_not_touched, slots.observe: outcomes.watch_pair}
"""What a binary collision puts into the driver's slots."""

REST_TURNS = 3.0
"""Automatic rest time, in turn times (r_i + r_j)/|relative drift|."""

STEPS_AT_A_TIME = 5_000
"""Steps between two looks at whether to stop: some 50 ms."""

LIMIT_TURNS = 1000.0
"""Automatic time limit, in turn times."""


@attrs.frozen(eq=False)
class Encounter:
    """Two shapes that meet: everything about them but orientation and displacement.

    Made once for each pair of shapes and used for all replicates that draw it.
    """

    system: System
    options: object
    zone_distance: float
    scene: object = attrs.field(init=False)
    settling: tuple = attrs.field(init=False)

    def __attrs_post_init__(self):
        object.__setattr__(self, "scene", self.system.scene())
        motions = [terminal_motion(self.system, body) for body in self.system.bodies]
        object.__setattr__(self, "settling", tuple(motions))
        if not math.hypot(*self.drift) > 0.0:
            raise UsageError(
                "the two bodies settle at the same speed and never meet: give scene.pairs two "
                "different radii, set scene.receiver = 'fixed', or add a missing [forces.gravity]"
            )

    @property
    def shapes(self):
        """Shapes of i and j."""
        return tuple(body.shape for body in self.system.bodies)

    @property
    def drift(self):
        """Settling velocity of j relative to i (2,) [m/s]."""
        return self.settling[1][0] - self.settling[0][0]

    @property
    def turn_time(self):
        """(r_i + r_j)/|drift| [s]."""
        radii = [shape.equivalent_radius for shape in self.shapes]
        return turn_time(*radii, self.drift)

    def observed(self):
        """Fresh numbers for the observer: what it is given, and room for what it finds."""
        options = self.options
        observed = np.zeros(outcomes.OBSERVED_SIZE)
        escape = options.start_gap if options.escape_gap == "start_gap" else options.escape_gap
        rest = REST_TURNS * self.turn_time if options.rest_time == "auto" else options.rest_time
        observed[outcomes.ZONE] = self.zone_distance
        observed[outcomes.ESCAPE] = escape
        observed[outcomes.REST_TIME] = rest
        observed[outcomes.DRIFT_X : outcomes.DRIFT_Y + 1] = self.drift
        observed[outcomes.MOBILITY_I] = self.settling[0][1]
        observed[outcomes.MOBILITY_J] = self.settling[1][1]
        return observed

    def time_limit(self):
        """Simulated time [s] after which a replicate is undecided."""
        if self.options.time_limit == "auto":
            approach = self.options.start_gap / math.hypot(*self.drift)
            return approach + LIMIT_TURNS * self.turn_time
        return self.options.time_limit

    def start(self, angles, share):
        """Work arrays of a replicate with these angles [rad] at δ = share · δ_max."""
        shapes = self.shapes
        largest = largest_displacement(
            self.options.delta_max, shapes[0], angles[0], shapes[1], angles[1]
        )
        place = place_pair(shapes, angles, share * largest, self.options.start_gap)
        velocity = np.zeros((2, 3))
        velocity[0, :2], velocity[1, :2] = self.settling[0][0], self.settling[1][0]
        return work_of(self.scene, place, velocity)


def make_encounter(config, shapes, zone):
    """The Encounter of two shapes under a config."""
    bodies = [
        Body(shape, fixed=(config.scene.receiver == "fixed" and place == 0), **config.body_options)
        for place, shape in enumerate(shapes)
    ]
    system = System(bodies, config.forces, make_integrator(config), fluid=config.fluid)
    return Encounter(system, config.scene, zone)


def run_encounter(encounter, driver, angles, share, max_steps, record=None, halted=None):
    """Run one replicate; the row of the table of replicates as a dict.

    ``driver`` is the compiled driver of the encounter's scene; ``record`` (k, 13), optional,
    receives the motion; where it is full, recording ends. ``halted()``, optional, is asked every
    some thousand steps whether to give up; the row is None then.
    """
    work = encounter.start(angles, share)
    observed = encounter.observed()
    integrator = encounter.system.integrator
    clock, counts = integrator.fresh_clock(), integrator.fresh_counts(max_steps)
    clock[UNTIL] = encounter.time_limit()
    rows = np.zeros((0, 13)) if record is None else record.begin(work)
    while True:
        # A pause comes between two steps, so that it changes nothing.
        counts[PAUSE_AT] = counts[STEPS] + STEPS_AT_A_TIME
        status = Status(driver(encounter.scene, work, observed, clock, counts, rows))
        if record is not None:
            record.take(counts)
        if status == Status.NO_ROOM:
            work = with_capacity(work, 2 * len(work.candidates))
        elif status == Status.PAUSED:
            if halted is not None and halted():
                return None
        elif status != Status.RECORD_FULL:
            return replicate_row(status, angles, observed, clock, counts)


def replicate_row(status, angles, observed, clock, counts):
    """What the table of replicates holds of a run that has ended."""
    outcome, failure = outcome_of(status, counts[CODE], observed)
    touched = collided(observed)
    return {
        "angle_i": angles[0],
        "angle_j": angles[1],
        "outcome": outcome,
        "inside": int(observed[outcomes.INSIDE]) if touched else NOT_APPLICABLE,
        "crossed_zone": int(observed[outcomes.CROSSED]) if touched else NOT_APPLICABLE,
        "d_c_collision": observed[outcomes.D_COLLISION] if touched else np.nan,
        "d_c_max": observed[outcomes.D_MAX] if touched else np.nan,
        "d_c_last": observed[outcomes.D_LAST],
        "t_collision": observed[outcomes.T_COLLISION] if touched else np.nan,
        "t_end": clock[TIME],
        "steps": counts[STEPS],
        "rejected": counts[REJECTED],
        "error": clock[ERROR],
        "failure": failure,
    }


class Record:
    """The recorded motion of one replicate, of any length."""

    def __init__(self, rows=4096):
        """Room for ``rows`` rows between two copies."""
        self.buffer = np.zeros((rows, 13))
        self.saved = []

    def begin(self, work):
        """Record the state at the start; the array that the driver is to fill."""
        self.saved = [np.concatenate([[0.0], work.motion[NOW].ravel()])[None]]
        return self.buffer

    def take(self, counts):
        """Copy what the driver has recorded, and let it start anew."""
        self.saved.append(self.buffer[: counts[RECORDED]].copy())
        counts[RECORDED] = 0

    def arrays(self):
        """Times (k,), places (k, 2, 3) and velocities (k, 2, 3)."""
        rows = np.concatenate(self.saved)
        motion = rows[:, 1:].reshape(-1, 2, 6)
        return rows[:, 0], motion[:, :, :3], motion[:, :, 3:]
