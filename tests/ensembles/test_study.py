"""A study: its size, the order of its replicates, what it makes once and keeps."""

import numpy as np
import pytest

from flocsim.ensembles.collision.start import draws
from flocsim.ensembles.study import Study
from flocsim.errors import ZoneError
from flocsim.io.results.schema import REPLICATES
from flocsim.run import Run
from tests.helpers.small_study import small_config, small_study


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The small study."""
    return small_study(tmp_path_factory.mktemp("study"))


def test_shape_and_size(study):
    assert study.shape == (2, 3, 2, 3)
    assert study.size == 36


def test_conditions_are_in_the_order_of_the_results_file(study):
    place = int(np.ravel_multi_index((1, 1, 1), study.shape[:3]))
    assert study.conditions[place] == ("III", 4, 1.0)
    assert study.places[place] == (1, 4, 1.0)
    assert len(set(study.conditions)) == len(study.places) == 12


def test_a_row_has_all_columns_and_names_its_flocs(study):
    row = study.run(1, 4, 1.0, 2)
    assert set(row) == set(REPLICATES)
    chosen = study.floc_pool.choose(draws(1, 2), *study.config.scene.conditions[1][1:])
    assert (row["floc_i"], row["floc_j"]) == chosen
    sphere = study.run(1, 1, 1.0, 2)
    assert (sphere["floc_i"], sphere["floc_j"]) == (-1, -1)


def test_a_replicate_that_is_given_up_has_no_row(study, monkeypatch):
    monkeypatch.setattr(Run.advance, "__defaults__", (5,))
    looks = []
    whole = study.run(0, 4, 0.0, 0, halted=lambda: looks.append(0))
    assert len(looks) > 2
    np.testing.assert_equal(whole, study.run(0, 4, 0.0, 0))
    assert study.run(0, 4, 0.0, 0, halted=lambda: True) is None


def test_an_encounter_is_made_once_for_each_pair_of_shapes(study):
    numbers = draws(1, 0)
    assert study.encounter(0, 4, numbers) is study.encounter(0, 4, numbers)
    assert study.encounter(0, 4, numbers) is not study.encounter(0, 16, numbers)
    assert study.encounter(0, 4, numbers) is not study.encounter(1, 4, numbers)
    # All spheres of one type are alike, whatever flocs the replicate would draw.
    assert len({id(study.encounter(0, 1, draws(1, k))) for k in range(10)}) == 1


def test_one_driver_for_spheres_and_one_for_polygons(study):
    drivers = [study.driver(study.encounter(0, n, draws(1, 0))) for n in (1, 4, 16)]
    assert drivers[1] is drivers[2]
    assert drivers[0] is not drivers[1]


def test_each_type_has_its_zone(study):
    assert study.zones["I"] - 39.43e-6 == pytest.approx(study.zones["III"] - 9.57e-6, rel=1e-9)


def test_pairs_are_named_by_their_radii(tmp_path):
    overrides = {"scene": {"pairs": [["10 um", "20.5 um"]]}, "shapes": {"vertices": [1]}}
    study = Study(small_config(tmp_path, overrides))
    assert list(study.zones) == ["10um-20.5um"]


def test_spheres_alone_need_no_flocs(tmp_path):
    study = Study(small_config(tmp_path, {"shapes": {"vertices": [1]}}))
    assert study.flocs == []
    assert study.shape == (2, 1, 2, 3)


def test_no_zone_no_study(tmp_path):
    with pytest.raises(ZoneError):
        small_study(tmp_path, {"forces": {"double_layer": {"potential": "1 mV"}}})
