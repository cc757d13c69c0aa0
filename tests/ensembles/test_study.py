"""A study: its size, the order of its replicates, what it makes once and keeps."""

import numpy as np
import pytest

from flocsim.ensembles.collision import batch
from flocsim.ensembles.collision.batch import Batches
from flocsim.ensembles.collision.draw import FAILED, FAILURES, draws
from flocsim.ensembles.collision.start import zone_distance
from flocsim.ensembles.pairs.opened import replicate_of
from flocsim.ensembles.storage.identity import identity_of
from flocsim.ensembles.study import Study
from flocsim.io.results.schema import OUTCOMES, REPLICATES
from flocsim.io.shape_library import ShapeEntry, StoredFit, write_library
from tests.helpers.compound_shapes import framed
from tests.helpers.small_study import (
    load_text,
    small_config,
    small_study,
    star_fit,
    write_star_library,
)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The small study."""
    return small_study(tmp_path_factory.mktemp("study"))


def test_conditions_are_in_the_order_of_the_results_file(study):
    place = int(np.ravel_multi_index((1, 1, 1), study.shape[:3]))
    assert study.conditions[place] == ("III", 4, 1.0)
    assert len(set(study.conditions)) == 12


def test_a_row_has_all_columns_and_names_its_flocs(study):
    row = study.run(1, 4, 1.0, 2)
    assert set(row) == set(REPLICATES)
    chosen = study.floc_pool.choose(draws(1, 2), *study.pairings[1].radii)
    assert (row["floc_i"], row["floc_j"]) == chosen
    sphere = study.run(1, 1, 1.0, 2)
    assert (sphere["floc_i"], sphere["floc_j"]) == (-1, -1)


def test_a_replicate_that_is_given_up_has_no_row(study, monkeypatch):
    monkeypatch.setattr(batch, "STEPS_AT_A_TIME", 5)
    looks = []
    whole = study.run(0, 4, 0.0, 0, halted=lambda: looks.append(0))
    assert len(looks) > 2
    np.testing.assert_equal(whole, study.run(0, 4, 0.0, 0))
    assert study.run(0, 4, 0.0, 0, halted=lambda: True) is None


def test_what_runs_out_of_steps_is_tried_again_with_more(tmp_path):
    once = {"check_share": 0.0}  # a re-run needs more steps
    full = small_study(tmp_path, {"integrator": once}).run(0, 16, 0.0, 0)
    taken = full["steps"] + full["rejected"]
    few = small_study(tmp_path, {"integrator": once | {"max_steps": taken // 3}})
    assert few.run(0, 16, 0.0, 0) == full
    # Its motion is that of the second attempt, too.
    motion = replicate_of(0, (0, 16, 0.0), few)
    assert motion.row["outcome"] == OUTCOMES[full["outcome"]]
    assert motion.t[-1] == full["t_end"]
    fewer = small_study(tmp_path, {"integrator": {"max_steps": taken // 20}}).run(0, 16, 0.0, 0)
    assert OUTCOMES[fewer["outcome"]] == "undecided"
    assert fewer["steps"] + fewer["rejected"] <= taken // 20


def test_what_fails_is_tried_again_more_exactly(study, monkeypatch):
    tried, run, usual = [], Batches.run, study.config.integrator.method
    fails = [usual]

    def failing(self, draws, max_steps, method, halted):
        tried.append((max_steps, method))
        rows, whys = run(self, draws, max_steps, method, halted)
        if method in fails:
            rows["outcome"], rows["failure"] = FAILED, FAILURES.index("too deep")
        return rows, whys

    right = study.run(0, 4, 0.0, 1)
    monkeypatch.setattr(Batches, "run", failing)
    row = study.run(0, 4, 0.0, 1)
    steps = study.config.integrator.max_steps
    assert tried[:2] == [(steps, usual), (5 * steps, study.exact[0])]
    assert (row["outcome"], row["failure"]) == (right["outcome"], 0)
    # A second try that fails, too, leaves the first as it was.
    fails.append(study.exact[0])
    assert study.run(0, 4, 0.0, 1)["outcome"] == FAILED


def test_each_type_has_its_zone(study):
    first, second = (study.encounter(k, 1, draws(1, 0)).zone_distance for k in range(2))
    assert first - 39.43e-6 == pytest.approx(second - 9.57e-6, rel=1e-9)


def test_spheres_alone_need_no_flocs(tmp_path):
    study = Study(small_config(tmp_path, {"shapes": {"vertices": [1]}}))
    assert study.flocs == []
    assert study.shape == (2, 1, 2, 3)


def star_study(tmp_path, **shapes):
    """A study of the flocs of a library, three stars of 8, 16 and 24 um."""
    if not (tmp_path / "stars.h5").exists():
        write_star_library(tmp_path / "stars.h5", vertices=(4, 8))
    given = {"source": "library", "file": "stars.h5", "vertices": [1, 4], "pool": 3}
    return Study(small_config(tmp_path, {"shapes": given | shapes}))


def test_measured_flocs_meet_at_their_own_size_and_in_their_own_zone(tmp_path):
    study = star_study(tmp_path, size="own")
    config = study.config
    layer = zone_distance(config.zone, config.forces, *study.pairings[0].radii) - 39.43e-6
    for vertices in (1, 4):
        for replicate in range(20):
            numbers = draws(1, replicate)
            places = study.choose_flocs(0, vertices, numbers)
            encounter = study.encounter(0, vertices, numbers)
            sizes = [shape.equivalent_radius for shape in encounter.shapes]
            assert sizes[0] < sizes[1]
            assert encounter.zone_distance - sum(sizes) == pytest.approx(layer, rel=1e-9)
            if vertices == 1:
                assert sizes == pytest.approx([study.flocs[place].size for place in places])
    row = study.run(0, 1, 0.0, 0)
    assert (row["floc_i"], row["floc_j"]) == study.choose_flocs(0, 1, draws(1, 0))


def test_pairs_alike_in_their_error_meet_with_different_vertices(tmp_path):
    study = star_study(tmp_path, pairs_alike_in="error")
    numbers = draws(1, 0)
    first, second = study.choose_flocs(0, 4, numbers)
    study.flocs[first].errors.update({4: 9.0, 8: 5.0})
    study.flocs[second].errors.update({4: 5.5, 8: 2.0})
    counts = [len(shape.vertices) for shape in study.encounter(0, 4, numbers).shapes]
    assert counts == [8, 4]


def test_how_flocs_are_read_is_part_of_a_studys_identity(tmp_path):
    plain, own, alike = (
        identity_of(star_study(tmp_path, **more))
        for more in ({}, {"size": "own"}, {"pairs_alike_in": "error"})
    )
    assert plain != own and plain != alike
    assert {"flocs.8"} <= alike.keys() - plain.keys()


def test_flocs_with_holes_and_without_share_an_engine(tmp_path):
    """Replicates of one study draw both."""
    fits = {"plain": star_fit(8, 6.0), "other": star_fit(8, 6.5), "frame": stored(framed(1e-6))}
    entries = [
        ShapeEntry(name, "flocs.png", 1e-6, (0.0, 0.0), 100, 6.0, 1.0, {8: fit})
        for name, fit in fits.items()
    ]
    write_library(tmp_path / "both.h5", entries)
    text = SMALL_LIBRARY.format(file="both.h5")
    study = Study(load_text(tmp_path, text))
    kinds, engines = set(), set()
    for replicate in range(12):
        encounter = study.draw(0, 8, 0.0, replicate).encounter
        kinds.add(any(shape.is_compound for shape in encounter.shapes))
        engines.add(study.driver(encounter))
    assert kinds == {True, False}
    assert len(engines) == 1


SMALL_LIBRARY = """\
preset = "tang2014"
seed = 3
replicates = 12
[scene]
types = ["I"]
delta = [0.5]
[shapes]
source = "library"
file = "{file}"
vertices = [8]
pool = 3
"""


def stored(shape):
    """A fit of a library with all rings of a shape."""
    return StoredFit(shape.parts, 1.0)
