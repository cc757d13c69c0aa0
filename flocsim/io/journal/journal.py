"""The journal of an unfinished study: finished chunks, appended as they come, whole or not at all.

One process writes it, rank 0's. What a killed process left half written is cut off when the file
is opened again; a chunk that was damaged later is named, passed over and computed again.
"""

import contextlib
import io
import os
import time
from pathlib import Path

from flocsim.errors import FileError
from flocsim.io.files import ordinary_target, sync_folder, unwritable
from flocsim.io.journal.records import MARK, Damage, Record, scan

SUFFIX = ".journal"

LOCK_SECONDS = 10.0
"""Seconds to wait for a job that is just dying to let go of the journal."""

SYNC_SECONDS = 5.0
"""Seconds between two syncs to the disk: what a power cut may cost. A kill costs nothing."""


def journal_path(results: str | Path) -> Path:
    """Where the journal of a results file lies: beside it."""
    target = ordinary_target(results)
    return target.with_name(target.name + SUFFIX)


def lock(file, path):
    try:
        import fcntl
    except ImportError:
        return
    until = time.monotonic() + LOCK_SECONDS
    while True:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if time.monotonic() > until:
                raise FileError(
                    f"{path} is being written by another job: wait for it, or name another output"
                ) from None
            time.sleep(0.05)
        except OSError:
            return  # a file system without locks


class Journal:
    """An open journal. ``records`` and ``damage`` are what was found in it."""

    def __init__(self, path: Path) -> None:
        """Open, lock and read the journal at ``path``, or start one; FileError if impossible."""
        self.path = path
        try:
            self.file = open(path, "a+b", buffering=0)  # noqa: SIM115 (closed by `close`)
        except OSError as error:
            raise unwritable(path, error) from error
        lock(self.file, path)
        with open(path, "rb") as reader:
            # A first record that was cut short is no reason to refuse the file.
            self.is_cut_short = MARK.startswith(reader.read(len(MARK)))
            found = list(scan(reader))
        self.damage = [each for each in found if isinstance(each, Damage)]
        self.records = [each for each in found if not isinstance(each, Damage)]
        self.end = found[-1].start if found and isinstance(found[-1], Damage) else self.size()
        self.synced = time.monotonic()
        sync_folder(path.parent)

    def size(self) -> int:
        return self.file.seek(0, os.SEEK_END)

    def append(self, record: bytes) -> int:
        """Append a record's bytes; the place at which they begin. FileError where that fails,
        and then the journal is what it was before."""
        start = self.end
        try:
            if self.size() > start:  # what a killed process has left half written
                self.file.truncate(start)
            view = memoryview(record)
            while view:
                view = view[self.file.write(view) :]
            self.end += len(record)
            if time.monotonic() - self.synced > SYNC_SECONDS:
                self.sync()
        except OSError as error:
            with contextlib.suppress(OSError):
                self.file.truncate(start)
            self.end = start
            raise unwritable(self.path, error) from error
        return start

    def read(self, offset: int, length: int) -> bytes:
        return os.pread(self.file.fileno(), length, offset)

    def sync(self) -> None:
        try:
            os.fsync(self.file.fileno())
        except OSError as error:
            raise unwritable(self.path, error) from error
        self.synced = time.monotonic()

    def remove(self) -> None:
        """Delete the file: what was in it is in the results."""
        with contextlib.suppress(OSError):
            os.unlink(self.path)
        self.file.close()

    def close(self) -> None:
        self.file.close()

    def drop_if_empty(self) -> None:
        """Let go of the file, and leave none behind in which there is nothing."""
        if self.size() == 0:
            self.remove()
        self.file.close()


class MemoryJournal:
    """The same in memory, for a study that is run from Python."""

    def __init__(self) -> None:
        self.file = io.BytesIO()
        self.records: list[Record] = []
        self.damage: list[Damage] = []
        self.path = "memory"

    def append(self, record: bytes) -> int:
        start = self.file.seek(0, os.SEEK_END)
        self.file.write(record)
        return start

    def read(self, offset: int, length: int) -> bytes:
        with self.file.getbuffer() as view:
            return bytes(view[offset : offset + length])

    def sync(self) -> None:
        """Nothing to wait for."""

    def remove(self) -> None:
        """Nothing to delete."""
