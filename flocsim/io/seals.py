"""The seals of HDF5 files: checksums, by which damage is found before HDF5 parses anything.

A seal lies behind the end of the HDF5 data, where every HDF5 library ignores it: a damaged HDF5
file can crash its reader or keep it busy for ever, a wrong checksum cannot. One kind is the digest
of all data. The other, of a file that several processes write, has a digest of each piece, and one
of all digests: behind the data lies a table, for each piece its length (u8, little-endian) and its
blake2b-256 (32 bytes), and behind that the last line: PIECES_MARK, the number of pieces (16 hex
digits), a blank, the blake2b-256 of the table (64 hex digits), a line feed. The pieces follow each
other from the first byte to the last; whoever writes one computes its digest, so nobody reads all
of it again.
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


def seal_of_pieces(table: np.ndarray) -> bytes:
    """What comes behind the data of a file whose pieces are the entries (PIECE) of a table."""
    content = table.tobytes()
    line = f"{len(table):016x} {digest_of(content).hex()}\n"
    return content + PIECES_MARK + line.encode()


def seal_size(pieces: int) -> int:
    """Bytes of the seal of so many pieces."""
    return pieces * PIECE.itemsize + PIECES_LINE


def is_in_pieces(file: BinaryIO) -> bool:
    """Whether an open file ends in a seal of this kind, be it right or wrong."""
    file.seek(max(file.seek(0, os.SEEK_END) - PIECES_LINE, 0))
    return file.read(PIECES_LINE).startswith(PIECES_MARK)


def size_of_pieces(file: BinaryIO) -> int | None:
    """How many bytes lie before the seal of an open file, every piece of which is whole.

    None where anything is not as it was written. Read a block at a time: memory stays flat.
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
    found, total = hashlib.blake2b(digest_size=32), 0
    for entries in table_blocks(file, size, number):
        found.update(entries.tobytes())
        total += sum(entries["length"].tolist())
    expected = f"{number:016x} {found.hexdigest()}\n".encode()
    if line != PIECES_MARK + expected or total != size:
        return None
    place = 0
    for entries in table_blocks(file, size, number):
        for length, digest in entries.tolist():
            if digest_at(file, place, length) != (digest, length):
                return None
            place += length
    return size


def table_blocks(file: BinaryIO, start: int, number: int) -> Iterator[np.ndarray]:
    """The table of pieces that begins at a place, some thousand entries at a time."""
    step = BLOCK // PIECE.itemsize
    for first in range(0, number, step):
        file.seek(start + first * PIECE.itemsize)
        data = file.read(min(step, number - first) * PIECE.itemsize)
        yield np.frombuffer(data[: len(data) // PIECE.itemsize * PIECE.itemsize], PIECE)


def digest_at(file: BinaryIO, place: int, length: int, size: int = 32) -> tuple[bytes, int]:
    """(digest, length) of the data at a place in an open file, which may be shorter than asked
    for."""
    found, left = hashlib.blake2b(digest_size=size), length
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
