"""Studies of flocs as they were measured: one key, from the config to all that reads the file."""

import json

import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.ensembles.collision.start import zone_distance
from flocsim.ensembles.diagnose.dry_run import dry_run
from flocsim.ensembles.diagnose.preflight import check_study, study_warnings
from flocsim.ensembles.diagnose.spheres import settling_facts
from flocsim.ensembles.runner import run
from flocsim.ensembles.storage.identity import differences, identity_of
from flocsim.ensembles.study import Study
from flocsim.errors import ConfigError
from tests.helpers.small_study import load_text, problem_lines, write_star_library

RATIOS = (3.0, 5.0, 8.0, 13.0, 20.0)
"""Measured r_eq of the library's stars [um]."""

STUDY = """\
preset = "tang2014"
replicates = 6
[scene]
pairs = "measured"
delta = [0.0, 0.5]
[shapes]
source = "library"
file = "stars.h5"
vertices = [1, 4]
"""
SPHERES = {"shapes": {"vertices": [1]}}


@pytest.fixture
def folder(tmp_path):
    write_star_library(tmp_path / "stars.h5", ratios=RATIOS)
    return tmp_path


def test_one_key_makes_a_study_of_measured_sizes(folder):
    config = load_text(folder, STUDY)
    assert (config.shapes.size, config.scene.names) == ("own", ("measured",))
    check_study(config)
    study = Study(config)
    sizes = np.array([floc.size for floc in study.flocs])
    radii = study.pairings[0].radii
    reach = zone_distance(config.zone, config.forces, *radii) - sum(radii)
    rows = [study.run(0, n, share, k) for k in range(6) for n in (1, 4) for share in (0.0, 0.5)]
    assert len({(row["floc_i"], row["floc_j"]) for row in rows}) > 2
    for place, row in enumerate(rows):
        assert row["r_i"] == pytest.approx(sizes[row["floc_i"]], rel=1e-12)
        assert row["r_j"] == pytest.approx(sizes[row["floc_j"]], rel=1e-12)
        assert row["r_i"] < row["r_j"]
        assert row["D_0"] - row["r_i"] - row["r_j"] == pytest.approx(reach, rel=1e-9)
        # The same two flocs at every N and displacement.
        first = rows[place - place % 4]
        assert (row["floc_i"], row["floc_j"]) == (first["floc_i"], first["floc_j"])
        if row["inside"] <= 1:
            assert row["d_c_over_D_0"] == row["d_c_collision"] / row["D_0"]
            assert (row["d_c_over_D_0"] < 1.0) == bool(row["inside"])
        else:
            assert np.isnan(row["d_c_over_D_0"])


def test_which_flocs_are_drawn_follows_from_seed_and_replicate_alone(folder):
    forward, backward = (Study(load_text(folder, STUDY, SPHERES)) for _ in range(2))
    rows = [forward.run(0, 1, 0.0, k) for k in range(6)]
    assert [backward.run(0, 1, 0.0, k) for k in reversed(range(6))] == rows[::-1]
    more = Study(load_text(folder, STUDY, SPHERES | {"replicates": 60}))
    assert more.run(0, 1, 0.0, 5)["floc_i"] == rows[5]["floc_i"]


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('file = "stars.h5"', 'file = "stars.h5"\nsize = "scene"',
         'study.toml:9: shapes.size: must be "own" with scene.pairs = "measured": leave it out'),
        ('source = "library"\nfile = "stars.h5"', "",
         'study.toml:4: scene.pairs: "measured" needs a library of flocs: give shapes.source = '
         '"library" and file'),
        ('"measured"', '"measurd"',
         "study.toml:4: scene.pairs must be 'measured', found 'measurd' (did you mean "
         "'measured'?)"),
    ],
)  # fmt: skip
def test_what_measured_pairs_do_not_go_with(folder, old, new, why):
    assert problem_lines(folder, STUDY.replace(old, new)) == [why]


def test_a_library_without_the_sizes_is_refused(folder):
    config = load_text(folder, STUDY, {"scene": {"max_radius": "4 um"}})
    with pytest.raises(ConfigError, match=r"of 1 flocs of 3 to 3 um, class q1 holds 1 of one size"):
        check_study(config)


