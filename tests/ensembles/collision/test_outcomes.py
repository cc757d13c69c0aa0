"""What is decided stays decided, and what cannot be decided says so."""

import math

import attrs
import numpy as np
import pytest

from flocsim import Sphere, SpheroPolygon
from flocsim.bonds.certificate import NO_BOND, REST
from flocsim.ensembles.collision import outcomes
from flocsim.ensembles.collision.draw import FAILURES, Draw, draws, orientations
from flocsim.ensembles.collision.mechanisms import make_encounter
from flocsim.ensembles.collision.outcomes import (
    BOUND,
    CLEARANCE,
    DEPARTED,
    MISSED,
    can_meet_again,
    left_over,
    turn_left,
    watch_pair,
)
from flocsim.ensembles.study import Study
from flocsim.errors import UsageError
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.geometry.contact.near_pairs import gap_between
from flocsim.geometry.contact.points import least_listed_gap, locate_contacts
from flocsim.integrators.base import Status
from flocsim.io.results.schema import NOT_APPLICABLE, OUTCOMES
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.work import NOW, work_of
from tests.helpers.small_study import small_config, small_study
from tests.helpers.tabulate import tabulate
from tests.helpers.tiers import rest_slow


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The small study with all three types, and a displacement between the others."""
    scene = {"types": ["I", "II", "III"], "delta": [0.0, 0.25, 0.5, 1.0, 1.5]}
    return small_study(tmp_path_factory.mktemp("study"), {"scene": scene, "replicates": 10})


def outcome(row):
    """The outcome's word."""
    return OUTCOMES[row["outcome"]]


def test_spheres_always_aggregate_inside(study):
    for condition in range(3):
        for share in (0.0, 0.25, 0.5, 1.0):
            assert outcome(study.run(condition, 1, share, 0)) == "A"


@attrs.frozen(eq=False)
class Continued:
    """A replicate that was run on: the first decision and its time, the widest gap of listed pairs
    from then on, the gap of the outlines at the end, and how the run ended."""

    decision: int
    decided_at: float
    widest: float
    last: float
    status: Status


def go_on(study, condition, vertices, share, replicate, factor=11.0):
    """(the row as decided, the replicate run on for ``factor`` times as long)."""
    row = study.run(condition, vertices, share, replicate)
    numbers = draws(study.config.seed, replicate)
    encounter = study.encounter(condition, vertices, numbers)
    motion = encounter.motion(orientations(numbers), share)
    work = work_of(encounter.scene, *motion, capacity=512)
    observed = encounter.given.copy()
    integrator, driver = encounter.system.integrator, study.driver(encounter)
    clock, counts = integrator.fresh_clock(), integrator.fresh_counts(10**6)
    clock.until = factor * row["t_end"]
    decisions, widest, status = [], -math.inf, Status.STOPPED
    while status == Status.STOPPED:
        # The observer stops the run behind every step once it has decided.
        status = Status(driver(encounter.scene, work, observed, clock, counts, np.zeros((0, 13))))
        if status == Status.STOPPED:
            decisions.append((int(counts.code), float(clock.time)))
            widest = max(widest, least_listed_gap(work))
    last = gap_between(encounter.scene, work, 1, 0)
    return row, Continued(*decisions[0], widest, last, status)


def escape_gap(study):
    """The escape gap [m]."""
    return study.config.scene.start_gap


@pytest.mark.parametrize("vertices", rest_slow([1, 4, 16], lambda vertices: vertices != 16))
@pytest.mark.parametrize("condition", [0, 2], ids=["type I", "type III"])
def test_no_decision_is_overturned_in_ten_times_the_time(study, condition, vertices):
    decisions = set()
    for replicate in range(2 if vertices == 1 else 6):
        for share in (0.0, 0.5):
            row, on = go_on(study, condition, vertices, share, replicate)
            decisions.add(outcome(row))
            assert on.status == Status.FINISHED
            # Decisions fall at the ends of steps, and a later end of the run changes the steps.
            assert on.decided_at < 3.0 * row["t_end"]
            if row["outcome"] in (0, 2):
                assert on.decision == BOUND
                assert on.widest <= 0.0
            elif row["outcome"] in (1, 3):
                assert on.decision == DEPARTED
                # A turning floc may brush against the other once more as it goes.
                assert on.last > escape_gap(study)
    assert decisions & {"A", "B", "C", "D"}


def test_beyond_the_largest_displacement_all_miss(study):
    for condition in range(3):
        for vertices in (1, 4, 16):
            row = study.run(condition, vertices, 1.5, 1)
            assert outcome(row) == "missed"
            assert row["inside"] == row["crossed_zone"] == NOT_APPLICABLE
            assert np.isnan([row["d_c_collision"], row["d_c_max"], row["t_collision"]]).all()
            assert np.isfinite([row["d_c_last"], row["t_end"]]).all()


