"""When two bodies have parted for good: not while the drift may still bring them together."""

import math

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim import Sphere, SpheroPolygon
from flocsim.ensembles.collision import observed as numbers
from flocsim.ensembles.collision.departure import CLEARANCE, can_meet_again, left_over, turn_left
from flocsim.ensembles.collision.draw import Draw
from flocsim.ensembles.collision.encounter import make_encounter
from flocsim.ensembles.collision.outcomes import DEPARTED, MISSED, outline_gap, watch_pair
from flocsim.ensembles.collision.start import draws, orientations
from flocsim.geometry.contact.candidates import list_candidates
from flocsim.geometry.contact.points import locate_contacts
from flocsim.integrators.base import Status
from flocsim.io.results.schema import OUTCOMES
from tests.helpers.small_study import small_config, small_study

UPPER, LOWER = 15e-6, -45e-6
ARM = 20e-6
"""Heights of the two arms of the receiver, and how far the lower one reaches to the right [m]."""


def receiver():
    """A post with a short arm above and a long one below, which a body on its way down passes."""
    outline = np.array([
        (-4e-6, LOWER - 2e-6), (ARM, LOWER - 2e-6), (ARM, LOWER), (0.0, LOWER),
        (0.0, UPPER), (8e-6, UPPER), (8e-6, UPPER + 2e-6), (-4e-6, UPPER + 2e-6),
    ])  # fmt: skip
    return SpheroPolygon(outline, 1e-6), outline


class Falling:
    """A body that settles past a receiver that is held, seen by the observer uncompiled."""

    def __init__(self, folder, body):
        """The body; nothing attracts."""
        shape, outline = receiver()
        none = {"van_der_waals": {"hamaker": 0.0}, "double_layer": {"potential": 0.0}}
        config = small_config(folder, {"scene": {"receiver": "fixed"}, "forces": none})
        self.body = body
        self.encounter = make_encounter(config, [shape, body], 1e-9)
        self.scene = self.encounter.system.scene(jit=False)
        self.work = self.encounter.start((0.0, 0.0), 0.0)
        self.observed = self.encounter.observed()
        # Places are told as in the outline above, whose centroid is not at its origin.
        self.origin = shape.vertices[0] - outline[0]

    @property
    def escape(self):
        return self.observed[numbers.ESCAPE]

    @property
    def fall(self):
        """The speed of settling [m/s]."""
        return math.hypot(*self.encounter.drift)

    def seen(self, x, y, vx=0.0, vy=0.0, spin=0.0, collided=True):
        """What the observer says with the body there, at so much more than its settling speed."""
        motion = self.work.motion[at.NOW]
        motion[0, :] = 0.0
        motion[1, :3] = *(np.array([x, y]) + self.origin), 0.0
        motion[1, 3:] = vx, vy - self.fall, spin
        self.work.budget[:] = -1.0
        assert list_candidates(self.scene, self.work)
        locate_contacts(self.scene, self.work, at.NOW)
        self.observed[numbers.COLLIDED] = float(collided)
        return watch_pair(self.scene, self.work, self.observed, 0.0)


@pytest.fixture
def ball(tmp_path):
    """A sphere of 5 µm."""
    return Falling(tmp_path, Sphere(5e-6))


@pytest.mark.parametrize(("collided", "gone"), [(True, DEPARTED), (False, MISSED)])
def test_a_body_that_drifts_on_to_a_lower_arm_has_not_gone(ball, collided, gone):
    """It is far from what it has touched, and moves away from the centre, all the way down."""
    for y in np.linspace(-16e-6, -34e-6, 7):
        assert ball.seen(12e-6, y, collided=collided) == 0
        assert outline_gap(ball.scene, ball.work) > ball.escape
    # Further right it passes the tip, as far as the drift goes by its outline.
    past = ARM + 1e-6 + 5e-6
    assert ball.seen(past - 0.1e-6, -25e-6, collided=collided) == 0
    assert ball.seen(past + 0.9 * CLEARANCE * ball.escape, -25e-6, collided=collided) == 0
    assert ball.seen(past + 1.1 * CLEARANCE * ball.escape, -25e-6, collided=collided) == gone


def test_past_the_last_arm_it_has(ball):
    below = LOWER - 2e-6 - 6e-6
    assert ball.seen(12e-6, below - 0.9 * ball.escape) == 0
    assert ball.seen(12e-6, below - 1.1 * ball.escape) == DEPARTED
    # Above all of it, on its way down, it has everything to come.
    assert ball.seen(12e-6, UPPER + 3e-6 + 30e-6) == 0


