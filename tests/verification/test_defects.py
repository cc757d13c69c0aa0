"""Scenes that a model with jumps in it gets wrong: energy from nowhere, gaps that change suddenly,
forces without a value at one place, bodies that count as gone too early."""

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon, System
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.study import Study
from flocsim.forces import Contact, DoubleLayer, Gravity, StokesDrag
from flocsim.integrators import DormandPrince54, Implicit, Status
from flocsim.io.results.schema import BONDS, OUTCOMES
from tests.helpers.tiers import rest_slow

STUDY = """\
preset = "{}"
seed = 77
replicates = 2000
[shapes]
vertices = [8, 16, 32, 64]
"""
TYPE_I, TYPE_II, TYPE_III = range(3)


@cache
def flocs(preset):
    """The flocs of the study, grown once."""
    return tuple(Study(config_of(preset)).flocs)


def config_of(preset, **over):
    """The study's Config with nested overrides."""
    path = Path(mkdtemp()) / "study.toml"
    path.write_text(STUDY.format(preset))
    return load_config(path, over)


def replicate(number, place, vertices, delta, preset="tang2014", **over):
    """(outcome's word, row) of a replicate of the study; ``over`` replaces keys of its config."""
    study = Study(config_of(preset, **over), flocs=list(flocs(preset)))
    row = study.run(place, vertices, delta, number)
    return OUTCOMES[row["outcome"]], row


@pytest.mark.slow
def test_a_hanging_doublet_comes_to_rest():
    """A displacement handed to a contact point far off would create energy, for ever."""
    outcome, row = replicate(1256, TYPE_I, 8, 0.477)
    assert outcome == "A"
    assert row["steps"] < 500


@pytest.mark.slow
def test_a_floc_in_the_cavity_of_another_comes_to_rest():
    """Its centre lies at the other's, where the line between them has no direction."""
    outcome, row = replicate(766, TYPE_II, 8, 0.133)
    assert outcome in "AC"
    assert row["bond"] != 0 and BONDS[row["bond"] - 1] != "hook"
    assert row["steps"] < 1000


def test_to_pass_an_arm_is_not_to_have_departed():
    """It drifts on to a lower arm."""
    outcome, row = replicate(1640, TYPE_I, 8, 0.883)
    assert outcome in "ABCD" and np.isfinite(row["t_collision"])


def test_a_floc_of_a_stable_colloid_is_decided():
    layer = {"double_layer": {"debye_length": 30e-9, "potential": 0.03}}
    outcome, row = replicate(3, TYPE_III, 32, 0.043, "si", forces=layer)
    assert outcome in "ABCD" or outcome == "missed"
    assert row["steps"] < 20_000


def test_a_box_that_hovers_over_a_floor_comes_to_rest():
    """Repulsion holds it up; as it rocks, the closest corner changes from one to the other."""
    floor = SpheroPolygon([(-2e-4, 0), (2e-4, 0)], 1e-6)
    box = SpheroPolygon([(-1e-5, -5e-6), (1e-5, -5e-6), (1e-5, 5e-6), (-1e-5, 5e-6)], 1e-6)
    layer = DoubleLayer(0.2, 0.98e-6, gap="surface")
    bodies = [
        Body(floor, fixed=True, surface_density=2.0),
        Body(box, (0.0, 1e-5), 0.02, density=2650.0),
    ]
    run = System(bodies, [Gravity(), StokesDrag(), layer], Implicit()).run(0.5, max_steps=2000)
    assert run.status is Status.FINISHED
    # Level, still, and where the repulsion of its lower edge carries its weight.
    weight = 9.81 * bodies[1].mass
    floor_radius, box_radius = (each.shape.equivalent_radius for each in bodies)
    reduced = floor_radius * box_radius / (floor_radius + box_radius)
    gap = layer.debye_length * np.log(layer.strength * reduced / weight)
    _, y, angle = run.position[-1, 1]
    assert np.abs(run.velocity[-1, 1, :2]).max() < 1e-9
    assert angle == pytest.approx(0.0, abs=1e-4)
    assert y - 7e-6 == pytest.approx(gap, abs=0.03 * layer.debye_length)


