"""One process's own file: opened without following anything, locked, and compared with its name.

A lock holds for an inode, not for a name: a job that waited for one may find that the file has
been deleted or put aside since, and would write where nobody looks. So whoever gets the lock
compares what is locked with what bears the name, and opens anew where they differ; and nobody
deletes or renames anything but the very file that it has locked.
"""

import contextlib
import errno
import os
import stat
import time
from pathlib import Path

from flocsim.errors import FileError
from flocsim.io.files import sync_folder, unwritable
from flocsim.io.pieces import BLOCK

LOCK_SECONDS = 10.0
"""Seconds to wait for a job that is just dying, or just finishing, to let go of the file."""

LOOK_SECONDS = 0.05
"""Seconds between two tries to get the lock."""

MOST_COPIES = 1000
"""Names NAME.1, NAME.2, … that are tried for a file that is put aside."""

NO_LOCKS = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL}
"""What a file system says that has no locks, or whose lock server is away."""

OPEN = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)


def open_regular(path: Path, flags: int = os.O_CREAT) -> int:
    """A descriptor of the ordinary file at ``path``, which a link, a pipe or a device is not.

    FileError where it is none; nothing here waits for the other end of a pipe.
    """
    try:
        if not is_regular(path):
            raise FileError(f"{path} is not an ordinary file: move it away, or name another output")
        descriptor = os.open(path, OPEN | flags, 0o666)
    except FileError:
        raise
    except (OSError, ValueError) as error:
        raise unwritable(path, error) from error
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        return descriptor
    os.close(descriptor)
    raise FileError(f"{path} is not an ordinary file: move it away, or name another output")


def is_regular(path):
    """Whether there is an ordinary file, or nothing."""
    try:
        return stat.S_ISREG(os.lstat(path).st_mode)
    except FileNotFoundError:
        return True


def lock(descriptor: int, path: Path) -> bool | None:
    """Try to lock an open file: True, or False where another has it; None without locks."""
    try:
        import fcntl
    except ImportError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except OSError as error:
        if error.errno in NO_LOCKS:
            return None
        raise unwritable(path, error) from error
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
            locked = lock_or_close(self.descriptor, path)
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
        try:
            named = os.lstat(self.path)
        except OSError:
            return False
        return os.path.samestat(os.fstat(self.descriptor), named)

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
            lock(descriptor, copy)
            place = 0
            while block := os.pread(self.descriptor, BLOCK, place):
                place += os.write(descriptor, block)
            os.fsync(descriptor)
            name_exclusively(copy, self.path)
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


def lock_or_close(descriptor, path):
    try:
        return lock(descriptor, path)
    except FileError:
        os.close(descriptor)
        raise


def name_exclusively(path, name):
    """Rename a file to a name that is free; FileExistsError where it is not."""
    try:
        os.link(path, name)
    except FileExistsError:
        raise
    except OSError:  # a file system without hard links
        if os.path.lexists(name):
            raise FileExistsError(name) from None
        os.rename(path, name)
    else:
        os.unlink(path)
