"""The seals of HDF5 files: a checksum by which damage is found before HDF5 parses anything.

It lies behind the end of the HDF5 data, where every HDF5 library ignores it: a damaged HDF5 file
can crash its reader or keep it busy for ever, a wrong checksum cannot. Files that were written
before the first release may end in a table instead, of the length (u8, little-endian) and the
blake2b-256 of each of their pieces, from the first byte to the last, and a last line: PIECES_MARK,
the number of pieces (16 hex digits), a blank, the blake2b-256 of the table (64 hex digits).
"""

import contextlib
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import attrs
import numpy as np

from flocsim.errors import FileError

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
SEAL_MARK = b"\nflocsim blake2b-256 "
SEAL_LENGTH = len(SEAL_MARK) + 64 + 1
DAMAGED = "is damaged, its checksum is wrong: use a copy or run it again"

PIECE = np.dtype([("length", "<u8"), ("digest", "V32")])
PIECES_MARK = b"\nflocsim blake2b-256 of pieces "
PIECES_LINE = len(PIECES_MARK) + 16 + 1 + 64 + 1
"""Length of the last line."""

BLOCK = 2**20
"""Bytes that are read at a time."""


def digest_of(data: bytes | memoryview, size: int = 32) -> bytes:
    """The blake2b digest of some data, of so many bytes."""
    return hashlib.blake2b(data, digest_size=size).digest()


def is_in_pieces(file: BinaryIO) -> bool:
    """Whether an open file ends in a seal of this kind, be it right or wrong."""
    file.seek(max(file.seek(0, os.SEEK_END) - PIECES_LINE, 0))
    return file.read(PIECES_LINE).startswith(PIECES_MARK)


def size_of_pieces(file: BinaryIO) -> int | None:
    """How many bytes lie before the seal of an open file, every piece of which is whole.

    None where anything is not as it was written.
    """
    end = file.seek(0, os.SEEK_END) - PIECES_LINE
    file.seek(max(end, 0))
    line = file.read()
    try:
        number = int(line[len(PIECES_MARK) : len(PIECES_MARK) + 16], 16)
    except ValueError:
        return None
    size = end - number * PIECE.itemsize
    if number < 1 or size < 0:
        return None
    file.seek(size)
    table = file.read(number * PIECE.itemsize)
    if line != PIECES_MARK + f"{number:016x} {digest_of(table).hex()}\n".encode():
        return None
    place = 0
    for length, digest in np.frombuffer(table, PIECE).tolist():
        if digest_at(file, place, length) != (digest, length):
            return None
        place += length
    return size if place == size else None


def digest_at(file: BinaryIO, place: int, length: int) -> tuple[bytes, int]:
    """(digest, length) of the data at a place in an open file, which may be shorter than asked
    for."""
    found, left = hashlib.blake2b(digest_size=32), length
    file.seek(place)
    while left and (block := file.read(min(left, BLOCK))):
        found.update(block)
        left -= len(block)
    return found.digest(), length - left


def seal_of(digest):
    return SEAL_MARK + digest.hex().encode() + b"\n"


@attrs.frozen
class Held(os.PathLike):
    """A path, and the end of the file that lay there, which has the digest of all of it: whoever
    reads it later, wherever a path is taken, reads that file or is told that it has changed."""

    path: Path
    end: bytes

    def __fspath__(self) -> str:
        return os.fspath(self.path)

    def __str__(self) -> str:
        return str(self.path)


def held(path: str | os.PathLike) -> str | os.PathLike:
    """A path to be read more than once, as Held; as it is, where no ordinary file lies there."""
    if isinstance(path, Held) or not os.path.isfile(path):
        return path
    try:
        with open(path, "rb") as file:
            return Held(Path(path), end_of(file))
    except OSError:
        return path  # who reads it says so


def end_of(file):
    """The end of an open file, whichever seal it has."""
    file.seek(max(file.seek(0, os.SEEK_END) - max(SEAL_LENGTH, PIECES_LINE), 0))
    return file.read()


def seal(data: bytes) -> bytes:
    """The bytes of an HDF5 file with their checksum appended."""
    return data + seal_of(digest_of(data))


def seal_file(file: BinaryIO) -> None:
    """Append the checksum of an open file to it."""
    file.flush()
    digest, _ = digest_at(file, 0, file.seek(0, os.SEEK_END))
    file.seek(0, os.SEEK_END)
    file.write(seal_of(digest))


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
        if isinstance(path, Held) and path.end != end_of(file):
            raise FileError(f"{path} has changed since it was opened: open it again")
        file.seek(0)
        size = check_seal(path, file)
        file.seek(0)
        yield file, size


def check_seal(path, file):
    """The size of the data before the seal; FileError where either is wrong."""
    if not file.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE:
        raise FileError(f"{path} is not an HDF5 file: name a file written by flocsim")
    if is_in_pieces(file):
        if (size := size_of_pieces(file)) is None:
            raise FileError(f"{path} {DAMAGED}")
        return size
    size = max(file.seek(0, os.SEEK_END) - SEAL_LENGTH, 0)
    file.seek(size)
    tail = file.read()
    if not tail.startswith(SEAL_MARK):
        raise FileError(
            f"{path} does not end in flocsim's checksum: it is not from flocsim, was truncated or "
            "was changed by another program; use the original file"
        )
    if seal_of(digest_at(file, 0, size)[0]) != tail:
        raise FileError(f"{path} {DAMAGED}")
    return size
