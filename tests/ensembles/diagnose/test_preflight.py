"""Impacts deeper than the contact law covers are refused before anything runs."""

import json
import math
import re

import attrs
import pytest
from scipy.integrate import solve_ivp

from flocsim.__main__ import main
from flocsim.ensembles.collision.equivalent import sphere_pairs
from flocsim.ensembles.contents import info_of
from flocsim.ensembles.diagnose.dry_run import dry_run
from flocsim.ensembles.diagnose.preflight import (
    IMPLIED,
    check_study,
    depth,
    rounded_up,
    study_warnings,
)
from flocsim.ensembles.diagnose.spheres import settling_facts
from flocsim.errors import ConfigError, KernelError
from flocsim.explain import pairs_of
from flocsim.fields import quantity
from flocsim.forces import ContactForce
from flocsim.io.results.file import read_results
from flocsim.io.results.run_group import stored
from tests.helpers.small_study import small_config, write_small

HEAVY = {"bodies": {"surface_density": 20.0}}


@attrs.frozen
class Hertz(ContactForce):
    """A law of a user's own: k Δ^1.5."""

    k: float = quantity("", above=0.0)

    @staticmethod
    def kernel(contact, k):
        return k * contact.overlap**1.5, 0.0


@attrs.frozen
class Sticky(ContactForce):
    """A law without stiffness: nothing can be said of how deep it lets bodies in."""

    @staticmethod
    def kernel(contact):
        return -1e-12, 0.0


@attrs.frozen
class Singular(ContactForce):
    """A law that gives no number."""

    @staticmethod
    def kernel(contact):
        return 1.0 / (contact.overlap - contact.overlap), 0.0


def with_law(config, law):
    forces = [force for force in config.forces if not isinstance(force, ContactForce)]
    made = attrs.evolve(config)
    object.__setattr__(made, "forces", (*forces, law))
    return made


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0, 2.5])
def test_the_depth_is_that_of_the_damped_spring(share):
    speed, mass, stiffness = 0.2, 3e-9, 20.0
    omega = math.sqrt(stiffness / mass)
    motion = solve_ivp(
        lambda t, y: (y[1], -(omega**2) * y[0] - 2.0 * share * omega * y[1]),
        (0.0, 4.0 / omega), (0.0, speed), rtol=1e-9, atol=1e-15, max_step=0.01 / omega,
    )  # fmt: skip
    found = depth(speed, mass, stiffness, 2.0 * share * math.sqrt(stiffness * mass))
    assert found == pytest.approx(max(motion.y[0]), rel=1e-4)


def test_a_value_is_rounded_up():
    assert [rounded_up(x) for x in (38.0, 37.01, 0.0991, 2751.0)] == [38.0, 38.0, 0.1, 2800.0]


def test_heavy_flocs_are_refused_with_the_stiffness_that_would_do(tmp_path):
    with pytest.raises(
        ConfigError, match=r"I: an impact at 242\.9 mm/s makes bodies overlap by 2\.12 um"
    ) as told:
        check_study(small_config(tmp_path, HEAVY))
    line = str(told.value)
    assert "\n" not in line and "valid only up to 1 um" in line
    wanted = float(re.search(r"k_n (\S+) N/m or more", line)[1])
    for factor, fits in ((1.0, True), (0.95, False)):
        over = HEAVY | {"forces": {"contact": {"k_n": factor * wanted}}}
        config = small_config(tmp_path, over)
        if fits:
            check_study(config)
        else:
            with pytest.raises(ConfigError, match="makes bodies overlap by"):
                check_study(config)


def test_spheres_alone_have_room_for_more(tmp_path):
    check_study(small_config(tmp_path, HEAVY | {"shapes": {"vertices": [1]}}))


def test_without_damping_impacts_are_deeper(tmp_path):
    loose = {"damping_n": 0.0}
    over = {"bodies": {"surface_density": 8.0}, "forces": {"contact": loose}}
    check_study(small_config(tmp_path, {"bodies": {"surface_density": 8.0}}))
    with pytest.raises(ConfigError, match="makes bodies overlap by"):
        check_study(small_config(tmp_path, over))


def test_a_law_of_ones_own_is_judged_by_its_work(tmp_path):
    config = small_config(tmp_path)
    speed, limit = 0.02429, 1e-6
    # M v²/2 = k L^2.5/2.5 at the deepest overlap that is covered.
    mass = min_mass(config)
    least = 1.25 * mass * speed**2 / limit**2.5
    check_study(with_law(config, Hertz(1.05 * least)))
    with pytest.raises(ConfigError, match=r"make the contact 1\.1 times as stiff"):
        check_study(with_law(config, Hertz(0.95 * least)))


def min_mass(config):
    """M [kg] of the pair of Type I."""
    return next(mass for _, _, mass in pairs_of(next(sphere_pairs(config))[1].system))


def test_a_law_that_cannot_be_judged_is_left_alone(tmp_path):
    check_study(with_law(small_config(tmp_path, HEAVY), Sticky()))


def test_a_law_that_gives_no_number_is_refused_as_that(tmp_path):
    with pytest.raises(KernelError, match="gives inf at an overlap of"):
        check_study(with_law(small_config(tmp_path, HEAVY), Singular()))


