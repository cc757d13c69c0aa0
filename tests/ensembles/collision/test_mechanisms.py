"""How bodies meet in flows: where they start, how they turn, what is far and what may be caught."""

import math
from functools import partial

import attrs
import numpy as np
import pytest

from flocsim.body import Body, Fluid
from flocsim.ensembles.collision.attraction import GAPS, attraction_width, far_gap, speeds_of
from flocsim.ensembles.collision.draw import Draw
from flocsim.ensembles.collision.mechanisms import Extension, Shear
from flocsim.ensembles.collision.turning import angles_by_turning, turning_rates
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.study import Study
from flocsim.errors import UsageError
from flocsim.forces import BodyForce, Gravity, StokesDrag, VanDerWaals
from flocsim.forces.drag import body_resistance, resistance_matrices
from flocsim.geometry.shapes.shape import Sphere
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon
from flocsim.io.results.schema import OUTCOMES
from flocsim.system import System
from tests.helpers.kernel_study import kernel_config

FLOWS = ("shear", "extension")


@pytest.mark.parametrize("flow", [Shear, Extension])
@pytest.mark.parametrize("offset", [-1.3e-5, -1e-9, 2e-6, 1.9e-5])
def test_a_start_is_far_away_and_its_path_passes_at_the_offset(flow, offset):
    x, y = flow.upstream(offset, 6e-5)
    assert math.hypot(x, y) == pytest.approx(6e-5, rel=1e-12, abs=0.0)
    xx, xy, yx, yy = flow.gradient
    assert x * (xx * x + xy * y) + y * (yx * x + yy * y) < 0.0, "it comes nearer"
    if flow is Shear:
        assert y == offset
    else:
        # On x y = c the least distance is √(2|c|).
        assert math.copysign(math.sqrt(abs(2.0 * x * y)), x * y) == pytest.approx(offset, rel=1e-6)


@pytest.mark.parametrize("flow", [Shear, Extension])
def test_flows_carry_no_volume_and_stretch_at_their_strain(flow):
    xx, xy, yx, yy = flow.gradient
    assert xx + yy == 0.0
    strain = np.linalg.eigvalsh([[xx, 0.5 * (xy + yx)], [0.5 * (xy + yx), yy]])
    assert strain[-1] == pytest.approx(flow.strain)


def sheared(folder, sizes="10um-10um", **words):
    """A study of rates in shear, and the Encounter of two of its spheres."""
    config = kernel_config(folder, meeting='["settling", "shear"]', scene='rate = "2 1/s"', **words)
    study = Study(config)
    return study, study.encounter(config.scene.names.index(f"shear:{sizes}"), 1, np.zeros(5))


def test_weight_is_left_out_of_flows_alone(tmp_path):
    study, moving = sheared(tmp_path)
    falling = study.encounter(0, 1, np.zeros(5))
    for encounter, gradient in ((moving, (0.0, 2.0, 0.0, 0.0)), (falling, (0.0,) * 4)):
        weighs = any(isinstance(force, Gravity) for force in encounter.system.forces)
        assert weighs == (encounter is falling)
        assert encounter.system.fluid.gradient == gradient


def test_far_is_where_the_forces_move_less_than_the_share():
    force, radii, mobility = VanDerWaals(hamaker=1e-18), (1e-5, 2e-5), 1e7
    speeds = speeds_of((force, StokesDrag()), Fluid(), radii, mobility)
    gap = far_gap(speeds, 1e-4, 1e-3, sum(radii))
    # H r*/(6 d²) µ = 1e-3 w
    exact = math.sqrt(1e-18 * (1e-5 * 2e-5 / 3e-5) * mobility / (6.0 * 1e-7))
    assert exact <= gap <= 1.1 * exact
    assert far_gap(speeds, 1e3, 1e-3, 3e-5) == pytest.approx(0.01 * 3e-5)


def test_nothing_is_caught_from_afar_without_attraction():
    speeds = speeds_of((StokesDrag(),), Fluid(), (1e-5, 2e-5), 1e7)
    assert attraction_width(speeds, 1e-4, 1e-4) == 0.0


@pytest.mark.parametrize("ratio", [1e-2, 1e-4, 1e-6, 1e-8])
def test_the_width_for_attraction_covers_what_it_catches(ratio):
    # Overdamped spheres are caught up to R + 1.88 R ratio^0.4 and less, ratio = k/(w R²).
    size, speed = 3e-5, 1e-4
    strength = ratio * speed * size * size
    speeds = np.stack([strength / GAPS**2] * 2) * np.array([[1.0], [-1.0]])
    width = attraction_width(speeds, speed, 2.0 * size)
    caught = 1.88 * ratio**0.4 * size
    assert caught < width < 6.0 * caught


def test_spheres_turn_evenly_and_start_at_any_angle():
    fluid = Fluid(gradient=(0.0, 8.0, 0.0, 0.0))
    body = Body(Sphere(1e-5), surface_density=2.0)
    system = System([body], [StokesDrag()], fluid=fluid)
    rates = turning_rates(system, body)
    assert rates == pytest.approx(np.full(len(rates), -4.0))
    angle = angles_by_turning(rates)
    assert [angle(u) for u in (0.0, 0.25, 0.5)] == pytest.approx([0.0, 0.5 * np.pi, np.pi])


