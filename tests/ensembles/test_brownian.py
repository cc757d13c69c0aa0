"""Studies of brownian meetings, end to end: what is refused, counted, resumed and reported."""

import json
import math

import numpy as np
import pytest

from flocsim.__main__ import main
from flocsim.body import Fluid
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.diagnose.preflight import check_study
from flocsim.ensembles.diagnose.spheres import sphere_facts
from flocsim.ensembles.study import Study
from flocsim.errors import ConfigError
from flocsim.forces import Thermal
from flocsim.io.confidence import wilson
from flocsim.io.results.file import read_results
from flocsim.io.results.run_group import sphere_words
from flocsim.io.results.schema import NOT_APPLICABLE, OUTCOMES
from tests.helpers.results_files import same_data

STUDY = """\
preset = "tang2014"
seed = 2
replicates = {replicates}
[scene]
meeting = "brownian"
pairs = [["0.5 um", "0.5 um"]]
{scene}
[shapes]
{shapes}
[bodies]
density = 1050
[fluid]
viscosity = "0.89 mPa s"
[forces]
double_layer = false
[forces.van_der_waals]
hamaker = "1e-20 J"
cut = "2 nm"
{forces}
[zone]
distance = "10 nm"
[integrator]
name = "overdamped"
max_steps = 1000000
"""
"""Spheres that stick as soon as they touch: a well of 200 k_B T that is 2 nm wide."""

THERMAL = '[forces.thermal]\nkick = "{kick:.9g} s"'
DIFFUSION = Thermal().diffusion(Fluid(viscosity=0.89e-3), 0.5e-6)


def kick_of(way):
    """τ of which two of these spheres diffuse so far against each other, √(2 D τ)."""
    return way**2 / (4.0 * DIFFUSION)


def text_of(replicates=12, way=2e-7, scene="", shapes="vertices = [1]", forces=None):
    thermal = THERMAL.format(kick=kick_of(way)) if forces is None else forces
    return STUDY.format(replicates=replicates, scene=scene, shapes=shapes, forces=thermal)


def config_of(folder, **changes):
    path = folder / "study.toml"
    path.write_text(text_of(**changes), "utf-8")
    return load_config(path)


def refused(folder, **changes):
    with pytest.raises(ConfigError) as caught:
        check_study(config_of(folder, **changes))
    line = str(caught.value)
    assert "\n" not in line
    return line


@pytest.fixture
def folder(in_tmp):
    (in_tmp / "study.toml").write_text(text_of(), "utf-8")
    return in_tmp


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"forces": ""}, '"brownian" needs kicks: add [forces.thermal]'),
        ({"forces": "[forces.thermal]\ntemperature = 0.0"}, '"brownian" needs kicks'),
        ({"scene": "release = 4.0\nescape = 4.0"}, "release = 4 must be below escape = 4"),
        ({"scene": "release = 1.0"}, "release"),
        ({"scene": "delta = [0.5]"}, "scene.delta: applies only with meeting"),
        ({"scene": 'start_gap = "3 um"'}, "scene.start_gap: applies only with meeting"),
        ({"scene": 'escape_gap = "3 um"'}, "scene.escape_gap: applies only with meeting"),
        ({"scene": 'rest_time = "3 s"'}, "scene.rest_time: applies only with meeting"),
        ({"scene": 'rate = "3 1/s"'}, "only with meeting = 'shear' or 'extension'"),
        ({"scene": 'receiver = "fixed"'}, "applies only with meeting = 'settling': remove"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_in_one_line(tmp_path, changes, words):
    assert words in refused(tmp_path, **changes)


def test_other_meetings_have_no_release(tmp_path):
    for scene in ("release = 2.0", "escape = 3.0"):
        path = tmp_path / "study.toml"
        path.write_text(f'preset = "si"\n[scene]\n{scene}\n', "utf-8")
        with pytest.raises(ConfigError, match="applies only with meeting = 'brownian': remove it"):
            load_config(path)


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ('meeting = "shear"\nrate = "1 1/s"', '"shear" never ends with [forces.thermal]'),
        ('kind = "kernel"\nsizes = ["5 um", "9 um"]', "beyond the offsets that are sampled"),
    ],
)
def test_thermal_motion_is_refused_where_no_proof_holds(tmp_path, scene, words, capsys):
    path = tmp_path / "study.toml"
    path.write_text(f'preset = "si"\n[scene]\n{scene}\n[forces.thermal]\n', "utf-8")
    assert main(["ensemble", str(path), "--dry-run"]) == 2
    assert words in capsys.readouterr().err


def test_an_extension_and_settling_go_with_thermal_motion(tmp_path):
    path = tmp_path / "study.toml"
    for scene in ('meeting = "extension"\nrate = "1 1/s"', ""):
        path.write_text(f'preset = "si"\n[scene]\n{scene}\n[forces.thermal]\n', "utf-8")
        assert load_config(path).scene.release is None


