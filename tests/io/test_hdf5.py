"""Hostile HDF5 with a right checksum is refused in one line; all that flocsim writes is read."""

import contextlib
import gc
import io
import os
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest

from flocsim.ensembles.sweep import read_joined
from flocsim.errors import FileError
from flocsim.io import hdf5
from flocsim.io.hdf5 import open_hdf5
from flocsim.io.results.file import read_results
from flocsim.io.results.schema import RESULTS
from flocsim.io.results.strength_file import read_strengths
from flocsim.io.results.swarm_file import SWARMS
from flocsim.io.shape_library import read_library, read_settings
from flocsim.io.trajectory import read_trajectory
from tests.helpers import hostile_files
from tests.helpers.results_files import write_results
from tests.helpers.sealed import read_sealed, seal
from tests.helpers.small_study import write_star_library
from tests.helpers.synthetic_results import make_results

SMALL = {"types": ("I", "II"), "vertices": (1, 8), "delta": (0.0, 0.7), "count": 5}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The results file that each test gets a copy of."""
    path = tmp_path_factory.mktemp("written") / "r.h5"
    write_results(path, make_results(**SMALL))
    return path


@pytest.fixture
def results(written, tmp_path):
    """A results file."""
    return shutil.copy(written, tmp_path / "r.h5")


@pytest.fixture
def library(tmp_path):
    """A shape library."""
    write_star_library(tmp_path / "l.h5", vertices=(1, 4))
    return tmp_path / "l.h5"


def changed(path, change):
    """The file with its HDF5 content changed through h5py and sealed anew."""
    image = io.BytesIO(read_sealed(path))
    with h5py.File(image, "r+") as file:
        change(file)
    path.write_bytes(seal(image.getvalue()))


def read_all(path):
    """Read results with all columns of their replicates."""
    return dict(read_results(path).replicates)


def refused(path, match=None):
    """Every reader of the file refuses it, in one line that names it."""
    reading = read_all if path.name.startswith("r") else read_library
    with pytest.raises(FileError, match=match) as caught:
        reading(path)
    assert str(path) in str(caught.value)
    assert str(caught.value).isprintable()
    return str(caught.value)


def virtual(file, name):
    plan = h5py.VirtualLayout(shape=(4,), dtype="f8")
    plan[:] = h5py.VirtualSource("other.h5", "x", shape=(4,))
    file.create_virtual_dataset(name, plan)


def external(file, name):
    file.create_dataset(name, (4,), "u1", external=[(os.devnull, 0, 4)])


def bomb(file, name):
    file.create_dataset(name, (2**20, 2**20), "u1", chunks=(2**10, 2**10), compression="gzip")


def fill(file, name):
    file.create_dataset(name, (2**20,), "f8", fillvalue=7.0)


def circle(file, name):
    file[name] = file[name.partition("/")[0]]


def named(file, name):
    file[name] = np.dtype("f8")


def promised(file, name):
    plan = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    plan.set_alloc_time(h5py.h5d.ALLOC_TIME_LATE)
    file.create_dataset(name, (2, 2, 2, 5), "f8", dcpl=plan)


LAYOUT = "a type, a shape or a layout"
INSTEAD = {
    "external": (external, LAYOUT),
    "virtual": (virtual, LAYOUT),
    "packed": (bomb, LAYOUT),
    "filled": (fill, "are missing"),
    "promised": (promised, "are missing"),
    "soft link": (lambda f, n: f.__setitem__(n, h5py.SoftLink("/run")), "no group and no dataset"),
    "external link": (lambda f, n: f.__setitem__(n, h5py.ExternalLink(os.devnull, "/")), "no gro"),
    "circle of groups": (circle, "no group and no dataset"),
    "group": (lambda f, n: f.create_group(n), "is missing"),
    "named type": (named, "no group and no dataset"),
    "empty": (lambda f, n: f.__setitem__(n, h5py.Empty("f8")), LAYOUT),
    "resizable": (lambda f, n: f.create_dataset(n, (3,), "f8", maxshape=(9,)), LAYOUT),
    "float32": (lambda f, n: f.__setitem__(n, np.zeros(3, "f4")), LAYOUT),
    "another type": (lambda f, n: f.__setitem__(n, np.zeros(3, "i4")), "holds i4 of shape"),
    "another rank": (lambda f, n: f.__setitem__(n, np.zeros((1,) * 6)), "expected"),
    "text": (lambda f, n: f.__setitem__(n, "a"), "holds text of shape"),
}


@pytest.mark.parametrize("kind", INSTEAD)
def test_what_stands_instead_of_values_is_refused(results, kind):
    put, said = INSTEAD[kind]

    def change(file):
        del file["replicates/d_c_max"]
        put(file, "replicates/d_c_max")

    changed(results, change)
    refused(results, said)


HANG, CRASH = "while True: pass", "os.kill(os.getpid(), 11)"


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("work", [HANG, CRASH])
def test_a_file_that_the_library_fails_on_is_refused_in_one_line(results, work):
    """A stand-in for the HDF5 library hangs, or crashes, on a file, which has a second."""
    program = f"""
import os, resource, sys, time
from flocsim.errors import FileError
from flocsim.io import hdf5_child
from flocsim.io.results.file import read_results

def described(h5py):
    resource.setrlimit(resource.RLIMIT_CPU, (1 + int(time.process_time()), 60))
    {work}

hdf5_child.described = described
try:
    read_results(sys.argv[1])
except FileError as error:
    print(error)
