"""Open HDF5 files, with the HDF5 library in a process of its own (`flocsim.io.hdf5_child`).

That process describes the file; numbers are read here, from where they lie in it. On Linux it is
forked, which takes some ms: h5py lets no other thread hold its lock meanwhile, glibc none that of
the memory. Under MPI, whose libraries may not outlive a fork, and on other systems it is started
anew, in 0.2 s. It has no descriptor but the file and a pipe, and does not outlive its limit of
time, whatever becomes of this process.
"""

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import warnings
from typing import Any, BinaryIO

import attrs
import numpy as np

from flocsim.errors import FileError
from flocsim.io import hdf5_child
from flocsim.process import BLAS_THREADS, LAUNCHER_RANKS, SIGNALS

MPI_VARIABLES = ("PMI", "OMPI_", "MPI")
"""How names of variables begin that make a process a rank, which a child of a rank is not."""


class Unfit(ValueError):
    """What a file holds that flocsim does not write, in a line without the file's name."""


@attrs.frozen
class Node:
    """A group (``type`` None) or a dataset: its type ("f8", "i8", "i4", "u1" or "text"), its shape,
    where its numbers lie, its attributes {name: value} (None for units and the like, which are
    known from the schema), and its text in one list."""

    type: str | None
    shape: tuple[int, ...]
    offset: int | None
    attributes: dict[str, Any]
    text: list[str] | None


@attrs.frozen(eq=False)
class File:
    """An open HDF5 file: ``nodes`` {path: Node} of all that is in it, "" being its root."""

    nodes: dict[str, Node]
    data: BinaryIO

    @property
    def attributes(self) -> dict[str, Any]:
        """Those of the root."""
        return self.nodes[""].attributes

    def __contains__(self, path: str) -> bool:
        return path in self.nodes

    def names(self, group: str) -> list[str]:
        """The names of what is in a group, or in the root, in order."""
        above = f"{group}/" if group else ""
        inner = (path.removeprefix(above) for path in self.nodes if path.startswith(above))
        return [name for name in inner if name and "/" not in name]

    def node(self, path: str) -> Node:
        """A dataset; Unfit where there is none."""
        node = self.nodes.get(path)
        if node is None or node.type is None:
            raise Unfit(f"{path} is missing")
        return node

    def read(self, path: str, at: tuple = ()) -> Any:
        """The values of a dataset as an array, text as objects.

        ``at``: numbers along the first axes, and after them perhaps a slice along the next: of a
        large array only these are read.
        """
        node = self.node(path)
        if node.text is not None:
            found = np.empty(len(node.text), object)
            found[:] = node.text
            return found.reshape(node.shape)[at]
        *place, part = at if at and isinstance(at[-1], slice) else (*at, slice(None))
        inner = node.shape[len(place) :]
        kind, start = np.dtype(f"<{node.type}"), 0
        for number, length in zip(place, node.shape, strict=False):
            if not 0 <= number < length:
                raise IndexError(f"{path} has no place {number}")
            start = start * length + number
        start *= math.prod(inner)
        if inner:
            first, stop, _ = part.indices(inner[0])
            inner = (max(stop - first, 0), *inner[1:])
            start += first * math.prod(inner[1:])
        self.data.seek((node.offset or 0) + start * kind.itemsize)
        values = np.fromfile(self.data, kind, math.prod(inner))
        if len(values) < math.prod(inner):
            raise Unfit(f"the values of {path} are missing")
        return values.reshape(inner)

    def scalar(self, path: str) -> str | int | float:
        """The value of a dataset of one."""
        node = self.node(path)
        if node.shape:
            raise Unfit(f"{path} has {len(node.shape)} dimensions, expected 0")
        value: str | int | float = node.text[0] if node.text else self.read(path).item()
        return value


