"""What a pilot chooses, from replicates whose flips and costs are made up and known."""

import hashlib
import json

import attrs
import pytest

from flocsim.ensembles.pilot.choice import (
    ALLOWED,
    choose,
    final_methods,
    first_methods,
    recorded_choice,
)
from flocsim.ensembles.pilot.ladder import (
    RUNGS,
    WEIGHTS,
    Trial,
    falls,
    sampling_half_width,
    scene_length,
)
from flocsim.ensembles.storage.identity import differences, identity_of
from flocsim.ensembles.study import Study
from flocsim.errors import UsageError
from flocsim.integrators import DormandPrince54, Implicit
from flocsim.io.results.run_group import choice_lines, stored
from tests.helpers.small_study import small_config

AUTO = {"integrator": {"accuracy": "auto"}, "shapes": {"vertices": [1]}}
TYPES = ("I", "III")


def auto_study(tmp_path, replicates=2000, **over):
    """The small study of spheres as a pilot has it, before its choice."""
    scene = {"delta": [0.0, 0.25, 0.5, 0.75, 1.0]}
    config = small_config(tmp_path, AUTO | {"replicates": replicates, "scene": scene} | over)
    return Study(config, methods=first_methods(config))


def chance(task):
    """A number in [0, 1) that belongs to a replicate."""
    return int(hashlib.blake2b(repr(task).encode(), digest_size=6).hexdigest(), 16) / 2**48


@attrs.define
class MadeUp:
    """A Share: of type t ``rates[t]`` times a power of the rung flip; ``jobs`` are noted.

    ``explicit``: cost of an explicit run over that of an implicit one; ``time`` [s] of all;
    ``dear``: rungs above it cost twenty times as much.
    """

    rates: tuple = (0.02, 0.02)
    explicit: float = 10.0
    time: float = 1e-6
    dear: float = 1.0
    jobs: list = attrs.Factory(list)

    def __call__(self, study, jobs):
        self.jobs += jobs
        return [self.trial(study, *job) for job in jobs]

    def trial(self, study, task, method, max_steps):
        """One made-up Trial: a replicate flips at all rungs from its own on."""
        rung = method.tolerance / scene_length(study.config, task.condition)
        flips = chance(task) < self.rates[task.condition] * float(falls(rung)[10])
        own = self.explicit if isinstance(method, DormandPrince54) else 1.0
        if rung > 2.0 * self.dear:
            own *= 20.0
        return Trial(int(flips), 0, own * 500.0 * rung**-0.13, self.time)


def rungs_of(study, choice):
    """Tolerance over the scene's length of every type."""
    return [
        choice.methods[name].tolerance / scene_length(study.config, place)
        for place, name in enumerate(TYPES)
    ]


def test_what_is_chosen_is_the_loosest_that_is_expected_to_do(tmp_path):
    study = auto_study(tmp_path)
    choice = choose(study, MadeUp())
    target = ALLOWED * sampling_half_width(2000)
    assert choice.record["target"] == target
    for rung, each in zip(rungs_of(study, choice), choice.record["types"], strict=True):
        assert any(rung == pytest.approx(known) for known in RUNGS)
        assert 0.5 * target < each["expected"] < each["bound"] <= target
        # The truth, which the pilot does not know.
        assert 0.02 * falls(rung)[10] < 1.2 * target


def test_a_type_that_flips_more_gets_a_tighter_tolerance(tmp_path):
    study = auto_study(tmp_path)
    calm, wild = rungs_of(study, choose(study, MadeUp((0.002, 0.05))))
    assert wild < 0.1 * calm


def test_more_replicates_want_a_tighter_tolerance(tmp_path):
    found = [
        rungs_of(study, choose(study, MadeUp()))[0]
        for study in (auto_study(tmp_path, replicates) for replicates in (300, 30_000))
    ]
    assert found[1] < 0.1 * found[0]


def test_where_coarse_steps_are_dear_finer_ones_are_taken(tmp_path):
    study = auto_study(tmp_path, 300)
    usual, dear = (choose(study, MadeUp((1e-4, 1e-4), dear=d)) for d in (1.0, 1e-3))
    assert min(rungs_of(study, usual)) > 0.09
    assert rungs_of(study, dear) == pytest.approx([1e-3, 1e-3])


