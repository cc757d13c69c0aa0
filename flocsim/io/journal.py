"""The journal of an unfinished study: finished chunks, appended as they come, whole or not at all.

One process writes it, rank 0's, by the one descriptor that it has locked. What a killed process
left half written is cut off when the file is opened again; a chunk that was damaged later is named,
passed over and computed again.

A lock holds for an inode, not for a name: a job that waited for one may find that the file has
been deleted or put aside since, and would write where nobody looks. So whoever gets the lock
compares what is locked with what bears the name, and opens anew where they differ; and nobody
deletes or renames anything but the very file that it has locked.
"""

import contextlib
import io
import os
import stat
import time
from pathlib import Path

from flocsim.errors import FileError
from flocsim.io.files import give_name, lock, names, ordinary_target, sync_folder, unwritable
from flocsim.io.records import MARK, SESSION, Damage, Record, kind_of, scan
from flocsim.io.seals import BLOCK

SUFFIX = ".journal"

SYNC_SECONDS = 5.0
"""Seconds between two syncs to the disk: what a power cut may cost. A kill costs nothing."""

LOCK_SECONDS = 10.0
"""Seconds to wait for a job that is just dying, or just finishing, to let go of the file."""

LOOK_SECONDS = 0.05
"""Seconds between two tries to get the lock."""

MOST_COPIES = 1000
"""Names NAME.1, NAME.2, … that are tried for a file that is put aside."""

OPEN = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)


def journal_path(results: str | Path) -> Path:
    """Where the journal of a results file lies: beside it."""
    target = ordinary_target(results)
    return target.with_name(target.name + SUFFIX)


class Journal:
    """An open journal. ``records`` and ``damage`` are what was found in it; ``end`` is where the
    next record goes, ``known`` how long this process has left the file."""

    def __init__(self, path: Path) -> None:
        """Open, lock and read the journal at ``path``, or start one; FileError if impossible."""
        self.path = path
        self.records: list[Record] = []
        self.damage: list[Damage] = []
        self.open()

    def open(self):
        self.file = LockedFile(self.path)
        try:
            self.read_all()
        except OSError as error:
            self.file.close()
            raise unwritable(self.path, error) from error
        self.known = self.size()
        self.synced = time.monotonic()

    def read_all(self):
        with open(self.file.descriptor, "rb", closefd=False) as reader:
            found = list(scan(reader))
            self.end = reader.seek(0, os.SEEK_END)
            reader.seek(0)
            begun = MARK.startswith(reader.read(len(MARK))) or not found
        self.damage = [each for each in found if isinstance(each, Damage)]
        self.records = [each for each in found if not isinstance(each, Damage)]
        if found and isinstance(found[-1], Damage):
            self.end = found[-1].start
        self.is_journal = bool(self.records) or begun
        only_begun = all(each.kind == SESSION for each in self.records)
        self.is_blank = self.is_journal and only_begun and all(each.is_cut for each in self.damage)

    @property
    def has_lock(self) -> bool:
        """False on a file system without locks."""
        return self.file.has_lock

    def size(self) -> int:
        return os.fstat(self.file.descriptor).st_size

    def append(self, record: bytes) -> int:
        """Append a record's bytes; the place at which they begin. FileError where that fails,
        and then the journal is what it was before."""
        start, descriptor = self.end, self.file.descriptor
        try:
            self.trim()
            view = memoryview(record)
            while view:
                written = os.pwrite(descriptor, view, self.end)
                view, self.end = view[written:], self.end + written
            self.known = self.end
            self.is_blank &= kind_of(record) == SESSION
            if time.monotonic() - self.synced > SYNC_SECONDS:
                self.sync()
        except OSError as error:
            if isinstance(error, FileError):
                raise
            with contextlib.suppress(OSError):
                os.ftruncate(descriptor, start)
            self.end = self.known = start
            raise unwritable(self.path, error) from error
        return start

    def trim(self):
        """Cut off what a killed process has left half written; FileError where the file is not as
        this process has left it: without locks two jobs may write one."""
        if not self.is_as_left():
            raise FileError(
                f"{self.path} was changed by another program while this run wrote to it; what is "
                "intact in it is kept: make sure that nothing else writes there, and continue "
                "with --resume"
            )
        if self.known > self.end:
            os.ftruncate(self.file.descriptor, self.end)
            self.known = self.end

    def is_as_left(self):
        """Whether the file is as long as this process knows it."""
        try:
            return self.size() == self.known
        except OSError:
            return False

    def read(self, offset: int, length: int) -> bytes:
        """Bytes of the file, as they are now: check them against their digest."""
        try:
            return os.pread(self.file.descriptor, length, offset)
        except OSError as error:
            raise FileError(f"{self.path} could not be read: {error.strerror}") from error

    def sync(self) -> None:
        """See that all that was appended is on the disk, under the journal's own name.

        A name that somebody has deleted is given back; FileError where another file has it.
        """
        try:
            os.fsync(self.file.descriptor)
        except OSError as error:
            raise unwritable(self.path, error) from error
        if not self.file.is_in_place():
            self.file.put_back()
        self.synced = time.monotonic()

    def begin_anew(self) -> None:
        """Forget what is in the file, where there is nothing that was computed."""
        assert self.is_blank, "a journal with rows in it"
        self.records, self.damage = [], []
        self.end = 0

    def put_aside(self) -> Path:
        """Keep the file under another name, which is returned, and start a new one in its place.

        FileError where another job takes the place first.
        """
        target = self.file.put_aside()
        self.file.close()
        self.open()
        return target

    def remove(self) -> None:
        """Delete the file, and no other of its name: what was in it is in the results."""
        if self.is_as_left():
            self.file.unlink()
        self.file.close()

    def release(self) -> None:
        """Let go of the file; none is left behind that holds nothing computed."""
        if self.is_blank and self.is_as_left():
            self.file.unlink()
        self.file.close()


