"""Forces against time: what is known of them without a contact law."""

import numpy as np
import pytest

from flocsim.ensembles.collision.draw import Record
from flocsim.ensembles.collision.forces_between import OUTLINES, SETTLING, forces_between
from flocsim.ensembles.collision.start import draws
from tests.helpers.small_study import small_study


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """(row, instants, forces, encounter) of one collision of spheres, Type I."""
    study = small_study(tmp_path_factory.mktemp("forces"))
    record = Record()
    row = study.run(0, 1, 0.0, 0, record)
    encounter = study.encounter(0, 1, draws(1, 0))
    return row, *forces_between(encounter, *record.arrays()), encounter


def test_every_force_has_a_name_and_a_value_per_step(run):
    row, instants, forces, _ = run
    assert set(forces) == {"van der Waals", "double layer", SETTLING, OUTLINES}
    assert {len(force) for force in forces.values()} == {len(instants)}
    assert instants[0] < row["t_collision"] < instants[-1]


def test_nothing_touches_before_the_collision(run):
    """The balance of momentum gives no contact force there, which it has not been told."""
    row, instants, forces, _ = run
    before = instants < 0.9 * row["t_collision"]
    assert before.any()
    assert np.isnan(forces[OUTLINES][before]).all()
    assert np.isfinite(forces[OUTLINES][instants > row["t_collision"]]).any()


def test_a_bound_pair_is_in_balance_at_its_end(run):
    """It still rings a little there: the contact bears the attraction, but for that."""
    _, _, forces, _ = run
    assert forces[OUTLINES][-1] == pytest.approx(-forces["van der Waals"][-1], rel=0.4)


def test_attraction_pulls_and_repulsion_pushes(run):
    _, _, forces, _ = run
    assert (forces["van der Waals"] <= 0.0).all()
    assert (forces["double layer"] >= 0.0).all()
