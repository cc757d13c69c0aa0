"""Results of swarms that earlier versions wrote are read."""

import gzip
from pathlib import Path

import h5py
import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from tests.helpers.tiers import rest_slow

STORED = Path(__file__).parents[2] / "data"


@pytest.mark.parametrize("schema", rest_slow([4, 5, 6], lambda schema: schema == 4))
def test_files_of_all_schemas_are_opened_described_and_drawn(tmp_path, monkeypatch, capsys, schema):
    monkeypatch.chdir(tmp_path)
    Path("old.h5").write_bytes(gzip.decompress((STORED / f"swarm_{schema}.h5.gz").read_bytes()))
    found = flocsim.open("old.h5")
    assert found.groups["snapshots"]["position"].shape == (1, 3, 4, 3)
    events, counts = found.groups["events"], found.groups["counts"]["clusters"]
    change = np.bincount(events["event_time"], events["event_after"] - events["event_before"], 3)
    np.testing.assert_array_equal(change[1:], np.diff(counts[0]))
    for command in ("info", "plot", "report"):
        assert main([command, "old.h5"]) == 0
    assert main(["compare", "old.h5", "old.h5"]) == 0
    assert "paired" in capsys.readouterr().out
    assert main(["export", "vtkhdf", "old.h5"]) == 0
    with h5py.File("old.vtkhdf") as file:
        assert file["VTKHDF/Steps"].attrs["NSteps"] == 3