def test_what_is_written_down_of_a_collision_agrees_with_itself(study):
    for condition in range(3):
        zone = study.encounter(condition, 16, draws(study.config.seed, 0)).zone_distance
        for replicate in range(8):
            row = study.run(condition, 16, 0.25, replicate)
            assert row["inside"] == (row["d_c_collision"] < zone)
            assert outcome(row) in ("AB" if row["inside"] else "CD")
            assert row["d_c_max"] >= max(row["d_c_collision"], row["d_c_last"])
            assert 0.0 < row["t_collision"] <= row["t_end"]
            if (row["d_c_last"] < zone) != row["inside"]:
                assert row["crossed_zone"] == 1


def test_the_zone_decides_the_class_but_not_the_motion(study, tmp_path):
    near = small_study(tmp_path, {"zone": {"centre": "1 um"}})
    far = small_study(tmp_path, {"zone": {"centre": "1 mm"}})
    for replicate in range(3):
        outside, inside = near.run(0, 16, 0.0, replicate), far.run(0, 16, 0.0, replicate)
        assert (outside["inside"], inside["inside"]) == (0, 1)
        assert {"C": "A", "D": "B"}[outcome(outside)] == outcome(inside)
        assert (outside["t_end"], outside["steps"]) == (inside["t_end"], inside["steps"])


def test_the_step_budget_ends_a_replicate_undecided(tmp_path):
    row = small_study(tmp_path, {"integrator": {"max_steps": 5}}).run(0, 16, 0.0, 0)
    assert (outcome(row), FAILURES[row["failure"]]) == ("undecided", "step budget")
    # Steps tried to end at a touch count, too.
    assert 1 <= row["steps"] + row["rejected"] <= 5


def test_the_time_limit_ends_a_replicate_undecided(tmp_path):
    row = small_study(tmp_path, {"scene": {"time_limit": 2e-4}}).run(0, 16, 0.0, 0)
    assert (outcome(row), FAILURES[row["failure"]]) == ("undecided", "time limit")
    assert row["t_end"] == pytest.approx(2e-4)
    # Where it touched is known all the same.
    assert row["inside"] in (0, 1)


def test_contacts_too_soft_for_the_weight_fail(tmp_path):
    soft = {"forces": {"contact": {"k_n": 1e-9, "k_t": 1e-10}}}
    row = small_study(tmp_path, soft).run(0, 4, 0.0, 0)
    assert (outcome(row), FAILURES[row["failure"]]) == ("failed", "too deep")


def test_bodies_that_settle_alike_never_meet(tmp_path):
    study = small_study(tmp_path, {"scene": {"pairs": [["10 um", "10 um"]]}})
    with pytest.raises(UsageError, match="settle at the same speed and never meet") as caught:
        study.run(0, 1, 0.0, 0)
    assert "\n" not in str(caught.value)


def test_bodies_of_one_size_meet_where_the_lower_one_is_held(tmp_path):
    scene = {"pairs": [["10 um", "10 um"]], "receiver": "fixed"}
    study = small_study(tmp_path, {"scene": scene})
    assert outcome(study.run(0, 1, 0.0, 0)) == "A"
    encounter = study.encounter(0, 1, draws(1, 0))
    assert encounter.settling[0][1] == 0.0


def test_a_pair_apart_and_parting_has_departed(study):
    # The observer by itself, uncompiled: two spheres, the heavier one below and drifting on.
    encounter = study.encounter(0, 1, draws(1, 0))
    work = work_of(encounter.scene, *encounter.motion((0.0, 0.0), 0.0))
    observed = encounter.given.copy()
    contact = sum(shape.radius for shape in encounter.shapes)

    def seen(gap, collided):
        work.place[NOW, 1, :2] = 0.0, -(contact + gap)
        observed[outcomes.COLLIDED] = collided
        return watch_pair(scene, work, observed, 0.0)

    scene = encounter.system.scene(jit=False)
    escape = observed[outcomes.ESCAPE]
    assert (seen(0.99 * escape, 0.0), seen(1.01 * escape, 0.0)) == (0, outcomes.MISSED)
    assert (seen(0.99 * escape, 1.0), seen(1.01 * escape, 1.0)) == (0, DEPARTED)
    work.velocity[NOW, 1, Y] = 0.0
    assert seen(1.01 * escape, 1.0) == 0