def test_what_is_said_of_a_study_is_of_its_largest_flocs(folder):
    config = load_text(folder, STUDY, {"scene": {"classes": ["6 um"]}})
    facts = {(each["type"], each["body"]): each["radius"] for each in settling_facts(config)}
    assert facts["to6um-from6um", "i"] == pytest.approx(5e-6)
    assert facts["to6um-from6um", "j"] == pytest.approx(20e-6)
    assert facts["from6um-from6um", "i"] == pytest.approx(13e-6)
    heavier = load_text(folder, STUDY, {"bodies": {"surface_density": 2.1}})
    assert any("r_eq = 20 um" in line for line in study_warnings(heavier))
    said = dry_run(config, 1, verbose=True)
    assert "size classes, r_eq: to6um 3 to 5 um (2 flocs), from6um 8 to 20 um (3 flocs)" in said
    assert "library" in said and "drawn by number" in said
    assert "r_i 3 to 5 um, r_j 8 to 20 um" in said


def test_an_impact_too_deep_is_that_of_the_fastest_pair(folder):
    soft = {"forces": {"contact": {"k_n": 0.02}}}
    with pytest.raises(ConfigError, match=r"measured: an impact at .* give forces.contact.k_n"):
        check_study(load_text(folder, STUDY, soft))
    check_study(load_text(folder, STUDY, soft | {"scene": {"max_radius": "6 um"}}))
    softer = {"forces": {"contact": {"k_n": 1e-4}}}
    with pytest.raises(ConfigError, match="measured: an impact at"):
        check_study(load_text(folder, STUDY, SPHERES | softer))


def test_pairs_of_size_classes_are_the_types_of_a_study(folder):
    config = load_text(folder, STUDY, SPHERES | {"scene": {"classes": 2, "weight": "number"}})
    results = run(config)
    assert results.types == ("q1-q1", "q1-q2", "q2-q2")
    classes = json.loads(results.run["size_classes"])
    assert [each["label"] for each in classes] == ["q1", "q2"]
    assert sum(each["flocs"] for each in classes) == len(RATIOS)
    assert (classes[0]["low"], classes[1]["high"]) == pytest.approx((3e-6, 20e-6))
    r_i, r_j = results.replicates["r_i"], results.replicates["r_j"]
    assert r_j[0].max() < 9e-6 and r_i[2].min() > 7e-6
    for name, values in (("r_i", r_i), ("r_j", r_j)):
        medians = results.radii[name]
        assert np.all((values.min(axis=(1, 2, 3)) <= medians) & (medians <= values.max((1, 2, 3))))


def test_the_identity_knows_how_flocs_are_drawn(folder):
    first = identity_of(Study(load_text(folder, STUDY, SPHERES)))
    other = identity_of(Study(load_text(folder, STUDY, SPHERES | {"scene": {"weight": "area"}})))
    assert differences(first, other)[0] == 'scene.weight is "number" in the file, "area" now'
    write_star_library(folder / "other.h5", ratios=(*RATIOS[:-1], 21.0))
    others = {"shapes": {"vertices": [1], "file": "other.h5"}}
    assert differences(first, identity_of(Study(load_text(folder, STUDY, others))))


def test_the_file_and_all_that_reads_it(folder, in_tmp):
    """Run, extended, described, drawn, compared, run again: as a study of types."""
    (folder / "study.toml").write_text(STUDY)
    words = ["ensemble", "study.toml", "--quiet", "--set", "shapes.vertices=[1]"]
    assert main([*words, "--replicates", "4"]) == 0
    assert main([*words, "--resume"]) == 0
    assert main([*words, "-o", "whole.h5"]) == 0
    first, whole = flocsim.open("study.h5"), flocsim.open("whole.h5")
    for name, values in whole.replicates.items():
        assert values.tobytes() == first.replicates[name].tobytes(), name
    assert main(["info", "study.h5"]) == 0
    assert main(["plot", "study.h5", "--figures", "overview"]) == 0
    assert main(["compare", "study.h5", "whole.h5"]) == 0
    again = first.replicate(2).row
    assert again["r_i"] == first.replicates["r_i"][0, 0, 0, 2]
    assert json.loads(first.run["settling"])[1]["radius"] == pytest.approx(20e-6)
    frame, dataset = first.to_pandas(), first.to_xarray()
    assert dataset["r_i"].dims == ("type",) and "r_i" in dataset.coords
    assert frame["r_j"].tolist() == [dataset["r_j"].item()] * 2
    pytest.importorskip("h5netcdf")
    with pytest.importorskip("xarray").open_dataset("study.h5", group="pooled") as pooled:
        assert "r_j" in pooled.coords and pooled["r_j"].attrs["units"] == "m"
