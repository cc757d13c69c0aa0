"""A study of spheres in many small chunks, and the results of its undisturbed run."""

import pytest

from flocsim.ensembles.parallel import coordinator
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.runner import run_to_file
from flocsim.ensembles.storage.resume import NEW
from tests.helpers.small_study import small_config


@pytest.fixture(autouse=True)
def short_chunks(monkeypatch):
    """Chunks of one replicate or two, so that there are many."""
    monkeypatch.setattr(coordinator, "chunk_seconds", lambda size: 1e-9)


@pytest.fixture(scope="session")
def whole(tmp_path_factory):
    """The results file of an undisturbed run of 2 × 1 × 2 × 20 replicates."""
    folder = tmp_path_factory.mktemp("whole")
    config = small_config(folder, {"shapes": {"vertices": [1]}, "replicates": 20})
    run_to_file(config, Communicator(), folder / "r.h5", NEW)
    return folder / "r.h5"
