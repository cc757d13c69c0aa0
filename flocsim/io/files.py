"""Files written whole or not at all."""

import contextlib
import enum
import errno
import itertools
import os
import secrets
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from flocsim.errors import FileError
from flocsim.io.seals import digest_of

UNFINISHED = ".unfinished"
"""How the name of a file that is still being written ends."""

ROOM_FOR_NUMBER = len(".9999")
"""Bytes that a name grows by when its file is set aside."""

TRIES = 9
"""Looks at a path before what was found there counts."""

NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK}
"""What file systems without hard links answer."""

NO_LOCKS = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL}
"""What a file system says that has no locks, or whose lock server is away."""

NO_SYNC = {errno.EACCES, errno.EINVAL, errno.ENOTSUP, errno.EPERM, errno.EBADF}
"""What the system answers where a folder cannot be synced, or only be written to."""


class Old(enum.Enum):
    """What becomes of a file that lies at the place of a new one."""

    KEPT = "kept"
    SET_ASIDE = "set aside"
    REPLACED = "replaced"


Rule = Callable[[Path], Old]
"""Says what becomes of the file at a path, asked at the moment in which the new one is placed."""


def keep(_: Path) -> Old:
    """The rule where nothing was said: no file is ever replaced."""
    return Old.KEPT


@contextlib.contextmanager
def unfinished(path: str | os.PathLike, rule: Rule = keep) -> Iterator[tuple[Path, BinaryIO]]:
    """(path, open file) of a fresh file beside ``path`` that takes its place, whole and synced, at
    the end of the block.

    A reader meets the old file or the new one, never a part. ``rule`` says what becomes of a file
    that lies at the place; one that is kept ends the block before it begins, with a FileError. If
    it has come meanwhile, the new one is called name.1.h5, and the FileError says so.
    What a killed process has left of an earlier try is removed. Raises FileError as well if the
    folder is missing or unwritable, the disk is full, or the path names something that is not an
    ordinary file; then nothing is left behind.
    """
    target = ordinary_target(path)
    if target.exists() and rule(target) is Old.KEPT:
        raise FileError(f"{path} already exists and is left as it is: name another place")
    try:
        remove_left_over(target)
        temporary, descriptor = fresh_beside(target)
        try:
            with os.fdopen(descriptor, "w+b") as file:
                yield temporary, file
                file.flush()
                os.fsync(file.fileno())
                if os.name == "nt":
                    file.close()  # there, an open file has no other name
                # Elsewhere it stays open: its lock keeps others from removing it.
                place(path, temporary, target, rule)
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink()
        sync_folder(target.parent)
    except FileError:
        raise
    except (OSError, ValueError) as error:
        raise unwritable(path, error) from error


def write_file(path: str | os.PathLike, data: bytes, rule: Rule = keep) -> None:
    """Put ``data`` at ``path``, whole or not at all; FileError and ``rule`` as in `unfinished`."""
    with unfinished(path, rule) as (_, file):
        file.write(data)


def make_folder(path: str | os.PathLike, option: str = "") -> None:
    """Make a folder where there is none; FileError, which names the option, if it cannot be."""
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(
            f"{option}{path} could not be made: {error.strerror}; name another folder"
        ) from error


def fresh_beside(target: Path, length: int = 0) -> tuple[Path, int]:
    """(path, open descriptor) of a new file in the target's folder, locked while it is open.

    The name is made up, of at least ``length`` bytes, and nothing that has it is followed, opened
    or waited for. OSError if no file can be made there.
    """
    exclusive = os.O_RDWR | os.O_CREAT | os.O_EXCL
    flags = exclusive | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
    while True:
        name = left_over_prefix(target) + secrets.token_hex(8)
        path = target.with_name(name.ljust(length - len(UNFINISHED), "-") + UNFINISHED)
        descriptor = os.open(path, flags, 0o666)
        with contextlib.suppress(OSError):  # as where no file can be locked
            if lock(descriptor) is False or not names(path, descriptor):
                os.close(descriptor)  # another process took it for one that was left over
                continue
        return path, descriptor


def left_over_prefix(target):
    """How the temporary names of one target begin, short however long its own name is."""
    return f".flocsim-{digest_of(os.fsencode(target.name), 6).hex()}-"


