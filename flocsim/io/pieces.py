"""The seal of a file that several processes write: a digest of each piece, and one of all digests.

Behind the data lies a table, for each piece its length (u8, little-endian) and its blake2b-256
(32 bytes), and behind that the last line: PIECES_MARK, the number of pieces (16 hex digits), a
blank, the blake2b-256 of the table (64 hex digits), a line feed. The pieces follow each other from
the first byte to the last; whoever writes one computes its digest, so nobody reads all of it again.
"""

import hashlib
import os
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np

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