"""
    done = subprocess.run(
        [sys.executable, "-c", program, str(results)], capture_output=True, text=True, check=True
    )
    [line] = done.stdout.splitlines()
    assert "r.h5 is damaged or hostile: the HDF5 library crashed, or took more than" in line


@pytest.fixture
def mpi(environment):
    """Look like a rank of an MPI job."""
    environment["OMPI_COMM_WORLD_RANK"] = "0"
    return contextlib.nullcontext()


@pytest.fixture
def thread():
    """What has another thread beside this one."""
    ended = threading.Event()

    @contextlib.contextmanager
    def beside():
        threading.Thread(target=ended.wait).start()
        try:
            yield
        finally:
            ended.set()

    return beside()


@pytest.mark.parametrize("why", ["mpi", "thread"])
def test_a_process_started_anew_says_the_same(request, results, library, why):
    """Where forking is not safe."""
    before = read_results(results), read_settings(library), open_hdf5(library).kind
    with request.getfixturevalue(why):
        assert not hdf5.can_fork()
        after = read_results(results), read_settings(library), open_hdf5(library).kind
        assert before[1:] == after[1:]
        for name, values in before[0].replicates.items():
            np.testing.assert_array_equal(values, after[0].replicates[name])
        changed(results, lambda file: bomb(file, "replicates/packed"))
        refused(results, LAYOUT)


@pytest.mark.parametrize("listed", [False, True])
def test_the_modules_of_the_current_folder_are_not_run(results, in_tmp, mpi, monkeypatch, listed):
    """A process that is started anew takes its libraries from where Python has them, even if
    ``sys.path`` begins with a folder that holds others."""
    if listed:
        monkeypatch.setattr(sys, "path", [str(in_tmp), *sys.path])
    (in_tmp / "json.py").write_text("raise SystemExit(3)\n", "utf-8")
    (in_tmp / "h5py.py").write_text("raise SystemExit(3)\n", "utf-8")
    assert open_hdf5(results).kind == "flocsim results"


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
def test_no_process_and_no_descriptor_stays(results, library):
    read_results(results), read_library(library)
    gc.collect()  # of tests before this one
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(5):
        read_results(results), read_library(library)
    changed(results, lambda file: bomb(file, "replicates/packed"))
    refused(results)
    gc.collect()  # a traceback refers to the file, and to itself
    assert len(os.listdir("/proc/self/fd")) == before
    tasks = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    states = [
        Path(f"/proc/{each}/stat").read_text().rpartition(")")[2].split()[0] for each in tasks
    ]
    assert "Z" not in states


@pytest.mark.parametrize("part", [slice(1, 4), slice(3, 9), slice(0, 0), slice(0, 5)])
def test_a_part_of_an_array_is_that_part(results, part):
    with RESULTS.opened(results) as file:
        whole = file.read("replicates/angle_i")
        assert whole.shape == (2, 2, 2, 5)
        for place in np.ndindex(2, 2, 2):
            at = (*place, part)
            np.testing.assert_array_equal(file.read("replicates/angle_i", at), whole[at])
        numbers = file.read("replicates/replicate", (part,))
        np.testing.assert_array_equal(numbers, np.arange(5)[part])
        with pytest.raises(ValueError, match="invalid entry"):
            file.read("replicates/angle_i", (2, 0, 0, part))


MAKERS = (
    "results", "library", "compounds", "kernel", "strengths", "swarm", "sweep", "trajectory",
)  # fmt: skip
"""Names of what makes files, in hostile_files."""


READERS = {
    "library": read_library, "compounds": read_library, "strengths": read_strengths,
    "swarm": SWARMS.read, "sweep": read_joined, "trajectory": read_trajectory,
}  # fmt: skip


@pytest.mark.parametrize("name", MAKERS)
def test_all_that_flocsim_writes_is_read(tmp_path, name, environment):
    """By a forked process, and by one that is started anew."""
    valid = getattr(hostile_files, f"valid_{name}")(tmp_path)
    path = hostile_files.written(tmp_path, "v.h5", seal(valid))
    read = READERS.get(name, read_results)
    forked = read(path)
    environment["PMI_RANK"] = "0"
    started = read(path)
    assert type(forked) is type(started)
    assert open_hdf5(path).kind.startswith("flocsim")


def put(name, place, value):
    """A change of one value of a dataset."""

    def change(file):
        file[name][place] = value

    return change


@pytest.mark.parametrize(
    ("name", "place", "value"),
    [
        ("replicates/outcome", (0, 0, 0, 0), 8), ("replicates/inside", ..., 2),
        ("replicates/crossed_zone", (0, 0, 0, 1), 9), ("replicates/bond", (0, 0, 0, 1), 4),
        ("replicates/failure", (0, 0, 0, 1), 3), ("replicates/steps", (1, 0, 0, 1), -1),
        ("replicates/floc_i", (1, 0, 0, 1), -2),
    ],
)  # fmt: skip
def test_values_that_no_run_has_given_are_refused(results, name, place, value):
    changed(results, put(name, place, value))
    refused(results, name)


@pytest.mark.parametrize(
    ("name", "place", "value"),
    [
        ("flocs/pixel_size", 0, 0.0), ("flocs/spheroradius", 1, np.inf),
        ("flocs/centroid", (0, 1), np.nan), ("fits/4/vertices", (0, 0, 0), 1e300),
    ],
)  # fmt: skip
def test_values_that_no_floc_has_are_refused(library, name, place, value):
    changed(library, put(name, place, value))
    refused(library)


def test_settings_of_a_library_are_plain_words_and_numbers(library):
    changed(library, lambda file: file.attrs.update({"method": "pattern", "inscribed": True}))
    assert read_settings(library) == {"method": "pattern", "inscribed": True}
