"""Files written whole or not at all."""

import contextlib
import errno
import itertools
import os
import secrets
import stat
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from flocsim.errors import FileError
from flocsim.io.seals import Held, digest_of, held

UNFINISHED = ".unfinished"
"""How the name of a file that is still being written ends."""

ABANDONED = 86_400.0
"""Time [s] after which such a file that nobody has written to is one of a killed process."""

NO_LOCKS = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL}
"""What a file system answers that has no locks, or whose lock server is away."""


Rule = bool | str | os.PathLike
"""What becomes of a file that lies at the place of a new one.

It is kept (False), it gets another name (True), or it is replaced, if it still is the file that was
pinned (`flocsim.io.seals.held`); any other one is kept.
"""


def is_kept(target: Path, rule: Rule) -> bool:
    """Return True if a file that exists must not be moved or replaced."""
    if isinstance(rule, Held):
        return getattr(held(target), "end", None) != rule.end
    return rule is not True


@contextlib.contextmanager
def unfinished(path: str | os.PathLike, rule: Rule = False) -> Iterator[BinaryIO]:
    """Open a fresh file beside ``path`` that takes its place, whole and synced, after the block.

    A reader meets the old file or the new one, never a part.
    ``rule`` says what becomes of a file that lies at the place; one that is kept ends the block
    before it begins, with a FileError. If it has come meanwhile, the new one is called name.1.h5,
    and the FileError says so. Raises FileError as well if the folder is missing or unwritable, the
    disk is full, or the path names something that is not an ordinary file; then nothing is left.
    """
    target = ordinary_target(path)
    if target.exists() and is_kept(target, rule):
        raise FileError(f"{path} already exists and is left as it is: name another or overwrite it")
    try:
        temporary = fresh_beside(target)
        try:
            # Exclusively: nothing that has the name already is followed or opened.
            with open(temporary, "x+b") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            place(path, temporary, target, rule)
        finally:
            temporary.unlink(missing_ok=True)
        sync_folder(target.parent)
    except FileError:
        raise
    except (OSError, ValueError) as error:
        raise unwritable(path, error) from error


def write_file(path: str | os.PathLike, data: bytes, rule: Rule = False) -> None:
    """Put ``data`` at ``path``, whole or not at all; FileError and ``rule`` as in `unfinished`."""
    with unfinished(path, rule) as file:
        file.write(data)


def make_folder(path: str | os.PathLike, option: str = "") -> None:
    """Make a folder where there is none; FileError, which names the option, if it cannot be."""
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = "it is a file" if Path(path).is_file() else error.strerror
        raise FileError(f"{option}{path} could not be made: {why}; name another folder") from error


def fresh_beside(target: Path) -> Path:
    """Return a fresh temporary name in the target's folder, short however long its name is.

    Removes files that killed processes have left of earlier tries at this target.
    """
    prefix = f".flocsim-{digest_of(os.fsencode(target.name), 6).hex()}-"
    for path in target.parent.glob(f"{prefix}*{UNFINISHED}"):
        with contextlib.suppress(OSError):
            if time.time() - path.stat().st_mtime > ABANDONED:
                path.unlink()
    return target.with_name(prefix + secrets.token_hex(8) + UNFINISHED)


def place(path: str | os.PathLike, temporary: Path, target: Path, rule: Rule) -> None:
    """Give the finished file its name; FileError if it could only have another one."""
    why = "has meanwhile been written by another program, and is left as it is"
    try:
        while not ((there := target.exists()) and is_kept(target, rule)):
            if there and isinstance(rule, Held):
                return os.replace(temporary, target)
            if there:
                set_aside(target)
            with contextlib.suppress(FileExistsError):  # written since
                return give_name(temporary, target)
    except OSError as error:  # a FileError is one
        why = f"could not be replaced ({error.strerror or error})"
    free = numbered(target, lambda name: give_name(temporary, name))
    raise FileError(f"{path} {why}: what was computed is in {free}")


def give_name(path: Path, name: Path) -> None:
    """Give a file of our own a name that is free; FileExistsError where it is not."""
    try:
        os.link(path, name)  # whoever wrote it unlinks the old name
    except FileExistsError:
        raise
    except OSError:
        rename_to_free(path, name)  # there are no hard links, as on many USB drives


def rename_to_free(path: Path, name: Path) -> None:
    """Rename any file, at once; FileExistsError if another has the name.

    The name is taken first, by an empty file of our own, that may be replaced.
    """
    with open(name, "xb"):
        pass
    try:
        os.replace(path, name)
    except OSError:
        os.unlink(name)
        raise


def numbered(target: Path, take: Callable[[Path], None]) -> Path:
    """Return the first of name.1.h5, … that ``take`` could have: it raises FileExistsError."""
    for number in itertools.count(1):
        free = target.with_name(f"{target.stem}.{number}{target.suffix}")
        with contextlib.suppress(FileExistsError):
            take(free)
            return free
    raise AssertionError


def set_aside(path: str | os.PathLike) -> Path | None:
    """Rename a file to the first of name.1.h5, name.2.h5, … that is free, and return that.

    None if there is no file by now. None is lost, whoever else does the same at the same time.
    FileError if it cannot be renamed.
    """
    target = ordinary_target(path)
    try:
        aside = numbered(target, lambda name: rename_to_free(target, name))
    except FileNotFoundError:
        return None
    except OSError as error:
        raise unwritable(path, error) from error
    sync_folder(target.parent)
    return aside


def ordinary_target(path: str | os.PathLike) -> Path:
    """Return the file at ``path``, links followed, existing or not.

    FileError for anything else: a device, a pipe, a folder, a link to itself.
    """
    try:
        target = Path(os.path.realpath(path))
        ordinary = stat.S_ISREG(os.stat(path).st_mode)
    except FileNotFoundError:
        return target  # a link to nowhere is one to a new file
    except (OSError, ValueError) as error:
        raise unwritable(path, error) from error
    if not ordinary:
        raise FileError(f"{path} is not an ordinary file: name another place to write to")
    return target


def unwritable(path: str | os.PathLike, error: Exception) -> FileError:
    """Return the FileError for a file that could not be written."""
    reason = getattr(error, "strerror", None) or error
    return FileError(
        f"{path} could not be written: {reason}; check the folder, its permissions and free space"
    )


def sync_folder(folder: Path) -> None:
    """Make a rename last through a power cut, where the system can sync a folder."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def check_writable(path: str | os.PathLike) -> None:
    """Raise FileError now, rather than after hours, if ``path`` could not be written later."""
    target = ordinary_target(path)
    try:
        probe = fresh_beside(target)
        with open(probe, "xb"):
            pass
        probe.unlink()
    except OSError as error:
        raise unwritable(path, error) from error


def lock(descriptor: int) -> bool | None:
    """Lock an open file without waiting: True, False if another process has it, None if no file
    can be locked there; OSError if that fails otherwise."""
    try:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):
        return False
    except ImportError:
        return None
    except OSError as error:
        if error.errno in NO_LOCKS:
            return None
        raise
    return True


def names(path: Path, descriptor: int) -> bool:
    """Return True if the path is that of the open file."""
    try:
        return os.path.samestat(os.lstat(path), os.fstat(descriptor))
    except OSError:
        return False