@attrs.frozen
class Straining(BodyForce):
    """A torque that turns a body as a slender one in shear: 2 µ G (b cos 2θ) on top of the drag."""

    strength: float = 0.0

    @staticmethod
    def kernel(body, viscosity, flow, strength):
        """No force, a torque by the angle."""
        turning = 8.0 * math.pi * viscosity * body.radius**3
        return 0.0, 0.0, 0.5 * strength * turning * flow[3] * math.cos(2.0 * body.angle)


def turning_of(strength, gradient=(0.0, 8.0, 0.0, 0.0)):
    body = Body(Sphere(1e-5), surface_density=2.0)
    forces = [StokesDrag(), Straining(strength)]
    return turning_rates(System([body], forces, fluid=Fluid(gradient=gradient)), body)


def test_a_force_with_a_turning_law_of_its_own_has_its_say():
    # Jeffery: θ' = −G/2 (1 − B cos 2θ), in which the time spent at θ is ∝ 1/|θ'|.
    rates = turning_of(0.8)
    theta = 2.0 * np.pi * np.arange(len(rates)) / len(rates)
    assert rates == pytest.approx(-4.0 * (1.0 - 0.8 * np.cos(2.0 * theta)), rel=1e-9)
    angle = angles_by_turning(rates)
    found = np.array([angle(u) for u in (np.arange(20000) + 0.5) / 20000])
    # The mean of cos 2θ under that density is (1 − √(1 − B²))/B.
    assert np.mean(np.cos(2.0 * found)) == pytest.approx((1.0 - 0.6) / 0.8, abs=1e-4)


def test_bodies_that_come_to_lie_still_have_the_angle_at_which_they_do():
    rates = turning_of(1.25)  # θ' = 0 where cos 2θ = 0.8; stable where θ' falls
    angle = angles_by_turning(rates)
    found = {round(angle(u), 3) for u in np.linspace(0.0, 0.999, 200)}
    stable = 0.5 * math.acos(0.8)
    slope = -4.0 * 2.0 * 1.25 * math.sin(2.0 * stable)
    rest = stable if slope < 0.0 else -stable
    expected = np.sort(np.mod([rest, rest + math.pi], 2.0 * math.pi))
    assert sorted(found) == pytest.approx(expected, abs=2e-3)


def test_the_turn_of_a_doublet_of_equal_spheres_is_known(tmp_path):
    _, encounter = sheared(tmp_path)
    assert encounter.full_turn == pytest.approx(2.0 * 6.9542 / 2.0, rel=1e-4)


@attrs.frozen
class Pull(BodyForce):
    """A pull as of a weight."""

    @staticmethod
    def kernel(body, viscosity, flow):
        return 0.0, -1e-12 * (body.radius / 1e-5) ** 3, 0.0


def test_bodies_that_drift_by_themselves_are_refused_in_flows(tmp_path):
    _, encounter = sheared(tmp_path, "10um-20um")
    system = attrs.evolve(encounter.system, forces=(*encounter.system.forces, Pull()))
    with pytest.raises(UsageError, match=r"other forces \(.*Pull\) move them"):
        attrs.evolve(encounter, system=system)


@pytest.mark.parametrize("meeting", FLOWS)
def test_spheres_without_forces_touch_where_their_ways_meet(tmp_path, meeting):
    config = kernel_config(
        tmp_path, meeting=f'"{meeting}"', scene='rate = "10 1/s"',
        more="[forces]\nvan_der_waals = false\ndouble_layer = false",
    )  # fmt: skip
    study = Study(config)
    place = config.scene.names.index(f"{meeting}:10um-20um")
    encounter = study.encounter(place, 1, np.zeros(5))
    shares = {0.9: True, -0.99: True, 1.01: False, -1.2: False}
    draws = [partial(Draw, encounter, (0.0, 0.0), share) for share in shares]
    rows, _ = study.batches.run(draws, 100_000, config.integrator.method)
    for (share, touches), row in zip(shares.items(), rows, strict=True):
        assert OUTCOMES[row["outcome"]] in ("ABCD" if touches else ("missed",)), share


def test_pairs_of_one_size_meet_in_a_binary_study_in_shear(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        'preset = "si"\n[scene]\nmeeting = "shear"\nrate = "10 1/s"\ndelta = [0.5]\n'
        'pairs = [["10 um", "10 um"]]\n[shapes]\nvertices = [1]\n',
        "utf-8",
    )
    config = load_config(path)
    row = Study(config).run(0, 1, 0.5, 0)
    assert OUTCOMES[row["outcome"]] in "AC"


def test_shapes_turn_as_their_resistance_says_and_may_be_pried_harder():
    corners = 1e-6 * np.array([(0, 0), (8, 0), (8, 1), (1, 1), (1, 5), (0, 5)], dtype=float)
    body = Body(SpheroPolygon(corners, 2e-7), surface_density=2.0)
    fluid = Fluid(gradient=(1.0, 8.0, 2.0, -1.0))
    system = System([body], [StokesDrag(law="shape")], fluid=fluid)
    rates = turning_rates(system, body)
    resistance, strain = resistance_matrices(body_resistance(body))
    by_strain = np.linalg.solve(resistance, strain)[2]
    twice = 2.0 * (2.0 * np.pi * np.arange(len(rates)) / len(rates))
    e_xx, e_xy = np.cos(twice) + 5.0 * np.sin(twice), 5.0 * np.cos(twice) - np.sin(twice)
    wanted = -3.0 + by_strain[0] * e_xx + by_strain[1] * e_xy
    assert rates == pytest.approx(wanted, rel=1e-6, abs=1e-6)
