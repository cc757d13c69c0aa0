"""The checksum of files: damage is found before HDF5 parses anything.

It follows the HDF5 data, where every HDF5 library ignores it: a damaged HDF5 file can crash its
reader or keep it busy for ever, a wrong checksum cannot.
"""

import hashlib
import os
from pathlib import Path
from typing import BinaryIO

import attrs

from flocsim.errors import FileError

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
SEAL_MARK = b"\nflocsim blake2b-256 "
SEAL_LENGTH = len(SEAL_MARK) + 64 + 1

CHANGED = "has changed since it was opened: open it again"

BLOCK = 2**20
"""Bytes that are read at a time."""


def sha256_of(path: str | os.PathLike) -> str:
    """Return the SHA-256 checksum of a file, in hexadecimal digits; it is read piece by piece."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def digest_of(data: bytes | memoryview, size: int = 32) -> bytes:
    """Return the blake2b digest of some data, of so many bytes."""
    return hashlib.blake2b(data, digest_size=size).digest()


def seal_of(file: BinaryIO, size: int) -> bytes:
    """Return the seal of the first bytes of an open file, read a block at a time."""
    digest = hashlib.blake2b(digest_size=32)
    file.seek(0)
    for first in range(0, size, BLOCK):
        digest.update(file.read(min(BLOCK, size - first)))
    return SEAL_MARK + digest.hexdigest().encode() + b"\n"


def seal_file(file: BinaryIO) -> None:
    """Append the checksum of an open file to it."""
    file.flush()
    found = seal_of(file, file.seek(0, os.SEEK_END))
    file.seek(0, os.SEEK_END)
    file.write(found)


@attrs.frozen
class Held(os.PathLike):
    """A path pinned to the checksum ``end`` of its file.

    Reading it raises FileError if the file has changed since.
    """

    path: Path
    end: bytes

    def __fspath__(self) -> str:
        return os.fspath(self.path)

    def __str__(self) -> str:
        return str(self.path)


def held(path: str | os.PathLike) -> str | os.PathLike:
    """Pin a path that is read more than once; return it as it is where there is no such file."""
    if isinstance(path, Held) or not os.path.isfile(path):
        return path
    try:
        with open(path, "rb") as file:
            return Held(Path(path), end_of(file))
    except OSError:
        return path  # whoever reads it says so


def end_of(file: BinaryIO) -> bytes:
    """Return the end of an open file, as long as a seal."""
    file.seek(max(file.seek(0, os.SEEK_END) - SEAL_LENGTH, 0))
    return file.read()


def open_file(path: str | os.PathLike) -> BinaryIO:
    """Open an ordinary file for reading; FileError where that is impossible."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise FileError(f"{path} is not an ordinary file: name a results file")
    try:
        return open(path, "rb")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{path} could not be read: {reason}; check the name") from error


def check_seal(path: object, file: BinaryIO) -> bytes:
    """Return the seal of an open file; FileError where its checksum is not right."""
    end, size = end_of(file), max(file.tell() - SEAL_LENGTH, 0)
    if isinstance(path, Held) and path.end != end:
        raise FileError(f"{path} {CHANGED}")
    file.seek(0)
    if file.read(len(HDF5_SIGNATURE)) != HDF5_SIGNATURE:
        raise FileError(f"{path} is not an HDF5 file: name a file written by flocsim")
    if not end.startswith(SEAL_MARK):
        raise FileError(
            f"{path} does not end in flocsim's checksum: it is not from flocsim, was truncated "
            "or was changed by another program; use the original file"
        )
    if seal_of(file, size) != end:
        raise FileError(f"{path} is damaged, its checksum is wrong: use a copy or run it again")
    return end
