"""Files written whole or not at all, and sealed so that damage is found before HDF5 parses them.

The seal is a checksum appended behind the end of the HDF5 data, where every HDF5 library ignores
it: a damaged HDF5 file can crash its reader or keep it busy for ever, a wrong checksum cannot.
"""

import contextlib
import errno
import hashlib
import os
import secrets
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

from flocsim.errors import FileError

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
SEAL_MARK = b"\nflocsim blake2b-256 "
SEAL_LENGTH = len(SEAL_MARK) + 64 + 1
BLOCK = 2**20
"""Bytes that are read at a time."""


def replace_file(path: str | os.PathLike, data: bytes) -> None:
    """Put ``data`` at ``path``: a reader meets the old file or the new one, never a part.

    Raises FileError if the folder is missing or unwritable, the disk is full, or the path names
    something that is not an ordinary file.
    """
    target = ordinary_target(path)
    with successor(path, target, temporary_beside(target), "xb") as file:
        file.write(data)


def replace_by_blocks(path: str | os.PathLike, size: int, blocks: Iterable[bytes]) -> None:
    """Put ``blocks`` (in order, ``size`` bytes in all) at ``path``, sealed; never a part of them.

    For files larger than the memory. The space is taken before the first block, so that a full
    disk is found at once; an unfinished file of a run that was killed is written over.
    Raises FileError as `replace_file` does.
    """
    target = ordinary_target(path)
    temporary = target.with_name(f".{target.name}.unfinished")
    with successor(path, target, temporary, "wb") as file:
        reserve(file.fileno(), size + SEAL_LENGTH)
        digest = hashlib.blake2b(digest_size=32)
        for block in blocks:
            digest.update(block)
            file.write(block)
        file.write(seal_of(digest))


def temporary_beside(target):
    return target.with_name(f".flocsim-{os.getpid()}-{secrets.token_hex(4)}.tmp")


@contextlib.contextmanager
def successor(path, target, temporary, mode):
    """An open temporary file in the target's folder that takes its place once it is synced."""
    try:
        with open(temporary, mode) as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, target)
        sync_folder(target.parent)
    except FileError:
        raise
    except (OSError, ValueError) as error:
        raise unwritable(path, error) from error
    finally:
        with contextlib.suppress(OSError, ValueError):
            temporary.unlink()


def reserve(descriptor, size):
    """Take the space of a file on the disk, where the system can; OSError where it is full."""
    if not hasattr(os, "posix_fallocate"):
        return
    try:
        os.posix_fallocate(descriptor, 0, size)
    except OSError as error:
        # Some file systems cannot; then a full disk shows when it is written to.
        if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):
            raise


def seal_of(digest):
    return SEAL_MARK + digest.hexdigest().encode() + b"\n"


def ordinary_target(path: str | os.PathLike) -> Path:
    """The file behind ``path``, links followed; renaming over a device or a folder is refused."""
    try:
        target = Path(os.path.realpath(path))
        refused = target.exists() and not target.is_file()
    except (OSError, ValueError) as error:
        raise unwritable(path, error) from error
    if refused:
        raise FileError(f"{path} is not an ordinary file: name another place to write to")
    return target


def unwritable(path: str | os.PathLike, error: Exception) -> FileError:
    reason = getattr(error, "strerror", None) or error
    return FileError(
        f"{path} could not be written: {reason}; check the folder, its permissions and free space"
    )


def sync_folder(folder: Path) -> None:
    """Make a rename last through a power cut; Windows cannot and need not open a folder."""
    if os.name != "nt":
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def seal(data: bytes) -> bytes:
    """The bytes of an HDF5 file with their checksum appended."""
    return data + seal_of(hashlib.blake2b(data, digest_size=32))


def read_sealed(path: str | os.PathLike) -> bytes:
    """The HDF5 bytes of a sealed file; FileError if it is absent, of another kind or damaged."""
    with checked_sealed(path) as (file, size):
        return file.read(size)


@contextlib.contextmanager
def checked_sealed(path: str | os.PathLike) -> Iterator[tuple[BinaryIO, int]]:
    """(open file, size of its HDF5 data), once its checksum has been found right.

    Read a block at a time, so that files larger than the memory can be checked.
    """
    try:
        if Path(path).exists() and not Path(path).is_file():
            raise FileError(f"{path} is not an ordinary file: name a results file")
        file = open(path, "rb")  # noqa: SIM115 (closed below)
    except (OSError, ValueError) as error:
        if isinstance(error, FileError):
            raise
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path} could not be read: {reason}; check the name") from error
    with file:
        size = check_seal(path, file)
        file.seek(0)
        yield file, size


def check_seal(path, file):
    """The size of the data before the seal; FileError where either is wrong."""
    if not file.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE:
        raise FileError(f"{path} is not an HDF5 file: name a file that flocsim wrote")
    size = max(file.seek(0, os.SEEK_END) - SEAL_LENGTH, 0)
    file.seek(size)
    tail = file.read()
    if not tail.startswith(SEAL_MARK):
        raise FileError(
            f"{path} does not end in flocsim's checksum: it is of another kind, was cut short or "
            "was changed by another program; use the original file"
        )
    digest, left = hashlib.blake2b(digest_size=32), size
    file.seek(0)
    while block := file.read(min(left, BLOCK)):
        digest.update(block)
        left -= len(block)
    if seal_of(digest) != tail:
        raise FileError(f"{path} is damaged, its checksum is wrong: use a copy or run it again")
    return size


def check_writable(path: str | os.PathLike) -> None:
    """FileError now, rather than after hours, if ``path`` could not be written later."""
    probe = temporary_beside(ordinary_target(path))
    try:
        with open(probe, "xb") as file:
            os.fsync(file.fileno())
    except (OSError, ValueError) as error:
        raise unwritable(path, error) from error
    finally:
        with contextlib.suppress(OSError, ValueError):
            probe.unlink()