def test_beside_a_receiver_it_has_gone_where_it_cannot_come_back(ball):
    assert ball.seen(60e-6, -20e-6) == DEPARTED
    assert ball.seen(-40e-6, -20e-6) == DEPARTED
    # It falls through the middle of the two arms: level with the centre it does not part yet.
    assert ball.seen(60e-6, 60e-6) == 0


@pytest.mark.parametrize("way", [(-1.0, 0.0), (0.0, -1.0), (0.6, -0.8)])
def test_a_present_velocity_may_carry_it_until_drag_has_used_it_up(ball, way):
    """By m v/(drag) at most, in any direction."""
    body = ball.encounter.system.bodies[1]
    decay = body.mass * ball.observed[numbers.MOBILITY_J]
    room = 1.5e-6
    x = ARM + 1e-6 + 5e-6 + CLEARANCE * ball.escape + room
    for share, expected in ((0.0, DEPARTED), (0.95, DEPARTED), (1.05, 0)):
        vx, vy = share * room / decay * np.array(way)
        assert ball.seen(x, -25e-6, vx, vy) == expected
        assert left_over(ball.scene, ball.work, ball.observed) == pytest.approx(
            share * room, abs=1e-12
        )


def test_a_spin_may_turn_an_arm_of_its_own_into_the_way(tmp_path):
    rod = SpheroPolygon([(-1e-6, -12e-6), (1e-6, -12e-6), (1e-6, 12e-6), (-1e-6, 12e-6)], 1e-6)
    falling = Falling(tmp_path, rod)
    body = falling.encounter.system.bodies[1]
    room = 3e-6
    x = ARM + 1e-6 + 2e-6 + CLEARANCE * falling.escape + room
    assert falling.seen(x, -25e-6) == DEPARTED
    # I ω/(8πη r²) is what drag leaves of a spin; the ends of the rod move by that times R.
    turn = body.inertia / (8.0 * math.pi * 8.9e-4 * rod.equivalent_radius**3)
    for share, expected in ((0.9, DEPARTED), (1.1, 0)):
        spin = share * room / (rod.bounding_radius * turn)
        assert falling.seen(x, -25e-6, spin=spin) == expected
        left = turn_left(falling.scene, falling.work, 0.0, 1, 1e-3)
        assert left == pytest.approx(share * room, rel=1e-6)


def test_the_way_along_the_drift_is_looked_at_without_gaps(ball):
    """Whether they can meet again does not hang on where on its way the body is asked."""
    for x in np.linspace(-12e-6, 36e-6, 25):
        answers = set()
        for y in np.linspace(-14e-6, -36e-6, 12):
            ball.seen(x, y)
            if outline_gap(ball.scene, ball.work) > ball.escape:
                known = ball.scene, ball.work, ball.observed
                answers.add(can_meet_again(*known, 0.0))
        assert len(answers) <= 1


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    """The small study by an implicit and an explicit method."""
    scene = {"types": ["I"], "delta": [0.9, 0.98, 1.02]}
    return {
        name: small_study(
            tmp_path_factory.mktemp(name), {"scene": scene, "integrator": {"name": name}}
        )
        for name in ("implicit", "dormand_prince54")
    }


def test_a_miss_is_one_for_every_method(studies):
    words = [
        [OUTCOMES[study.run(0, n, share, k)["outcome"]]
         for n in (4, 16) for share in (0.9, 0.98, 1.02) for k in range(8)]
        for study in studies.values()
    ]  # fmt: skip
    assert words[0] == words[1]
    assert 0 < words[0].count("missed") < len(words[0])


def test_a_pause_between_steps_changes_nothing(studies):
    study, missed = studies["implicit"], 0
    for replicate in range(8):
        row = study.run(0, 16, 1.02, replicate)
        drawn = draws(study.config.seed, replicate)
        encounter = study.encounter(0, 16, drawn)
        run = Draw(encounter, orientations(drawn), 1.02).begin(study.driver(encounter), 10**6)
        status = Status.PAUSED
        while status is Status.PAUSED:
            status = run.advance(1)
        assert (run.time, run.steps) == (row["t_end"], row["steps"])
        assert (run.code == MISSED) == (OUTCOMES[row["outcome"]] == "missed")
        missed += run.code == MISSED
    assert missed