def remove_left_over(target):
    """Remove what killed processes have left of this target; what is locked is being written."""
    try:
        import fcntl  # noqa: F401
    except ImportError:
        return  # nothing would tell the one from the other
    flags = os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK
    for path in sorted(target.parent.glob(f"{left_over_prefix(target)}*{UNFINISHED}")):
        with contextlib.suppress(OSError):
            descriptor = os.open(path, flags)
            try:
                ordinary = stat.S_ISREG(os.fstat(descriptor).st_mode)
                if ordinary and lock(descriptor) and names(path, descriptor):
                    path.unlink()
            finally:
                os.close(descriptor)


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
    """Whether the path is that of the open file."""
    try:
        return os.path.samestat(os.lstat(path), os.fstat(descriptor))
    except OSError:
        return False


def place(path, temporary, target, rule):
    """Give the finished file its name; FileError if it could only have another one."""
    while True:
        try:
            give_name(temporary, target)
            return
        except FileExistsError:
            found = rule(target)
        reason = "has meanwhile been written by another program, and is left as it is"
        try:
            if found is Old.REPLACED:
                os.replace(temporary, target)
                return
            if found is Old.SET_ASIDE:
                set_aside(target)
                continue
        except OSError as error:  # a FileError is one
            reason = f"could not be replaced ({error.strerror or error})"
        free = numbered(target, lambda name: give_name(temporary, name))
        raise FileError(f"{path} {reason}: what was computed is in {free}")


def give_name(temporary: Path, name: Path) -> None:
    """Rename a file of our own; FileExistsError, whatever it is that has the name already."""
    try:
        if os.name == "nt":
            os.rename(temporary, name)
        else:
            os.link(temporary, name)  # whoever wrote it unlinks the old name
    except OSError as error:
        if error.errno not in NO_LINKS:
            raise
        rename_to_free(temporary, name)


def rename_to_free(path, name):
    """Rename any file, at once; FileExistsError if another has the name.

    The name is taken first, by an empty file of our own, that may be replaced.
    """
    os.close(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
    try:
        os.replace(path, name)
    except OSError:
        os.unlink(name)
        raise


def numbered(target: Path, take: Callable[[Path], None]) -> Path:
    """The first of name.1.h5, name.2.h5, … that ``take`` could have: it raises FileExistsError."""
    for number in itertools.count(1):
        free = target.with_name(f"{target.stem}.{number}{target.suffix}")
        with contextlib.suppress(FileExistsError):
            take(free)
            return free
    raise AssertionError


def set_aside(path: str | os.PathLike) -> Path | None:
    """Rename a file to the first of name.1.h5, name.2.h5, … that is free; the name it has now.

    None if there is no file by now. None is lost, whoever else does the same at the same time.
    FileError if it cannot be renamed.
    """
    target = ordinary_target(path)
    try:
        aside = numbered(target, lambda name: rename_to_free(target, name))
        sync_folder(target.parent)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise unwritable(path, error) from error
    return aside


def ordinary_target(path: str | os.PathLike) -> Path:
    """The file behind ``path``, links followed, there or not.

    FileError for anything else: a device, a pipe, a folder, a link to itself, a deleted file.
    """
    try:
        target = Path(os.path.realpath(path))
        refused = not any(is_ordinary(path, target) for _ in range(TRIES))
    except (OSError, ValueError) as error:
        raise unwritable(path, error) from error
    if refused:
        raise FileError(f"{path} is not an ordinary file: name another place to write to")
    return target


def is_ordinary(path, target):
    """Whether a path is that of an ordinary file or of none, and ``target`` its resolved name.

    Also False where somebody makes, moves or removes the file at this very moment.
    """
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        return not os.path.islink(target)  # a link to nowhere is one to a new file
    return stat.S_ISREG(mode) and os.path.lexists(target)


def unwritable(path: str | os.PathLike, error: Exception) -> FileError:
    reason = getattr(error, "strerror", None) or error
    return FileError(
        f"{path} could not be written: {reason}; check the folder, its permissions and free space"
    )


def sync_folder(folder: Path) -> None:
    """Make a rename last through a power cut, where the system can sync a folder."""
    if os.name == "nt":
        return
    try:
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
    except OSError as error:
        if error.errno not in NO_SYNC:
            raise


def check_writable(path: str | os.PathLike, suffix: str = "") -> None:
    """FileError now, rather than after hours, if ``path`` could not be written later.

    A file is made beside it, and removed, whose name is as long as the longest that will be
    needed: that of ``path`` with ``suffix`` and the number of a file that is set aside.
    """
    target = ordinary_target(path)
    longest = len(os.fsencode(target.name)) + len(os.fsencode(suffix)) + ROOM_FOR_NUMBER
    try:
        remove_left_over(target)
        probe, descriptor = fresh_beside(target, longest)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
            probe.unlink()
    except OSError as error:
        raise unwritable(path, error) from error
