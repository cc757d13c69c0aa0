"""Replicates of kernel studies: one point of the sequence each."""

import numpy as np
import pytest

from flocsim.ensembles.kernels.study import KernelStudy, bounds_of, study_of
from flocsim.ensembles.study import Study
from tests.helpers.kernel_study import kernel_config
from tests.helpers.small_study import small_config


@pytest.fixture
def study(tmp_path):
    return study_of(kernel_config(tmp_path))


def test_the_scene_says_which_study_it_is(study, tmp_path):
    assert isinstance(study, KernelStudy)
    assert isinstance(study.by_methods(study.methods), KernelStudy)
    assert type(study_of(small_config(tmp_path))) is Study


def test_a_replicate_has_an_offset_of_its_own(study):
    encounter = study.encounter(0, 1, study.numbers(0))
    shares = [study.share_of(encounter, 1.0, study.numbers(k)) for k in range(32)]
    largest = 1.0 + encounter.reach / encounter.outer
    assert min(shares) < -0.8 * largest and max(shares) > 0.8 * largest
    assert np.abs(shares).max() <= largest
    assert len(set(shares)) == 32


def test_the_points_are_part_of_what_rows_follow_from(study, tmp_path):
    other = study_of(kernel_config(tmp_path, scrambles=2))
    assert study.facts() != other.facts()
    assert study.facts() == study_of(kernel_config(tmp_path)).facts()


def test_no_start_is_nearer_than_what_acts_there_is_small(study):
    encounter = study.encounter(0, 1, study.numbers(0))
    for k in range(8):
        share = study.share_of(encounter, 1.0, study.numbers(k))
        place = encounter.start((0.0, 0.0), share).motion[0]
        apart = np.hypot(*(place[1, :2] - place[0, :2]))
        assert apart >= (3e-5 + encounter.start_gap) * (1.0 - 1e-6)


def test_in_a_flow_offsets_reach_as_far_as_turning_outlines(tmp_path):
    config = kernel_config(tmp_path, meeting='"shear"', scene='rate = "10 1/s"')
    study = study_of(config)
    encounter = study.encounter(0, 1, study.numbers(0))
    low, high = bounds_of(encounter, np.zeros(1), np.zeros(1))
    assert high[0] == -low[0] == encounter.outer + encounter.reach


def test_a_replicate_is_the_same_however_it_is_asked_for(study):
    again = study_of(study.config)
    again.run(0, 1, 1.0, 7)
    assert study.run(0, 1, 1.0, 5) == pytest.approx(again.run(0, 1, 1.0, 5), nan_ok=True, abs=0.0)
