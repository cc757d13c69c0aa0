"""What is said of the equivalent spheres of a study with water between them, and where not."""

import pytest

from flocsim.ensembles.config.loader import load_any_config
from flocsim.ensembles.diagnose.spheres import water_facts
from flocsim.errors import UsageError
from flocsim.io.results.run_group import water_words

PAIRS = """\
preset = "si"
replicates = 1
[scene]
pairs = [["5 um", "10 um"]]
{scene}
[forces.double_layer]
potential = 0.0
{more}
"""


def facts(folder, scene="", more=""):
    path = folder / "study.toml"
    path.write_text(PAIRS.format(scene=scene, more=more), "utf-8")
    return water_facts(load_any_config(path))


@pytest.mark.slow
def test_a_pair_that_settles(tmp_path):
    [found] = facts(tmp_path)
    assert found["water"] == pytest.approx(0.03085, rel=2e-3)
    assert found["alone"] == pytest.approx(1.033, rel=2e-3)
    assert "0.0308" in water_words(found) or "0.0309" in water_words(found)


def test_more_attraction_lets_more_touch(tmp_path):
    weak, strong = (
        facts(tmp_path, more=f'[forces.van_der_waals]\nhamaker = "{each} J"')[0]["water"]
        for each in ("1e-21", "1e-19")
    )
    assert weak < 0.7 * strong


def test_more_touch_where_water_passes_through(tmp_path):
    [solid], [nearly], [open_] = (
        facts(tmp_path, more=f'[forces.drag]\npermeability = "{each} m^2"')
        for each in ("0", "1e-18", "1e-12")
    )
    assert nearly["water"] == pytest.approx(solid["water"], rel=0.1)
    assert 1.5 * solid["water"] < open_["water"] < open_["alone"]


@pytest.mark.parametrize(("scene", "more", "words"), [
    ('receiver = "fixed"', "", "with a fixed receiver: choose scene.receiver = 'free'"),
    ("", '[forces.thermal]\ntemperature = "293 K"', "with thermal kicks"),
    ("", '[fluid]\ngradient = [0.0, 10.0, 0.0, 0.0]', "when they settle in a flow"),
])  # fmt: skip
def test_where_it_is_not_known(tmp_path, scene, more, words):
    with pytest.raises(UsageError, match=words):
        facts(tmp_path, scene, more)