@attrs.frozen(eq=False)
class Dataset:
    """A dataset of numbers in an open file, which are read as they are indexed."""

    file: File
    path: str
    shape: tuple[int, ...]
    dtype: np.dtype
    offset: int | None

    @classmethod
    def of(cls, file: File, path: str) -> "Dataset":
        """The dataset at a path; Unfit where there is none."""
        node = file.node(path)
        return cls(file, path, node.shape, np.dtype(node.type), node.offset)

    def __getitem__(self, at: tuple) -> np.ndarray:
        values: np.ndarray = self.file.read(self.path, at)
        return values


def open_hdf5(path: object, data: BinaryIO, root_only: bool = False) -> File:
    """Return the File of an open file whose checksum was found right.

    ``path``: its name in messages; ``root_only``: without what is in it. Raises Unfit for all that
    flocsim does not write, and FileError for a file that the HDF5 library does not come to an end
    with.
    """
    import h5py  # noqa: F401 (so that a forked process has it)

    if sys.platform == "linux" and not is_under_mpi():
        said, status = describe_forked(data.fileno(), root_only)
    else:
        said, status = describe_spawned(data, root_only)
    # The other process may have moved the place in the file that both have, which a buffer does not
    # notice unless it is sought from the end.
    data.seek(0, os.SEEK_END)
    try:
        found = json.loads(said)
    except ValueError:
        late = status in (-signal.SIGXCPU, -signal.SIGALRM) if os.name == "posix" else status == 1
        what = (
            f"the HDF5 library took more than {hdf5_child.CPU_SECONDS} s to read it"
            if late
            else f"the HDF5 library crashed on it ({status})"
        )
        raise FileError(
            f"{path} is damaged or hostile: {what}; use a copy or run it again"
        ) from None
    if "refused" in found:
        raise Unfit(found["refused"])
    nodes = {
        name: Node(kind, tuple(shape), *rest)
        for name, (kind, shape, *rest) in found["nodes"].items()
    }
    return File(nodes, data)


def is_under_mpi() -> bool:
    """Return True in a rank of an MPI job."""
    return "mpi4py.MPI" in sys.modules or any(name in os.environ for name in LAUNCHER_RANKS)


def describe_forked(file: int, root_only: bool) -> tuple[bytes, int]:
    """(what a forked process writes, its status: −n where signal n ended it)."""
    reading, writing = os.pipe()
    # Signals of a terminal go to both processes: this one answers them. None comes in between.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # of forks beside threads
            child = os.fork()
        if child == 0:
            run_forked(file, writing, root_only, before)
    except OSError:
        os.close(reading)
        raise
    finally:
        os.close(writing)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    with open(reading, "rb") as pipe:
        try:
            said = pipe.read()
        except BaseException:
            os.kill(child, signal.SIGKILL)
            raise
        finally:
            _, status = os.waitpid(child, 0)
    return said, os.waitstatus_to_exitcode(status)


def run_forked(file: int, writing: int, root_only: bool, mask: Any) -> None:
    """Describe the file; never returns. All else that this process has open belongs to another."""
    try:
        signal.set_wakeup_fd(-1)
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN)
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        own = os.dup(file), os.dup(writing), os.open(os.devnull, os.O_WRONLY)
        for place, each in enumerate(own):
            os.dup2(each, place)
        for each in map(int, os.listdir("/proc/self/fd")):
            if each > 2:
                with contextlib.suppress(OSError):
                    os.close(each)
        hdf5_child.main(root_only)
    finally:
        os._exit(1)


def describe_spawned(data: BinaryIO, root_only: bool) -> tuple[bytes, int]:
    """(what a new process writes, its exit code: −n where signal n ended it)."""
    variables = {
        name: value for name, value in os.environ.items() if not name.startswith(MPI_VARIABLES)
    } | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), BLAS_THREADS: "1"}  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-P", hdf5_child.__file__, *(["root"] if root_only else [])],
        stdin=data, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=variables,
        start_new_session=True, check=False,
    )  # fmt: skip
    return done.stdout, done.returncode
