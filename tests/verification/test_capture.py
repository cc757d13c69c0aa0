"""Capture of spheres and shapes against published and computed numbers.

R = r_i + r_j, k = H_A/(36πµ), w the speed of settling against each other, G and s rates of flows.
"""

import math

import numpy as np
import pytest

from flocsim.body import Body, Fluid
from flocsim.ensembles.collision.draw import Draw
from flocsim.ensembles.config.loader import load_any_config
from flocsim.ensembles.kind import study_of
from flocsim.ensembles.runner import run
from flocsim.forces import Contact, StokesDrag, VanDerWaals
from flocsim.geometry.shapes.shape import Sphere
from flocsim.hydrodynamics import Meeting, SpherePair
from flocsim.integrators import Overdamped
from flocsim.io.results.schema import OUTCOMES
from flocsim.system import System
from tests.helpers.kernel_study import kernel_config

RADII = (1e-5, 2e-5)
SIZE = sum(RADII)
VISCOSITY, RATE = 8.9e-4, 10.0
FAR = 39.0
"""Start gap over R: the centres begin 40 R apart."""

OVERDAMPED = """
preset = "si"
replicates = 16
[scene]
kind = "kernel"
meeting = "{meeting}"
{rate}
sizes = ["10 um", "20 um"]
start_gap = {gap}
[shapes]
vertices = [1]
[forces]
double_layer = false
[forces.van_der_waals]
hamaker = {hamaker!r}
d_min = {d_min!r}
[integrator]
name = "overdamped"
tolerance = {tolerance}
{more}
"""

STIFF_IN_WATER = """[forces.contact]
k_n = 2e4
k_t = 2e3
[forces.hydrodynamics]
h_min = {!r}
"""


def settling_speed():
    """Of the two against each other: 2/9 Δρ g (r_j² − r_i²)/µ."""
    return 2.0 / 9.0 * (2650.0 - 997.0) * 9.81 * (RADII[1] ** 2 - RADII[0] ** 2) / VISCOSITY


def capture_offset(folder, meeting, ratio, d_min, water=False):
    """b_c/R, to some 1e-6, of overdamped spheres that attract each other by van der Waals alone; to
    1e-4 with the ``water`` between them.

    ``ratio``: k/(w R²), or k/(G R³); ``d_min`` over R: the force reaches 3e4 times as far.
    """
    unit = settling_speed() * SIZE**2 if meeting == "settling" else RATE * SIZE**3
    rate = "" if meeting == "settling" else f"rate = {RATE}"
    path = folder / "capture.toml"
    path.write_text(
        OVERDAMPED.format(
            meeting=meeting, rate=rate, gap="'auto'" if water else FAR * SIZE, d_min=d_min * SIZE,
            hamaker=ratio * unit * 36.0 * math.pi * VISCOSITY, tolerance=1e-10 if water else 1e-11,
            more=STIFF_IN_WATER.format(d_min * SIZE) if water else "",
        ),
        "utf-8",
    )  # fmt: skip
    study = study_of(load_any_config(path))
    place = study.config.scene.names.index(f"{meeting}:10um-20um")
    encounter = study.encounter(place, 1, study.numbers(0))
    method = study.config.integrator.method

    def is_caught(offset):
        draw = Draw(encounter, (0.0, 0.0), offset)
        [row], _ = study.batches.run([lambda: draw], 200_000, method)
        assert OUTCOMES[row["outcome"]] in ("A", "C", "missed")
        return OUTCOMES[row["outcome"]] != "missed"

    low, high = (0.05, 1.0) if water else (1.0, 1.0 + encounter.reach / SIZE)
    assert is_caught(low), "spheres whose ways touch"
    assert not is_caught(high), "the sampled offsets reach far enough"
    while high - low > (1e-4 if water else 1e-6):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_caught(middle) else (low, middle)
    return low


@pytest.mark.slow
def test_settling_spheres_are_caught_as_far_as_computed(tmp_path):
    found = capture_offset(tmp_path, "settling", 1e-2, 4e-3)
    assert found == pytest.approx(1.30769, abs=2e-5)


@pytest.mark.slow
def test_weak_attraction_catches_by_the_two_fifths_law(tmp_path):
    # b_c = R + 1.87716 k^(2/5) R^(1/5) w^(−2/5) as k → 0.
    ratios = np.array([1e-4, 1e-5, 1e-6, 1e-7])
    factors = np.array(
        [
            (capture_offset(tmp_path, "settling", each, 1e-4) - 1.0) / each**0.4
            for each in ratios.tolist()
        ]
    )
    off = factors - 1.87716
    assert np.all(off[1:] < off[:-1]), "nearer and nearer"
    assert off[-1] == pytest.approx(0.0, abs=3e-3)
    # The next term is of the order of the excess itself.
    assert np.all(np.abs(off) < 0.4 * ratios**0.4)