def test_a_doublet_that_swings_as_a_rigid_body_does_not_rest(study):
    # It is at rest within itself as it swings through its lowest point; what it will do at the
    # turning point, where the load is another, is not known yet.
    encounter = study.encounter(0, 1, draws(1, 0))
    work = work_of(encounter.scene, *encounter.motion((0.0, 0.0), 0.0))
    observed = encounter.given.copy()
    spin, reach = 300.0, sum(shape.radius for shape in encounter.shapes) - 1e-12
    work.place[NOW] = work.velocity[NOW] = 0.0
    work.velocity[NOW, :, ANGLE] = spin
    work.place[NOW, 1, Y] = -reach
    work.velocity[NOW, 1, X] = spin * reach
    scene = encounter.system.scene(jit=False)
    assert rebuild_list(scene, work)
    locate_contacts(scene, work, NOW)
    observed[outcomes.LOAD] = 1.0  # more than any attraction
    known, later = (scene, work, observed), 2.0 * observed[outcomes.REST_TIME]
    outcomes.start_rest(scene, work, observed, 0.0)
    assert outcomes.bond_of(*known, later) == NO_BOND
    # Without the swing it does.
    work.velocity[NOW] = 0.0
    assert outcomes.bond_of(*known, later) == REST


@pytest.mark.slow
def test_a_step_through_a_body_ends_at_the_first_touch(tmp_path):
    """Long steps of free fall end beyond several features at once, of which the one that is found
    first is not the one that was touched first."""
    shapes = {"vertices": [8], "pool": 10}
    study = Study(small_config(tmp_path, {"seed": 77, "replicates": 2000, "shapes": shapes}))
    for share, replicate in ((0.158, 152), (0.07, 307), (0.752, 422)):
        row = study.run(0, 8, share, replicate)
        assert OUTCOMES[row["outcome"]] in "ABCD", FAILURES[row["failure"]]


def test_a_pair_on_the_verge_of_touching_does_not_hold_steps_back(tmp_path):
    """One of its contacts opens and closes step after step, far below the tolerance."""
    words = {"preset": "si", "seed": 5, "replicates": 1000, "scene": {"types": ["III"]}}
    words |= {"shapes": {"vertices": [16], "pool": 10}, "integrator": {"tolerance": 1e-7}}
    row = Study(small_config(tmp_path, words)).run(0, 16, 0.0, 35)
    assert OUTCOMES[row["outcome"]] == "C"
    assert row["steps"] < 1000


@pytest.mark.parametrize(("distance", "ending"), [("30 nm", "held"), ("0.3 nm", "A")])
def test_a_barrier_holds_two_spheres_apart(tmp_path, distance, ending):
    """Head on, stable quartz comes to rest in the secondary minimum; without its barrier it
    touches."""
    layer = {"double_layer": {"debye_length": distance, "potential": "30 mV"}}
    config = small_config(tmp_path, {"preset": "si", "forces": layer})
    found = Study(config)
    row = found.run(1, 1, 0.0, 0)
    assert outcome(row) == ending
    touched = ending == "A"
    assert (row["inside"] == NOT_APPLICABLE) != touched
    table = tabulate([[row["outcome"]]], [[row["inside"]]], [[row["bond"]]])
    assert (table["n_held"][0], table["n_missed"][0]) == (int(not touched), 0)


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
        self.work = work_of(self.encounter.scene, *self.encounter.motion((0.0, 0.0), 0.0))
        self.observed = self.encounter.given.copy()
        # Places are told as in the outline above, whose centroid is not at its origin.
        self.origin = shape.vertices[0] - outline[0]

    @property
    def escape(self):
        return self.observed[outcomes.ESCAPE]

    @property
    def fall(self):
        """The speed of settling [m/s]."""
        return math.hypot(*self.encounter.drift)

    def seen(self, x, y, vx=0.0, vy=0.0, spin=0.0, collided=True):
        """What the observer says with the body there, at so much more than its settling speed."""
        place, velocity = self.work.place[NOW], self.work.velocity[NOW]
        place[0] = velocity[0] = 0.0
        place[1] = *(np.array([x, y]) + self.origin), 0.0
        velocity[1] = vx, vy - self.fall, spin
        self.work.budget[:] = -1.0
        assert rebuild_list(self.scene, self.work)
        locate_contacts(self.scene, self.work, NOW)
        self.observed[outcomes.COLLIDED] = float(collided)
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
        assert gap_between(ball.scene, ball.work, 1, 0) > ball.escape
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
    decay = body.mass * ball.observed[outcomes.MOBILITY_J]
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
            if gap_between(ball.scene, ball.work, 1, 0) > ball.escape:
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


@pytest.mark.slow
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
