"""Open HDF5 files, with the HDF5 library in a process of its own (`flocsim.io.hdf5_child`).

That process describes the file; numbers are read here, from where they lie in it. It is forked,
which takes some ms; where that is not safe it is started anew, in 0.2 s. It has no descriptor but
the file and a pipe, and does not outlive its limit of time, whatever becomes of this process.
"""

import contextlib
import json
import math
import os
import signal
import subprocess
import sys
import threading
import warnings
from typing import Any, BinaryIO

import attrs
import numpy as np

from flocsim.errors import FileError, visible
from flocsim.io import hdf5_child
from flocsim.io.seals import CHANGED, check_seal, end_of, open_file
from flocsim.process import BLAS_THREADS, LAUNCHER_RANKS, SIGNALS, WAITING

MPI_VARIABLES = ("PMI", "OMPI_", "MPI")
"""How names of variables begin that make a process a rank, which a child of a rank is not."""


LONGEST = 300
"""Characters of what the HDF5 library says."""


class Unfit(ValueError):
    """What a file holds that flocsim does not write, in a line without the file's name."""


@attrs.frozen(eq=False)
class Node:
    """A group (``type`` None) or a dataset: its type ("f8", "i8", "i4", "u1" or "text"), its shape,
    where its numbers lie in the file, its attributes {name: value} (but for units and the like,
    which are known from the schema), and its text in one list."""

    type: str | None
    shape: tuple[int, ...]
    offset: int | None
    attributes: dict[str, Any]
    text: list[str] | None


class File(dict[str, Node]):
    """An open HDF5 file: {path: Node} of all that is in it, "" being its root.

    It stays open, so that its numbers can be read whatever takes its place, until nobody refers to
    it any more. A reader takes it in the place of its path, and opens nothing then.
    """

    def __init__(self, path: str | os.PathLike, data: BinaryIO) -> None:
        self.path, self.data = path, data
        self.seal = check_seal(path, data)
        for name, (kind, shape, *more) in describe(path, data).items():
            self[name] = Node(kind, tuple(shape), *more)

    def __del__(self) -> None:
        self.data.close()

    def __fspath__(self) -> str:
        return os.fspath(self.path)

    def __str__(self) -> str:
        return str(self.path)

    @property
    def attributes(self) -> dict[str, Any]:
        """Return the attributes of the root."""
        return self[""].attributes

    @property
    def kind(self) -> str:
        """Return the kind of file that it says it is, to be shown; "" where it says none."""
        found = self.attributes.get("kind", self.attributes.get("format", ""))
        return visible(str(found)[:LONGEST], "")

    def names(self, group: str) -> list[str]:
        """Return the names of what is in a group."""
        parts = (path.rpartition("/") for path in self if path)
        return [name for above, _, name in parts if above == group]

    def node(self, path: str) -> Node:
        """Return a dataset; Unfit where there is none."""
        if path not in self or self[path].type is None:
            raise Unfit(f"{path} is missing")
        return self[path]

    def read(self, path: str, at: tuple = ()) -> np.ndarray:
        """Return the values of a dataset, texts as objects; Unfit where there is none.

        ``at``: all of it for (), or some numbers for (indices along all axes but the last, slice).
        FileError where another file has been copied over this one.
        """
        node = self.node(path)
        if end_of(self.data) != self.seal:
            raise FileError(f"{self.path} {CHANGED}")
        if node.text is not None:
            return np.array(node.text, object).reshape(node.shape)
        first, shape, dtype = 0, node.shape, np.dtype(f"<{node.type}")
        if at:
            *place, part = at
            start, stop, _ = part.indices(shape[-1])
            row = int(np.ravel_multi_index((*place, 0), (*shape[:-1], 1)))
            first, shape = row * shape[-1] + start, (stop - start,)
        self.data.seek((node.offset or 0) + first * dtype.itemsize)
        return np.fromfile(self.data, dtype, math.prod(shape)).reshape(shape)


def open_hdf5(path: str | os.PathLike) -> File:
    """Open a file whose checksum is right, or return one that is open.

    Raises Unfit for all that flocsim does not write, and FileError for another checksum and for a
    file that the HDF5 library fails on.
    """
    return path if isinstance(path, File) else File(path, open_file(path))


def describe(path: object, data: BinaryIO) -> dict[str, list]:
    """Return {path: [type, shape, offset, attributes, text]} of all that is in an open file."""
    # The other process may move the place in the file that both have, which a buffer does not
    # notice unless it is sought from the end.
    seconds = hdf5_child.cpu_seconds(data.seek(0, os.SEEK_END))
    text = describe_forked(data) if can_fork() else describe_spawned(data, seconds)
    data.seek(0, os.SEEK_END)
    try:
        found = json.loads(text.rpartition(b"\n")[2])  # behind what others print as Python starts
    except ValueError:
        raise FileError(
            f"{path} is damaged or hostile: the HDF5 library crashed, or took more than {seconds} "
            "s; use a copy or run it again"
        ) from None
    if "refused" in found:
        raise Unfit(visible(found["refused"][:LONGEST], ""))
    nodes: dict[str, list] = found["nodes"]
    return nodes


def can_fork() -> bool:
    """Return True where a forked process is safe.

    Not beside threads of others, whose locks it would have for ever, nor under MPI, nor on macOS,
    whose libraries may not be used in one. Our own threads only wait.
    """
    others = [each for each in threading.enumerate() if each is not threading.current_thread()]
    return (
        sys.platform == "linux"
        and "mpi4py.MPI" not in sys.modules
        and not any(name in os.environ for name in LAUNCHER_RANKS)
        and all(each.name.startswith(WAITING) for each in others)
    )


def describe_forked(data: BinaryIO) -> bytes:
    """Return what a forked process writes, "" where it is ended."""
    import h5py  # noqa: F401 (so that the process has it)

    reading, writing = os.pipe()
    # Signals of a terminal go to both processes: this one answers them. None comes in between.
    # The child is forked with all of them blocked, and stays so.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        with warnings.catch_warnings():
            # Python counts the threads of numpy's libraries, too, which are idle.
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
        if child == 0:
            run_forked(data.fileno(), writing)
        os.close(writing)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    with open(reading, "rb") as pipe:
        try:
            return pipe.read()
        except BaseException:
            os.kill(child, signal.SIGKILL)
            raise
        finally:
            os.waitpid(child, 0)


def run_forked(file: int, writing: int) -> None:
    """Describe the file; never returns. All else that this process has open belongs to another."""
    try:
        signal.set_wakeup_fd(-1)
        # All stay blocked, but for the one that ends it when its CPU time is up.
        signal.signal(signal.SIGXCPU, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGXCPU])
        own = os.dup(file), os.dup(writing), os.open(os.devnull, os.O_WRONLY)
        for place, each in enumerate(own):
            os.dup2(each, place)
        os.closerange(3, max(map(int, os.listdir("/proc/self/fd"))) + 1)
        hdf5_child.main()
    finally:
        os._exit(2)


def describe_spawned(data: BinaryIO, seconds: int) -> bytes:
    """Return what a new process writes, "" where it is ended."""
    variables = {
        name: value for name, value in os.environ.items() if not name.startswith(MPI_VARIABLES)
    } | {BLAS_THREADS: "1"}  # fmt: skip
    with contextlib.suppress(subprocess.TimeoutExpired):
        return subprocess.run(
            [sys.executable, "-I", hdf5_child.__file__, *filter(None, sys.path)],
            stdin=data, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=variables,
            start_new_session=True, check=False, timeout=hdf5_child.PATIENCE * seconds,
        ).stdout  # fmt: skip
    return b""