def test_where_the_ladder_ends_it_is_said(tmp_path):
    study = auto_study(tmp_path, 10**6)
    choice = choose(study, MadeUp((0.5, 0.5)))
    assert rungs_of(study, choice) == pytest.approx([RUNGS[-1]] * 2)
    assert all("the tightest setting" in line for line in choice_lines(choice.record)[:2])


def test_a_study_that_is_too_small_runs_no_pilot(tmp_path):
    share = MadeUp()
    choice = choose(auto_study(tmp_path, 50), share)
    assert share.jobs == []
    assert "no pilot: too few" in choice_lines(choice.record)[0]
    assert all(isinstance(method, Implicit) for method in choice.methods.values())


def test_the_pilot_costs_no_more_than_its_share(tmp_path):
    study = auto_study(tmp_path, 1000)
    choice = choose(study, MadeUp())
    spent = {name: 500.0 * rung**-0.13
             for name, rung in zip(TYPES, rungs_of(study, choice), strict=True)}  # fmt: skip
    assert choice.record["cost"] <= 0.1 * sum(5000 * cost for cost in spent.values())


def test_explicit_steps_are_taken_where_they_are_cheaper_in_a_long_study(tmp_path):
    made = MadeUp((0.0005, 0.0005), explicit=0.3)
    long, short = (choose(auto_study(tmp_path, n), made) for n in (200_000, 2000))
    assert {type(each) for each in long.methods.values()} == {DormandPrince54}
    assert {tried["method"] for tried in long.record["types"][0]["tried"]} == {
        "implicit", "dormand_prince54",
    }  # fmt: skip
    assert {type(each) for each in short.methods.values()} == {Implicit}


def test_explicit_steps_that_a_few_replicates_show_to_be_dear_are_left(tmp_path):
    made = MadeUp((0.0005, 0.0005), explicit=0.9)
    choice = choose(auto_study(tmp_path, 200_000), made)
    probed = [job for job in made.jobs if isinstance(job.integrator, DormandPrince54)]
    assert len(probed) == 20
    assert {type(each) for each in choice.methods.values()} == {Implicit}


def test_explicit_steps_that_cannot_be_stable_are_not_even_compiled(tmp_path):
    made = MadeUp((0.0005, 0.0005), explicit=0.3, time=1e-2)
    choose(auto_study(tmp_path, 200_000), made)
    assert {type(job.integrator) for job in made.jobs} == {Implicit}


def test_a_record_is_good_json_and_good_for_this_study_alone(tmp_path):
    study = auto_study(tmp_path)
    choice = choose(study, MadeUp())
    text = json.dumps(choice.record)
    record = stored({"accuracy": text}, "accuracy")
    assert recorded_choice(study, [{}, record]) == choice
    assert recorded_choice(auto_study(tmp_path, 2001), [record]) is None
    assert recorded_choice(auto_study(tmp_path, seed=2), [record]) is None
    wrong = json.loads(text)
    wrong["types"][0]["method"] = "magic"
    assert recorded_choice(study, [wrong]) is None
    wrong["types"][0] |= {"method": "implicit", "tolerance": -1.0}
    assert recorded_choice(study, [wrong, record]) == choice


def test_the_identity_has_the_choice(tmp_path):
    config = auto_study(tmp_path).config
    coarse, fine = (
        identity_of(Study(config, methods={"I": Implicit(tolerance), "III": Implicit(1e-9)}))
        for tolerance in (1e-7, 1e-8)
    )
    [line] = differences(coarse, fine)
    assert line.startswith('types.I.integrator is "Implicit(tolerance=1e-07')
    mixed = Study(config, methods={"I": DormandPrince54(1e-7), "III": Implicit(1e-9)})
    assert mixed.kinds == [(0, 1), (1, 1)]
    found = identity_of(mixed)
    assert "kernels.spheres by DormandPrince54" in found
    assert "kernels.spheres by Implicit" in found


def test_a_study_without_the_choice_is_refused(tmp_path):
    with pytest.raises(UsageError, match="needs the choice of a pilot"):
        Study(auto_study(tmp_path).config)


def test_a_config_with_a_method_of_its_own_needs_no_pilot(tmp_path):
    config = small_config(tmp_path)
    assert final_methods(config) == {"I": Implicit(1e-9), "III": Implicit(1e-9)}


def test_every_method_that_may_be_chosen_has_a_weight(tmp_path):
    assert set(WEIGHTS) == {Implicit, DormandPrince54}