class MemoryJournal:
    """The same in memory, for a study that is run from Python."""

    def __init__(self) -> None:
        self.file = io.BytesIO()
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


def journal_of(path: str | Path) -> Path | None:
    """The journal to read where a command is given this path: the path itself, or the journal
    beside results that are not there yet; None where there is neither."""
    place = Path(path)
    if place.name.endswith(SUFFIX) and place.is_file():
        return place
    try:
        beside = journal_path(path)
    except FileError:
        return None
    return beside if not os.path.lexists(path) and beside.is_file() else None


def open_regular(path: Path) -> int:
    """A descriptor of the ordinary file at ``path``, which a link, a pipe or a device is not.

    FileError where it is none; nothing here waits for the other end of a pipe.
    """
    try:
        if is_regular(path):
            descriptor = os.open(path, OPEN | os.O_CREAT, 0o666)
            if stat.S_ISREG(os.fstat(descriptor).st_mode):
                return descriptor
            os.close(descriptor)
    except (OSError, ValueError) as error:
        raise unwritable(path, error) from error
    raise FileError(f"{path} is not an ordinary file: move it away, or name another output")


def is_regular(path):
    """Whether there is an ordinary file, or nothing."""
    try:
        return stat.S_ISREG(os.lstat(path).st_mode)
    except FileNotFoundError:
        return True


class LockedFile:
    """The file at ``path``, locked: ``descriptor`` reads and writes it.

    ``has_lock`` is False on a file system without locks.
    """

    def __init__(self, path: Path) -> None:
        """Open or make the file and lock it; FileError where another job keeps it."""
        self.path = path
        until = time.monotonic() + LOCK_SECONDS
        while True:
            self.descriptor = open_regular(path)
            try:
                locked = lock(self.descriptor)
            except OSError as error:
                self.close()
                raise unwritable(path, error) from error
            if locked is not False and self.is_in_place():
                break
            os.close(self.descriptor)
            if time.monotonic() > until:
                raise FileError(
                    f"{path} is being written by another job: wait for it, or name another output"
                )
            if locked is False:
                time.sleep(LOOK_SECONDS)
        self.has_lock = bool(locked)
        try:
            sync_folder(path.parent)
        except OSError as error:
            self.close()
            raise unwritable(path, error) from error

    def is_in_place(self) -> bool:
        """Whether the name still leads to this very file."""
        return names(self.path, self.descriptor)

    def unlink(self) -> None:
        """Take the file's name away, if the name is still this file's."""
        with contextlib.suppress(OSError):
            if self.is_in_place():
                os.unlink(self.path)

    def put_aside(self) -> Path:
        """Rename the file to the first of NAME.1, NAME.2, … that is free; its new path."""
        if not self.is_in_place():
            raise FileError(f"{self.path} was replaced just now: check what is there")
        descriptor, target = self.free_file()
        os.close(descriptor)
        try:
            os.replace(self.path, target)
            sync_folder(self.path.parent)
        except OSError as error:
            raise unwritable(self.path, error) from error
        return target

    def put_back(self) -> None:
        """Where the name has gone, write the file anew and give it the name; FileError where
        the name is another file's by now: then the copy is left beside it."""
        descriptor, copy = self.free_file()
        try:
            lock(descriptor)
            place = 0
            while block := os.pread(self.descriptor, BLOCK, place):
                place += os.write(descriptor, block)
            os.fsync(descriptor)
            give_name(copy, self.path)
            copy.unlink(missing_ok=True)
        except FileExistsError as error:
            os.close(descriptor)
            raise FileError(
                f"{self.path} was replaced by another file while this run wrote to it: what is "
                f"finished is in {copy}; move the other file away, rename {copy} to it, and "
                "continue with --resume"
            ) from error
        except OSError as error:
            os.close(descriptor)
            raise unwritable(copy, error) from error
        os.close(self.descriptor)
        self.descriptor = descriptor

    def free_file(self) -> tuple[int, Path]:
        """(descriptor, path) of a new empty file, the first of NAME.1, NAME.2, … to be had."""
        for number in range(1, MOST_COPIES):
            path = self.path.with_name(f"{self.path.name}.{number}")
            try:
                return os.open(path, OPEN | os.O_CREAT | os.O_EXCL, 0o666), path
            except FileExistsError:
                continue
            except OSError as error:
                raise unwritable(path, error) from error
        raise FileError(f"{self.path}.1 to .{MOST_COPIES - 1} exist: move some of them away")

    def close(self) -> None:
        """Let go of the lock; nothing can be done with the file any more."""
        if self.descriptor >= 0:
            with contextlib.suppress(OSError):
                os.close(self.descriptor)
        self.descriptor = -1
