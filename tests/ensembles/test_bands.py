"""[shapes] outlines: studies with the outlines of flocs cut closer, wider, and all three."""

import attrs
import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.ensembles.collision.draw import columns_of
from flocsim.ensembles.runner import run
from flocsim.ensembles.storage.identity import differences, identity_of
from flocsim.ensembles.study import Study
from flocsim.errors import ConfigError
from flocsim.io.shape_library import read_library, write_library
from tests.helpers.small_study import load_text, problem_lines, star_fit, write_star_library
from tests.helpers.tiers import rest_slow

STUDY = """\
preset = "tang2014"
replicates = 8
[scene]
{scene}
delta = [0.0, 0.5]
[shapes]
source = "library"
file = "stars.h5"
outlines = "{outlines}"
vertices = [1, 6]
"""
SCENES = {"measured": 'pairs = "measured"', "resized": 'types = ["I"]'}


def banded(entry, closer, wider):
    """An entry of `write_star_library` whose band has stars of these sizes over its own."""
    made = {}
    for name, end, share in (("closer", "low", closer), ("wider", "high", wider)):
        radius = share * entry.equivalent_radius
        made |= {name: {6: star_fit(6, radius)}, f"radius_{end}": radius}
    return attrs.evolve(entry, **made)


@pytest.fixture
def folder(tmp_path):
    write_star_library(tmp_path / "stars.h5", (6,), (8.0, 13.0, 20.0))
    give_bands(tmp_path / "stars.h5", 1.3)
    return tmp_path


def give_bands(path, wider):
    """Give all flocs of a library bands, to so many times their size."""
    entries = [banded(each, 0.6, wider) for each in read_library(path)]
    path.unlink()
    write_library(path, entries)


def config(folder, outlines, scene="measured"):
    return load_text(folder, STUDY.format(outlines=outlines, scene=SCENES[scene]))


@pytest.mark.parametrize("scene", rest_slow(SCENES, lambda scene: scene == "measured"))
def test_further_runs_are_those_of_a_study_of_that_outline(folder, scene):
    """Radii included: they are drawn as the flocs that were cut, whose places do not change."""
    found = run(config(folder, "band", scene)).replicates
    for end in ("closer", "wider"):
        other = run(config(folder, end, scene)).replicates
        for column, same in columns_of(end).items():
            np.testing.assert_array_equal(found[column], other[same], err_msg=column)


@pytest.mark.slow
def test_first_runs_are_those_of_a_study_without(folder):
    one, other = (run(config(folder, outlines)).replicates for outlines in ("band", "cut"))
    for name in ("outcome", "r_i", "d_c_last", "steps", "checked_outcome"):
        np.testing.assert_array_equal(one[name], other[name])
    assert np.all(other["closer_outcome"] == 255)


def test_the_error_is_printed_stored_and_drawn(folder, in_tmp, one_figure, capsys):
    (folder / "study.toml").write_text(STUDY.format(outlines="band", scene=SCENES["measured"]))
    assert main(["ensemble", "study.toml"]) == 0
    printed = capsys.readouterr().out
    assert main(["info", "study.h5"]) == 0
    described = capsys.readouterr().out
    for text in (printed, described):
        assert "outlines Pr[A]" in text
        assert "Outlines: cut closer or wider, within their bands, Pr[A] would change by" in text
    opened = flocsim.open("study.h5")
    table = opened.to_xarray("outlines")
    assert (table["pr_a_shape_low"] <= 0.0).all() and (table["pr_a_shape_high"] >= 0.0).all()
    assert main(["report", "study.h5"]) == 0
    assert "Outlines: cut closer or wider" in (folder / "study.html").read_text("utf-8")


def test_rows_follow_from_the_ends_of_the_bands(folder):
    study = Study(config(folder, "band"))
    give_bands(folder / "stars.h5", 1.4)
    other = Study(config(folder, "band"))
    assert differences(identity_of(study), identity_of(other))


def test_a_library_without_bands_says_what_to_do(tmp_path):
    write_star_library(tmp_path / "stars.h5", (6,))
    with pytest.raises(ConfigError, match=r"cut closer and wider, .* `flocsim fit --band`"):
        Study(config(tmp_path, "wider"))


@pytest.mark.parametrize("scene", [
    'kind = "kernel"\nmeeting = ["settling"]\npairs = "measured"',
    'kind = "swarm"\nnumber = 20\nbox = ["300 um", "300 um"]\nduration = "1 ms"\nevery = "1 ms"',
])  # fmt: skip
def test_other_kinds_are_run_with_either_end(folder, scene):
    text = STUDY.format(outlines="band", scene=scene).replace("delta = [0.0, 0.5]", "")
    text = text.replace("[1, 6]", "[6]")
    [line] = problem_lines(folder, text)
    assert "is for studies of two bodies" in line