def test_a_replicate_has_a_direction_of_its_own(tmp_path):
    study = Study(config_of(tmp_path))
    encounter = study.encounter(0, 1, study.numbers(0))
    shares = [study.share_of(encounter, 0.0, study.numbers(k)) for k in range(200)]
    assert shares == [study.numbers(k)[4] for k in range(200)]
    low, high = wilson(sum(share < 0.5 for share in shares), 200, 0.999)
    assert low < 0.5 < high
    assert encounter.ends == pytest.approx((2e-6, 4e-6))


def test_the_equivalent_spheres_are_said(tmp_path):
    [facts] = sphere_facts(config_of(tmp_path))
    assert facts["free"] == pytest.approx(0.5, rel=1e-9)
    assert facts["diffusion"] == pytest.approx(2.0 * DIFFUSION, rel=1e-6)
    assert 0.5 < facts["touch"] < 0.51 and 0.9 < facts["stability"] < 1.0
    assert "equivalent spheres touch with probability 0.5 without" in sphere_words(facts)
    settling = tmp_path / "settling.toml"
    settling.write_text('preset = "si"\n', "utf-8")
    assert sphere_facts(load_config(settling)) == []


def test_a_study_is_run_reported_resumed_and_dealt_to_processes(folder, capsys):
    assert main(["ensemble", "study.toml", "--dry-run", "--verbose"]) == 0
    told = capsys.readouterr().out
    assert "brownian: from 2 to 4 (r_i + r_j) apart" in told and "W = " in told
    assert main(["ensemble", "study.toml"]) == 0
    assert "touched before they escaped" in capsys.readouterr().out
    assert main(["info", "study.h5"]) == 0
    told = capsys.readouterr().out
    assert "equivalent spheres touch with probability 0.5 " in told
    assert "touched before they escaped" in told
    found = read_results("study.h5")
    rows = {name: values[0, 0, 0] for name, values in found.replicates.items()}
    assert {OUTCOMES[each] for each in rows["outcome"]} == {"A", "missed"}
    checked = rows["checked_outcome"] != NOT_APPLICABLE
    assert checked.any() and np.all(rows["checked_outcome"][checked] == rows["outcome"][checked])
    assert json.loads(found.run["settling"]) == []
    words = ["ensemble", "study.toml", "--quiet"]
    assert main([*words, "--jobs", "2", "-o", "two.h5"]) == 0
    assert not same_data("study.h5", "two.h5"), "nothing differs"
    assert main([*words, "--replicates", "5", "-o", "more.h5"]) == 0
    assert main([*words, "-o", "more.h5", "--resume"]) == 0
    assert not same_data("study.h5", "more.h5"), "nothing differs"


def test_a_pair_that_a_secondary_minimum_holds_never_touches(folder, capsys):
    text = text_of(4, forces="[forces.thermal]").replace("0.5 um", "5 um").replace("1e-20", "1e-19")
    layer = 'double_layer = { potential = "50 mV", debye_length = "20 nm" }'
    text = text.replace("double_layer = false", layer).replace('cut = "2 nm"', "")
    (folder / "held.toml").write_text(text, "utf-8")
    assert main(["ensemble", "held.toml"]) == 0
    assert "0.0000 [0.0000, 0.4899] touched before they escaped" in capsys.readouterr().out
    table = read_results("held.h5").probabilities
    assert table["n_held"].sum() >= 2
    assert table["n_held"].sum() + table["n_missed"].sum() == 4


@pytest.mark.slow
def test_a_replicate_can_be_looked_at(folder, capsys):
    words = "trajectory study.toml --type 0.5um-0.5um --vertices 1 --replicate 1 -o a.png"
    assert main(words.split()) == 0
    row = Study(load_config("study.toml")).run(0, 1, 0.0, 1)
    assert OUTCOMES[row["outcome"]] in capsys.readouterr().out


SHIFT = 0.5826
"""−ζ(½)/√(2π): by so much of √(2Dτ) paths in steps of τ see absorbing circles further away."""


@pytest.mark.slow
@pytest.mark.parametrize("way", [1e-7, 5e-8])
def test_half_of_the_pairs_touch_but_for_the_known_shift(tmp_path, way):
    """ln(b/r)/ln(b/a) for (a, r, b) = (1, 2, 4) µm, a shifted; within 99.9 %."""
    study, shift = Study(config_of(tmp_path, way=way)), SHIFT * way * 1e6
    wanted = math.log(4.0 / 2.0) / math.log(4.0 / (1.0 - shift))
    ends = [OUTCOMES[study.run(0, 1, 0.0, k)["outcome"]] for k in range(3000)]
    assert set(ends) == {"A", "missed"}
    low, high = wilson(ends.count("A"), len(ends), 0.999)
    assert low <= wanted <= high
