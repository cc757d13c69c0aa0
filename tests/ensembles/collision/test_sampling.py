"""Random numbers that follow from (seed, replicate) and from nothing else."""

import numpy as np
import pytest
from scipy.stats import kstest

from flocsim.ensembles.collision.sampling import draws, orientations
from tests.helpers.small_study import small_study


def test_draws_repeat_and_do_not_depend_on_what_was_drawn_before():
    first = draws(5, 17)
    np.random.default_rng(0).random(3)
    draws(5, 18)
    assert draws(5, 17).tolist() == first.tolist()
    assert first.shape == (4,)


def test_other_seeds_and_replicates_give_other_numbers():
    drawn = {tuple(draws(seed, replicate)) for seed in range(20) for replicate in range(20)}
    assert len(drawn) == 400


@pytest.mark.parametrize("seed", [0, 2**63 - 1])
def test_the_ends_of_the_range_of_seeds(seed):
    numbers = draws(seed, 10**7)
    assert np.all((numbers >= 0.0) & (numbers < 1.0))


def test_draws_are_uniform_and_independent():
    table = np.array([draws(1, replicate) for replicate in range(3000)])
    for column in table.T:
        assert kstest(column, "uniform").pvalue > 1e-3
    assert np.abs(np.corrcoef(table.T) - np.eye(4)).max() < 0.07


def test_orientations_are_full_turns():
    assert orientations([0.25, 0.5, 0.9, 0.9]) == (0.5 * np.pi, np.pi)


def test_one_replicate_has_the_same_angles_and_flocs_everywhere(tmp_path):
    study = small_study(tmp_path)
    for replicate in range(3):
        numbers = draws(study.config.seed, replicate)
        flocs = set()
        for condition in range(2):
            for vertices in (4, 16):
                encounter = study.encounter(condition, vertices, numbers)
                key = next(k for k, value in study.encounters.items() if value is encounter)
                flocs.add(key[2:])
        assert len(flocs) == 1