@pytest.mark.slow
@pytest.mark.parametrize(("ratio", "expected", "d_min"), [(1e-2, 1.28559, 4e-3),
                                                          (1e-4, 1.04678, 1e-3)])  # fmt: skip
def test_spheres_in_shear_are_caught_as_far_as_computed(tmp_path, ratio, expected, d_min):
    assert capture_offset(tmp_path, "shear", ratio, d_min) == pytest.approx(expected, abs=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("ratio", "expected"), [(1e-2, 0.6288), (1e-4, 0.2537), (1e-6, 0.1400)])
def test_settling_spheres_in_water_are_caught_as_far_as_computed(tmp_path, ratio, expected):
    found = capture_offset(tmp_path, "settling", ratio, 1e-4, water=True)
    assert found == pytest.approx(expected, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("meeting", ["shear", "extension"])
@pytest.mark.parametrize("ratio", [1e-3, 1e-5])
def test_spheres_in_a_flow_of_water_are_caught_as_far_as_by_their_ways(tmp_path, meeting, ratio):
    hamaker = ratio * RATE * SIZE**3 * 36.0 * math.pi * VISCOSITY
    reduced, touch = RADII[0] * RADII[1] / SIZE, 1e-4 * SIZE

    def force(gap):
        return -hamaker * reduced / (6.0 * np.maximum(gap, touch) ** 2)

    spheres = Meeting(SpherePair(RADII, VISCOSITY), force, touch)
    low, high = spheres.widths(meeting, RATE, np.array([0.0]))
    assert low[0] == 0.0
    # There x y = ½ R first, and the offset of an extension is √(2 x y).
    expected = high[0] if meeting == "shear" else math.sqrt(high[0])
    found = capture_offset(tmp_path, meeting, ratio, 1e-4, water=True)
    assert found == pytest.approx(expected, rel=0.01)


@pytest.mark.slow
def test_a_doublet_of_equal_spheres_turns_half_in_its_known_time():
    radius, rate = 1e-5, 10.0
    bodies = [
        Body(Sphere(radius), position=(x, 0.0), density=2650.0)
        for x in (-radius, radius)
    ]  # fmt: skip
    forces = [
        StokesDrag(), VanDerWaals(hamaker=1e-20, gap="surface"), Contact(k_n=20.0, k_t=2.0),
    ]  # fmt: skip
    fluid = Fluid(gradient=(0.0, rate, 0.0, 0.0))
    system = System(bodies, forces, Overdamped(tolerance=1e-11), fluid=fluid)
    halves = 4
    found = system.run(until=halves * 6.9542 / rate)
    x, y = (found.position[:, 1, :2] - found.position[:, 0, :2]).T
    turned = np.unwrap(np.arctan2(y, x))
    assert found.status.name == "FINISHED"
    # At the end it lies along the flow again, where it turns slowest: G (1 − B)/2, B = 3/7.
    late = (turned[-1] + halves * math.pi) / (0.5 * rate * (1.0 - 3.0 / 7.0))
    assert abs(late) < halves * 2e-4 / rate


BARE = "[forces]\nvan_der_waals = false\ndouble_layer = false"


@pytest.mark.slow
def test_spheres_under_the_papers_parameters_touch_within_2_r_and_stick(tmp_path):
    config = kernel_config(
        tmp_path, preset="tang2014", replicates=512, scrambles=8, sizes='["5 um", "16 um", "23 um"]'
    )
    arrays = run(config).kernel.arrays
    for i, j in ((0, 1), (0, 2), (1, 2)):
        exact = 2.0 * (config.scene.sizes[i] + config.scene.sizes[j])
        low, high = (arrays[f"width_c{end}"][0, 0, i, j] for end in ("_low", "_high"))
        assert low <= exact <= high
        assert high - low < 0.05 * exact
        assert arrays["alpha"][0, 0, i, j] == 1.0


@pytest.mark.parametrize(("meeting", "factor"), [("extension", 2.0), ("shear", 1.0)])
def test_without_attraction_the_influx_is_exact(tmp_path, meeting, factor):
    config = kernel_config(
        tmp_path, meeting=f'"{meeting}"', scene='rate = "10 1/s"', replicates=64, more=BARE
    )
    arrays = run(config).kernel.arrays
    exact = factor * 10.0 * SIZE**2
    assert arrays["beta2_reference"][0, 0, 0, 1] == pytest.approx(exact, rel=1e-9, abs=0.0)
    assert arrays["beta2_c"][0, 0, 0, 1] == pytest.approx(exact, rel=1e-12, abs=0.0)
