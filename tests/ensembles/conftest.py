"""A small study of spheres, run once for all tests that want one."""

import pytest

import flocsim
from tests.helpers import parts_here
from tests.helpers.small_study import write_small


@pytest.fixture
def one_process():
    """Parts of sweeps, and studies of scripts, are run in this process."""
    with parts_here.used():
        yield


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """Its results, from two processes; its config is small.toml beside them."""
    folder = tmp_path_factory.mktemp("finished")
    study = flocsim.Study(write_small(folder)).with_({"shapes.vertices": [1]})
    return study.run(jobs=2, output=folder / "small.h5")