def sliding_box(tolerance):
    """The run of a box that slides on a floor with friction 0.3 until it stops."""
    floor = SpheroPolygon([(-2e-4, 0), (2e-4, 0)], 1e-6)
    box = SpheroPolygon([(-1e-5, -1e-6), (1e-5, -1e-6), (1e-5, 1e-6), (-1e-5, 1e-6)], 1e-6)
    rest = 3e-6 - 2 * box.area * 9.81 / 40
    bodies = [
        Body(floor, fixed=True, surface_density=2.0),
        Body(box, (0.0, rest), velocity=(1e-2, 0.0), surface_density=2.0),
    ]
    contact = Contact(k_t=10.0, friction=0.3)
    return System(bodies, [Gravity(), contact], Implicit(tolerance)).run(0.01)


def test_friction_converges_with_the_tolerance():
    """It stops where v²/2µg says, but for what the springs give."""
    way, given = 1e-4 / (2 * 0.3 * 9.81), 1e-10
    runs = [sliding_box(tolerance) for tolerance in (1e-8, 1e-10, 1e-12)]
    ends = [run.position[-1, 1, 0] for run in runs]
    assert ends[-1] == pytest.approx(way, abs=given)
    assert [abs(end - ends[-1]) <= run.error for end, run in zip(ends, runs, strict=True)][:2] == [
        True, True,
    ]  # fmt: skip
    assert np.abs(runs[-1].velocity[-1, 1]).max() < 1e-9


def test_a_contact_that_sticks_and_slides_is_decided():
    """No step shrinks to nothing where friction is just as large as it can be."""
    contact = {"contact": {"friction": 0.3}}
    outcome, row = replicate(70, TYPE_III, 32, 0.062, forces=contact)
    assert outcome in "ABCD"
    assert row["steps"] + row["rejected"] < 10_000


def test_the_stated_error_covers_a_lift_off():
    """A doublet rolls apart while its contact opens and closes by less than an atom."""
    rows = [
        replicate(51, TYPE_III, 32, 0.654, integrator={"tolerance": tolerance})[1]
        for tolerance in (1e-8, 1e-9, 1e-12)
    ]
    times = [row["t_end"] for row in rows]
    drift = 1.2e-3
    for row, time in zip(rows[:2], times[:2], strict=True):
        assert drift * abs(time - times[-1]) <= row["error"]


@pytest.mark.parametrize(
    "method", rest_slow([Implicit, DormandPrince54], lambda each: each is Implicit)
)
def test_the_stated_error_covers_a_flight_without_drag(method):
    """What a bounce does to a velocity goes on for ten seconds."""
    floor = SpheroPolygon([(-2e-4, 0), (2e-4, 0)], 1e-6)
    bodies = [
        Body(floor, fixed=True, surface_density=2.0),
        Body(Sphere(5e-6), (0.0, 7e-6), velocity=(0.0, -1e-2), surface_density=2.0),
    ]
    contact_time = np.pi / np.sqrt(20 / bodies[1].mass)
    run = System(bodies, [Contact(damping_n=0.0)], method()).run(1e-4 + contact_time + 10.0)
    error = abs(run.position[-1, 1, 1] - 6e-6 - 0.1)
    assert 0.0 < error <= run.error < 1e4 * error


@pytest.mark.parametrize(("delta", "number"), [(0.0, 25), (0.25, 33), (0.5, 59)])
def test_a_doublet_of_stiff_contacts_parts_though_it_hangs_on_little(delta, number):
    """It hangs on overlaps of 2.4e-14 m between two contacts that each lose their displacement
    where they part: a touch noticed deeper than it gets would wedge them for good."""
    path = Path(mkdtemp()) / "study.toml"
    path.write_text(
        'preset = "tang2014"\nseed = 12\n'
        '[scene]\ntypes = ["I", "II", "III"]\ndelta = [0.0, 0.25, 0.5, 0.75, 1.0]\n'
        '[shapes]\nsource = "library"\nfile = "synthetic"\nvertices = [16]\n'
        "[forces.contact]\nk_n = 2000.0\nk_t = 200.0\n"
    )
    row = Study(load_config(path)).run(TYPE_III, 16, delta, number)
    assert OUTCOMES[row["outcome"]] == "B"
