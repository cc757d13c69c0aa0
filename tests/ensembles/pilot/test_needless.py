"""Which parts of the physics changed no outcome: said, tried fairly, and never acted on."""

from functools import partial

import attrs
import pytest

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.config.schema import IntegratorConfig
from flocsim.ensembles.pilot import forecast
from flocsim.ensembles.pilot.forecast import (
    ENOUGH,
    INERTIA,
    LEAST,
    Finding,
    Part,
    Timed,
    finding_words,
    findings,
    in_turn,
    parts_of,
    stokes_number,
    time_replicates,
    tried_without,
    without_force,
)
from flocsim.ensembles.pilot.trials import Task, Trial
from flocsim.ensembles.study import Study
from flocsim.integrators import Implicit, Overdamped
from tests.helpers.small_study import small_study

SPHERES = {"shapes": {"vertices": [1]}, "replicates": 40, "scene": {"types": ["III"]}}


def never():
    """Nothing asks for an end."""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Spheres whose repulsion is too weak to matter, in a zone that does not hang on it."""
    weak = {"double_layer": {"potential": 1e-6}}
    over = SPHERES | {"forces": weak, "zone": {"distance": 5e-6}}
    made = small_study(tmp_path_factory.mktemp("study"), over)
    made.run(0, 1, 0.0, 0)  # some test has to find an encounter, whichever runs first
    return made


@pytest.fixture(scope="module")
def runs(study):
    return time_replicates(study, in_turn(study.config), never, seconds=0.0)


def test_what_cannot_be_left_out_says_why_and_what_is_weak_never_matters(study, runs, monkeypatch):
    monkeypatch.setattr(forecast, "LARGEST_STOKES", 0.0)  # another engine to compile
    before = dict(study.zones), study.config.forces
    found = {each.name: each for each in findings(study, runs, never, seconds=0.0)}
    assert list(found) == [*study.config.force_names, INERTIA]
    for name in ("gravity", "drag"):
        assert "would not meet" in found[name].why
    assert "needs a contact force" in found["contact"].why
    assert found["double_layer"][1:3] == (0, LEAST)
    assert found["double_layer"].time > 0.0
    assert (dict(study.zones), study.config.forces) == before


def test_attraction_that_holds_spheres_matters(study, runs):
    place = study.config.force_names.index("van_der_waals")
    part = Part("van_der_waals", partial(without_force, study.config.forces[place]))
    found = tried_without(study, runs * 3, part, never, seconds=100.0)
    # Spheres that no force holds roll off each other: a few are enough to know.
    assert found[1:3] == (ENOUGH, ENOUGH)


def test_outcomes_are_held_against_those_of_the_pilot(study, runs):
    other = [run._replace(first=run.first._replace(inside=1 - run.first.inside)) for run in runs]
    found = tried_without(study, other, Part("nothing", lambda system: system), never, 0.0)
    assert found[1:3] == (LEAST, LEAST)


def test_a_force_is_left_out_by_itself_where_bodies_meet_without_their_weight(tmp_path):
    """Without gravity all places of forces are others in the scene than in the config."""
    shear = SPHERES | {"scene": {"types": ["III"], "meeting": "shear", "rate": "100 1/s"}}
    study = small_study(tmp_path, shear | {"zone": {"distance": 5e-6}})
    system = study.encounter(0, 1, [0.0] * 5).system
    overdamped = attrs.evolve(study.config, integrator=IntegratorConfig(name="overdamped"))
    parts = [each for each in parts_of(overdamped) if isinstance(each, Part)]
    assert [each.name for each in parts] == ["van_der_waals", "double_layer"]
    for part, name in zip(parts, ("VanDerWaals", "DoubleLayer"), strict=True):
        left = [type(force).__name__ for force in part.left_out(system).forces]
        assert sorted([*left, name]) == sorted(type(force).__name__ for force in system.forces)


def test_a_force_that_is_absent_is_not_tried(tmp_path):
    over = SPHERES | {"forces": {"van_der_waals": {"hamaker": 0.0}}, "zone": {"distance": 5e-6}}
    config = small_study(tmp_path, over).config
    assert "van_der_waals" not in [part.name for part in parts_of(config)]


def test_inertia_is_tried_where_bodies_forget_their_speed(tmp_path, study):
    parts = {part.name: part for part in parts_of(study.config)}
    assert stokes_number(study.config) < 1.0
    system = next(iter(study.encounters.values())).system
    bare = parts[INERTIA].left_out(attrs.evolve(system, integrator=Implicit(1e-7)))
    assert bare.integrator == Overdamped(1e-7)
    overdamped = attrs.evolve(study.config, integrator=IntegratorConfig(name="overdamped"))
    assert INERTIA not in [part.name for part in parts_of(overdamped)]


def test_inertia_is_not_tried_where_it_must_matter(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text('preset = "tang2014"\n[scene]\ntypes = ["I"]\n', "utf-8")
    [finding] = [part for part in parts_of(load_config(path)) if part.name == INERTIA]
    assert "Stokes number of 3.8" in finding.why


@pytest.mark.slow
def test_light_solids_do_without_inertia(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        'preset = "si"\nreplicates = 20\n[scene]\ntypes = ["III"]\ndelta = [0.0]\n'
        "[shapes]\nvertices = [1]\n", "utf-8",
    )  # fmt: skip
    study = Study(load_config(path))
    runs = time_replicates(study, in_turn(study.config), never)
    found = {each.name: each for each in findings(study, runs, never)}
    assert found[INERTIA][1:3] == (0, 20)


TASK = Task(0, 1, 0.0, 0)


def again(count, flips):
    """Replicates that were run again, of which some flipped, and as many that were not."""
    once = Timed(TASK, Trial(0, 1))
    return [once._replace(second=Trial(int(k < flips), 1)) for k in range(count)] + [once] * count


@pytest.mark.parametrize(
    ("finding", "flips", "words"),
    [
        (Finding("a", 0, 200, 0.9), 9, "a: never changed an outcome of 200 replicates (rate below "
         "1.9 %); leaving it out would save 10 % of the time"),
        (Finding("a", 0, 200, 1.2), 0, "would save none of the time"),
        (Finding(INERTIA, 0, 200, 0.5), 0, "replicates (Overdamped agrees) (rate below"),
        (Finding("a", 8, 20, 0.9), 0, "a: matters, without it 8 of 20 outcomes change"),
        (Finding("a", 2, 200, 0.9), 1, "a: 2 of 200 outcomes change, which may be numerical "
         "error (1 of 100 change when run again more accurately); leaving it out would save 10 %"),
        (Finding("a", why="it must"), 0, "a: stays, it must"),
    ],
)  # fmt: skip
def test_findings_in_words(finding, flips, words):
    assert words in finding_words(finding, again(100, flips))


def test_without_second_runs_what_changes_an_outcome_matters():
    assert "matters" in finding_words(Finding("a", 1, 200, 0.9), again(0, 0))


def test_a_signal_ends_it(study, runs):
    def stop():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        findings(study, runs, stop)
    assert all(isinstance(run, Timed) for run in runs)
