"""Studies with the drag of shapes: which are refused, in one line, and which are made ready."""

import attrs
import pytest

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.diagnose.preflight import check_study
from flocsim.ensembles.study import Study
from flocsim.errors import FlocsimError, UsageError
from flocsim.forces import StokesDrag
from tests.helpers.tiers import rest_slow

STUDY = """\
preset = "tang2014"
seed = 2
replicates = 2
[scene]
pairs = [["5 um", "8 um"]]
{scene}
[shapes]
vertices = [1, 4]
radius = "1 um"
[forces.drag]
law = "shape"
{more}
"""


def written(folder, scene="", more=""):
    path = folder / "study.toml"
    path.write_text(STUDY.format(scene=scene, more=more), encoding="utf-8")
    return load_config(path)


def test_settling_pairs_are_refused(tmp_path):
    with pytest.raises(UsageError, match="drift sideways and rotate as they fall"):
        check_study(written(tmp_path))


def test_thermal_motion_is_refused(tmp_path):
    more = '[forces.thermal]\n[integrator]\nname = "overdamped"'
    with pytest.raises(UsageError, match='Thermal cannot be combined with the drag law "shape"'):
        check_study(written(tmp_path, 'meeting = "brownian"', more))


def test_a_spin_without_drag_is_refused(tmp_path):
    with pytest.raises(FlocsimError, match='rotational must be true if law is "shape"'):
        written(tmp_path, 'meeting = "shear"\nrate = "10 1/s"', "rotational = false")


@pytest.mark.parametrize("meeting", rest_slow(["shear", "extension"], lambda each: each == "shear"))
def test_pairs_in_a_flow_are_drawn_with_it(tmp_path, meeting):
    config = written(tmp_path, f'meeting = "{meeting}"\nrate = "10 1/s"')
    check_study(config)
    study = Study(config)
    draws = [study.draw(0, 4, 0.5, each) for each in range(2)]
    for draw in draws:
        assert draw.encounter.scene.bodies["resistance_xx"].min() > 0.0


def test_an_engine_for_drag_of_shapes_is_not_taken_for_pairs_without(tmp_path):
    study = Study(written(tmp_path, 'meeting = "shear"\nrate = "10 1/s"'))
    encounter = study.draw(0, 4, 0.5, 0).encounter
    others = [
        StokesDrag() if isinstance(each, StokesDrag) else each for each in encounter.system.forces
    ]
    without = attrs.evolve(encounter, system=attrs.evolve(encounter.system, forces=others))
    assert study.driver(encounter) is study.driver(encounter)
    assert study.driver(encounter) is not study.driver(without)
