"""Which flocs, preset and version results are of: said by the run, its file and all made of it."""

import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.ensembles.config.loader import load_any_config, load_config
from flocsim.ensembles.config.schema import ShapesConfig
from flocsim.ensembles.study import Study
from flocsim.ensembles.swarms.study import SwarmStudy
from flocsim.io.plots.results import FIGURES
from flocsim.io.plots.style import add_foot, keep_titles_whole
from flocsim.io.shape_library import SHIPPED
from tests.helpers.small_study import run_command, write_small, write_star_library
from tests.helpers.synthetic_results import make_results

SOURCE = f"preset tang2014 · 3 flocs of stars.h5, resized · n = 3 · flocsim {flocsim.__version__}"
SWARM = """preset = "si"
scene = {kind = "swarm", number = 3, area_fraction = 0.05, duration = "1 ms"}
shapes = {source = "library", file = "stars.h5", vertices = [4]}
forces.van_der_waals.cut = "1 um"
"""
POOL = '3\nsource = "library"\nfile = "stars.h5"'


@pytest.mark.parametrize(
    ("keys", "count", "words"),
    [
        ({"source": "library", "file": "a/shapes.h5"}, 12, "12 flocs of shapes.h5, resized"),
        ({"source": "library", "file": SHIPPED}, 24, "24 synthetic flocs included in flocsim"),
        ({}, 10, "10 synthetic flocs grown by flocsim"),
        ({"vertices": (1,)}, 0, "spheres"),
        ({"source": None, "own": flocsim.SpheroPolygon([(0, 0), (1e-5, 0)], 1e-6)}, 1,
         "flocsim.geometry.shapes.spheropolygon:SpheroPolygon"),
    ],
)  # fmt: skip
def test_flocs_in_words(keys, count, words):
    assert ShapesConfig(**keys).described(count) == words


def test_flocs_of_a_swarm_are_resized_only_to_a_given_radius(in_tmp):
    write_star_library(in_tmp / "stars.h5")
    (in_tmp / "swarm.toml").write_text(SWARM)
    for scene, words in (({}, ""), ({"radius": 5e-6}, ", resized")):
        config = load_any_config(in_tmp / "swarm.toml", {"scene": scene})
        assert SwarmStudy(config).flocs_in_words == f"3 flocs of stars.h5{words}"


def test_flocs_that_are_never_drawn_are_not_counted_as_used(in_tmp):
    write_star_library(in_tmp / "stars.h5")
    config = write_small(in_tmp, vertices="[4]", pool=POOL)
    one = load_config(config, {"scene": {"types": ["I"]}, "shapes": {"pool": 1}})
    # For each body the nearest floc in size is drawn, and no other.
    assert Study(one).flocs_in_words == "2 of 3 flocs of stars.h5, resized"
    assert Study(load_config(config)).flocs_in_words == "3 flocs of stars.h5, resized"


def test_run_info_report_and_comparison_name_the_source(in_tmp, capsys):
    write_star_library(in_tmp / "stars.h5")
    write_small(in_tmp, vertices="[4]", delta="[0.0]", types='["I"]', pool=POOL)
    done = run_command(in_tmp, "small.toml")
    assert done.returncode == 0, done.stderr
    first, *table = done.stdout.splitlines()
    assert first.endswith(f"; {SOURCE.replace(' · n = 3', '')}") and SOURCE in table
    (in_tmp / "stars.h5").unlink()
    assert main(["info", "small.h5"]) == 0
    assert capsys.readouterr().out.splitlines()[1] == SOURCE
    assert main(["report", "small.h5", "--no-motion"]) == 0
    assert f"{SOURCE}</p>" in (in_tmp / "small.html").read_text("utf-8")
    assert main(["compare", "small.h5", "small.h5"]) == 0
    assert capsys.readouterr().out.count(f"small.h5: {SOURCE}\n") == 2
    drawn = flocsim.open("small.h5").plot("4")
    assert drawn._supxlabel.get_text().replace("\n", " ").endswith(SOURCE)


@pytest.mark.parametrize("name", FIGURES)
def test_the_line_at_the_foot_touches_nothing(name):
    figure = FIGURES[name](make_results(count=4))
    add_foot(figure, SOURCE)
    add_foot(figure, SOURCE)  # saved under a second name
    keep_titles_whole(figure)
    foot = figure._supxlabel.get_window_extent()
    assert figure._supxlabel.get_text().replace("\n", " ").count(SOURCE) == 1
    assert foot.y0 >= 0.0 and foot.x1 <= figure.bbox.x1
    below = [axes.get_tightbbox().y0 for axes in figure.axes if axes.get_visible()]
    assert foot.y1 <= np.min(below)
