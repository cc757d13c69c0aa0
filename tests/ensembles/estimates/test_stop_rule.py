"""The rule that ends a study early: at the same replicate whoever runs it, and narrow enough."""

import math

import numpy as np
import pytest

from flocsim.ensembles.config.schema import StopConfig
from flocsim.ensembles.estimates.statistics import CODES, count, tabulate
from flocsim.ensembles.estimates.stop_rule import StopRule, borders
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.runner import run, run_to_file
from flocsim.ensembles.storage.resume import NEW, RESUME
from flocsim.io.results.file import read_results
from tests.helpers.results_files import same_data
from tests.helpers.small_study import small_config
from tests.helpers.synthetic_results import bonds_of
from tests.helpers.tiers import rest_slow

RULE = {"half_width": 0.12, "least": 10}
SPHERES = {"shapes": {"vertices": [1]}, "replicates": 300}


def test_looks_are_fixed_and_end_with_all():
    assert borders(StopConfig(), 1000) == [1000]
    assert borders(StopConfig(half_width=0.1), 200) == [100, 125, 157, 197, 200]
    assert borders(StopConfig(half_width=0.1, least=300), 200) == [200]


def half_widths(table, names=("pr_inside", "pr_a")):
    """Half the widths of the intervals."""
    return [0.5 * (table[f"{name}_high"] - table[f"{name}_low"]) for name in names]


def test_a_study_ends_at_the_first_look_that_is_narrow_enough(tmp_path):
    results = run(small_config(tmp_path, SPHERES | {"stop": RULE}))
    looks = borders(StopConfig(**RULE), 300)
    assert results.count in looks[:-1]
    assert np.max(half_widths(results.probabilities)) <= 0.12
    before = looks[looks.index(results.count) - 1]
    codes = (results.replicates[name][..., :before] for name in CODES)
    assert np.max(half_widths(tabulate(*codes))) > 0.12


@pytest.mark.slow
def test_it_is_the_beginning_of_the_study_without_a_rule(tmp_path):
    ended = run(small_config(tmp_path, SPHERES | {"stop": RULE}))
    whole = run(small_config(tmp_path, SPHERES))
    for name, values in ended.replicates.items():
        np.testing.assert_array_equal(values, whole.replicates[name][..., : ended.count])


def test_the_study_goes_on_where_the_rule_is_made_stricter(tmp_path):
    config = small_config(tmp_path, SPHERES | {"stop": RULE})
    run_to_file(config, Communicator(), tmp_path / "r.h5", NEW)
    first = read_results(tmp_path / "r.h5").count
    stricter = small_config(tmp_path, SPHERES | {"stop": RULE | {"half_width": 0.05}})
    ended = run_to_file(stricter, Communicator(), tmp_path / "r.h5", RESUME)
    second = read_results(tmp_path / "r.h5").count
    assert second > first
    assert ended.computed >= 4 * (second - first)
    run_to_file(stricter, Communicator(), tmp_path / "fresh.h5", NEW)
    assert same_data(tmp_path / "r.h5", tmp_path / "fresh.h5") == []


class Drawn:
    """A store of made-up outcomes of one condition."""

    conditions = (None,)

    def __init__(self, outcome):
        """The outcomes: 0, inside and aggregated, or 1, inside and departed."""
        self.outcome = outcome

    def read(self, place, name, first, stop):
        """Part of a column; all are inside, and those that hold do so for good."""
        part = self.outcome[first:stop]
        return {"outcome": part, "inside": np.ones_like(part), "bond": bonds_of(part)}[name]


def ended_at(outcome, stop):
    """How many of the outcomes the rule lets a study have."""
    rule = StopRule(stop, Drawn(outcome))
    return next(look for look in borders(stop, len(outcome)) if rule(look) or look == len(outcome))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "studies"),
    rest_slow(
        [(0.8, 100), (0.1, 400), (0.5, 400), (0.8, 400)], lambda share, studies: studies < 400
    ),
)
def test_intervals_of_a_study_that_was_ended_still_cover(share, studies):
    rng = np.random.default_rng(11)
    stop = StopConfig(half_width=0.08)
    covered = 0
    for _ in range(studies):
        outcome = (rng.random(1000) >= share).astype(int)
        number = ended_at(outcome, stop)
        assert number < 1000
        table = tabulate(outcome[:number], np.ones(number, int), bonds_of(outcome[:number]))
        covered += table["pr_a_low"] <= share <= table["pr_a_high"]
    spread = math.sqrt(0.95 * 0.05 / studies)
    assert -3.7 * spread < covered / studies - 0.95 < 3.2 * spread


def test_a_condition_without_events_holds_nothing_up():
    rule = StopRule(StopConfig(half_width=0.01), Drawn(np.full(100, 4)))
    counts = count(np.full(5, 4), np.full(5, 255), np.full(5, 255))
    assert rule.is_narrow(counts)
