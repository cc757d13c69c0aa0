"""Files of other schema versions are refused in one line that says what to do."""

import io

import h5py
import pytest

from flocsim.__main__ import main
from flocsim.errors import FileError
from flocsim.io.shape_library import read_library
from flocsim.io.trajectory import read_trajectory
from tests.helpers import hostile_files
from tests.helpers.sealed import seal
from tests.helpers.tiers import rest_slow

PLAIN = {
    "results": hostile_files.valid_results, "kernels": hostile_files.valid_kernel,
    "strengths": hostile_files.valid_strengths, "swarms": hostile_files.valid_swarm,
    "sweeps": hostile_files.valid_sweep, "trajectories": hostile_files.valid_trajectory,
    "libraries": hostile_files.valid_library,
}  # fmt: skip
"""What writes a valid file of each kind."""


def of_version(folder, name, change):
    """The path of a file whose schema version is `change` of its own."""
    image = io.BytesIO(PLAIN[name](folder))
    with h5py.File(image, "r+") as file:
        file.attrs["schema_version"] = change(int(file.attrs["schema_version"]))
    return hostile_files.written(folder, "v.h5", seal(image.getvalue()))


def line_of(path, name, capsys):
    """What is said of it, one line."""
    if name in ("libraries", "trajectories"):
        with pytest.raises(FileError) as caught:
            (read_trajectory if name == "trajectories" else read_library)(path)
        return str(caught.value)
    assert main(["info", str(path)]) == FileError.exit_code
    [line] = capsys.readouterr().err.splitlines()
    return line


@pytest.mark.parametrize("name", [name for name in PLAIN if name != "sweeps"])
def test_an_older_file_was_never_released(tmp_path, name, capsys):
    oldest = {"libraries": 1, "trajectories": 2}
    path = of_version(tmp_path, name, lambda version: oldest.get(name, version) - 1)
    line = line_of(path, name, capsys)
    assert "read it with the version that wrote it, or " in line


@pytest.mark.parametrize("name", rest_slow(list(PLAIN), lambda name: name in ("results", "sweeps")))
def test_a_newer_file_needs_the_flocsim_that_wrote_it(tmp_path, name, capsys):
    line = line_of(of_version(tmp_path, name, lambda version: version + 10), name, capsys)
    assert "read it with the version that wrote it" in line