def test_the_command_refuses_before_it_runs(in_tmp, capsys):
    write_small(in_tmp)
    for words in ((), ("--dry-run",)):
        assert main(["ensemble", "small.toml", "--set", "bodies.surface_density=20", *words]) == 2
        said = capsys.readouterr()
        assert said.out == "" and "forces.contact.k_n 90 N/m or more" in said.err
    assert [path.name for path in in_tmp.iterdir()] == ["small.toml"]


USUAL = {
    "bodies": {"density": 2650.0},
    "fluid": {"buoyancy": True},
    "scene": {"types": ["I"]},
    "forces": {"contact": {"k_n": 200.0}},
}
WILD = USUAL | {
    "fluid": {"viscosity": 1.0, "buoyancy": False},
    "forces": {"van_der_waals": {"hamaker": 5.0}, "contact": {"k_n": 200.0}},
    "shapes": {"radius": "9 um"},
    "zone": {"distance": "5 um"},
}


def test_a_usual_study_is_not_doubted(tmp_path):
    assert study_warnings(small_config(tmp_path, USUAL)) == []


def test_doubts_have_the_names_of_the_config(tmp_path):
    lines = study_warnings(small_config(tmp_path, WILD))
    starts = ["forces.van_der_waals.hamaker = 5 J", "fluid.viscosity = 1 Pa s", "buoyancy is off",
              "shapes.radius over the smallest equivalent radius = 0.548"]  # fmt: skip
    assert [line.startswith(start) for line, start in zip(lines, starts, strict=True)] == [True] * 4
    assert lines[2].endswith("give fluid.buoyancy = true")


def test_the_fastest_body_of_all_types_is_held_to_the_drag_law(tmp_path):
    heavy = {"bodies": {"surface_density": 2.1}}
    [line] = study_warnings(small_config(tmp_path, heavy))
    assert "r_eq = 23.02 um settles at 88.81 mm/s: Re = 4.6" in line
    assert "give forces.drag law =" in line
    law = {"forces": {"drag": {"law": "schiller_naumann"}}}
    assert study_warnings(small_config(tmp_path, heavy | law)) == []


def test_what_the_paper_preset_implies_is_a_note_in_place_of_a_warning(tmp_path):
    """Of the dry run and the results file; other weights are doubted still."""
    config = small_config(tmp_path)
    assert study_warnings(config) == [IMPLIED]
    text = dry_run(config, 1)
    assert text.count("note: preset tang2014 gives") == 1 and "warning:" not in text
    heavier = small_config(tmp_path, {"bodies": {"surface_density": 3.0}})
    assert IMPLIED not in study_warnings(heavier) and "note: preset" not in dry_run(heavier, 1)


OWN = """\
import attrs
from flocsim.forces import ContactForce


@attrs.frozen
class Hertz(ContactForce):
    @staticmethod
    def kernel(contact):
        return 1e3 * max(contact.overlap, 0.0) ** 1.5, 0.0
"""


def test_an_own_contact_beside_the_presets(tmp_path):
    (tmp_path / "own_hertz.py").write_text(OWN)
    mine = USUAL | {"forces": {"mine": {"class": "own_hertz:Hertz"}, "contact": {"k_n": 200.0}}}
    [line] = study_warnings(small_config(tmp_path, mine))
    assert line.startswith("forces.contact and forces.mine both act")
    assert line.endswith("give forces.contact = false")
    alone = USUAL | {"forces": {"mine": {"class": "own_hertz:Hertz"}, "contact": False}}
    assert study_warnings(small_config(tmp_path, alone)) == []


def test_numbers_of_every_body(tmp_path):
    facts = settling_facts(small_config(tmp_path))
    assert [(each["type"], each["body"]) for each in facts] == [
        ("I", "i"), ("I", "j"), ("III", "i"), ("III", "j"),
    ]  # fmt: skip
    held = settling_facts(small_config(tmp_path, {"scene": {"receiver": "fixed"}}))
    assert [each["body"] for each in held] == ["j", "j"]


def test_a_dry_run_tells_numbers_and_doubts(tmp_path):
    lines = dry_run(small_config(tmp_path, WILD), 1, verbose=True).splitlines()
    assert sum(line.startswith("warning: ") for line in lines) == 4
    [told] = [line for line in lines if line.startswith("    settling alone: i ")]
    assert "; j " in told and "Re = " in told and "St = " in told


def test_a_run_tells_them_once_and_keeps_them(folder, capsys):
    write_small(folder, name="small.toml", vertices="[1]", replicates=1, delta="[0.0]")
    assert main(["ensemble", "small.toml", "--set", "bodies.surface_density=3"]) == 0
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("flocsim: warning: a body of r_eq = 23.02 um settles at 126.9 mm/s")
    run = read_results(folder / "small.h5").run
    assert [f"flocsim: warning: {each}" for each in stored(run, "warnings")] == [line]
    heavier = small_config(folder, {"bodies": {"surface_density": 3.0}})
    assert stored(run, "settling") == settling_facts(heavier)
    assert json.loads(run["settling"])[1]["reynolds"] > 4.0
    text = info_of(folder / "small.h5")
    assert line.removeprefix("flocsim: ") in text.splitlines()
    assert "I: i Re 3.3 St " in text
