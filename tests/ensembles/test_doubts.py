"""Doubts of a study: in the terms of its config, on the terminal, and in the file."""

import json

from flocsim.ensembles import cli
from flocsim.ensembles.contents import text_of
from flocsim.ensembles.doubts import said_doubts, settling_facts, study_doubts
from flocsim.ensembles.dry_run import dry_run
from flocsim.ensembles.storage.stored_json import stored
from flocsim.io.results.file import read_results
from tests.helpers.small_study import small_config, write_small

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
    assert study_doubts(small_config(tmp_path, USUAL)) == []


def test_doubts_have_the_names_of_the_config(tmp_path):
    lines = study_doubts(small_config(tmp_path, WILD))
    starts = ["forces.van_der_waals.hamaker = 5 J", "fluid.viscosity = 1 Pa s", "buoyancy is off",
              "shapes.radius over the smallest equivalent radius = 0.548"]  # fmt: skip
    assert [line.startswith(start) for line, start in zip(lines, starts, strict=True)] == [True] * 4
    assert lines[2].endswith("give fluid.buoyancy = true")


def test_the_fastest_body_of_all_types_is_held_to_the_drag_law(tmp_path):
    [line] = study_doubts(small_config(tmp_path))
    assert "r_eq = 23.02 um settles at 84.58 mm/s: Re = 4.4" in line
    assert "forces.drag takes law =" in line
    law = {"forces": {"drag": {"law": "schiller_naumann"}}}
    assert study_doubts(small_config(tmp_path, law)) == []


def test_what_the_paper_preset_implies_is_said_once_and_calmly(tmp_path):
    """By the dry run, in the place of a warning of every run; other weights are doubted still."""
    config = small_config(tmp_path)
    lines = study_doubts(config)
    assert len(lines) == 1 and said_doubts(config, lines) == []
    text = dry_run(config, 1)
    assert text.count("note: preset tang2014 gives") == 1 and "warning:" not in text
    heavier = small_config(tmp_path, {"bodies": {"surface_density": 3.0}})
    assert said_doubts(heavier, study_doubts(heavier)) == study_doubts(heavier) != []
    assert said_doubts(small_config(tmp_path, WILD), ["a"]) == ["a"]
    assert "note: preset" not in dry_run(heavier, 1)


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
    [line] = study_doubts(small_config(tmp_path, mine))
    assert line.startswith("forces.contact and forces.mine both act")
    assert line.endswith("give forces.contact = false")
    alone = USUAL | {"forces": {"mine": {"class": "own_hertz:Hertz"}, "contact": False}}
    assert study_doubts(small_config(tmp_path, alone)) == []


def test_numbers_of_every_body(tmp_path):
    facts = settling_facts(small_config(tmp_path))
    assert [(each["type"], each["body"]) for each in facts] == [
        ("I", "i"), ("I", "j"), ("III", "i"), ("III", "j"),
    ]  # fmt: skip
    held = settling_facts(small_config(tmp_path, {"scene": {"receiver": "fixed"}}))
    assert [each["body"] for each in held] == ["j", "j"]


def test_a_dry_run_tells_numbers_and_doubts(tmp_path):
    lines = dry_run(small_config(tmp_path, WILD), 1, pilot=False).splitlines()
    assert sum(line.startswith("warning: ") for line in lines) == 4
    [told] = [line for line in lines if line.startswith("    at terminal speed: body i Re = ")]
    assert "; body j Re = " in told and "St = " in told


def test_a_run_tells_them_once_and_keeps_them(folder, capsys):
    write_small(folder, name="small.toml", vertices="[1]", replicates=1, delta="[0.0]")
    assert cli.main(["small.toml", "--set", "bodies.surface_density=3"]) == 0
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith("flocsim: warning: a body of r_eq = 23.02 um settles at 126.9 mm/s")
    run = read_results(folder / "small.h5").run
    assert [f"flocsim: warning: {each}" for each in stored(run, "warnings")] == [line]
    heavier = small_config(folder, {"bodies": {"surface_density": 3.0}})
    assert stored(run, "settling") == settling_facts(heavier)
    assert json.loads(run["settling"])[1]["reynolds"] > 4.0
    text = text_of(folder / "small.h5")
    assert line.removeprefix("flocsim: ") in text.splitlines()
    assert "I: i Re 3.3 St " in text
