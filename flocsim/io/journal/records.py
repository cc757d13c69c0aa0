"""Records of a journal: a head, a description and data, with checksums over all of it.

    head         mark (8 bytes), kind (u4), length of the description (u4), length of the data (u8),
                 blake2b-128 of the data, blake2b-64 of the head before it and the description
    description  JSON, UTF-8
    data         bytes

Little-endian. The lengths are believed only where the head's checksum is right; where it is not,
the next record is looked for by its mark.
"""

import hashlib
import json
import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

import attrs

from flocsim.io.json_text import read_json

MARK = b"\x93FLOCREC"
HEAD = struct.Struct("<8sIIQ16s8s")
CHECKED = HEAD.size - 8
LONGEST_DESCRIPTION = 2**24
LONGEST_DATA = 2**32
BLOCK = 2**20

SESSION, CHUNK = 1, 2
"""Kinds: what a run was started with; rows of finished replicates."""


@attrs.frozen
class Record:
    """One whole record: its kind, its description, and where its data lie in the file."""

    kind: int
    description: dict[str, Any]
    offset: int
    length: int


@attrs.frozen
class Damage:
    """Bytes [start, stop) of a journal that are no whole record, and what they held, if known."""

    start: int
    stop: int
    description: dict[str, Any] | None = None


def digest(data, size):
    return hashlib.blake2b(data, digest_size=size).digest()


def encode(kind: int, description: dict[str, Any], data: bytes = b"") -> bytes:
    words = json.dumps(description, sort_keys=True, ensure_ascii=False).encode("utf-8", "replace")
    head = HEAD.pack(MARK, kind, len(words), len(data), digest(data, 16), b"")[:CHECKED]
    return b"".join([head, digest(head + words, 8), words, data])


def read_head(file, offset):
    """(kind, description, offset of the data, length, checksum) of the record there, or None."""
    file.seek(offset)
    head = file.read(HEAD.size)
    if len(head) < HEAD.size or not head.startswith(MARK):
        return None
    _, kind, words_length, length, data_digest, head_digest = HEAD.unpack(head)
    if words_length > LONGEST_DESCRIPTION or length > LONGEST_DATA:
        return None
    words = file.read(words_length)
    if digest(head[:CHECKED] + words, 8) != head_digest:
        return None
    try:
        description = read_json(words, {})
    except ValueError:
        return None  # its checksum is right, but no flocsim has written it
    return kind, description, offset + HEAD.size + words_length, length, data_digest


def next_mark(file, start):
    """The place of the first mark at or after ``start``; None where there is none."""
    file.seek(start)
    held = b""
    while block := file.read(BLOCK):
        held += block
        place = held.find(MARK)
        if place >= 0:
            return start + place
        start += max(len(held) - len(MARK) + 1, 0)
        held = held[-len(MARK) + 1 :]
    return None


def scan(file: BinaryIO) -> Iterator[Record | Damage]:
    """Every Record and Damage of an open journal, in order; each byte is in one of them."""
    end = file.seek(0, 2)
    place = 0
    while place < end:
        found = read_head(file, place)
        if found is None:
            following = next_mark(file, place + 1)
            following = end if following is None else following
            yield Damage(place, following)
            place = following
            continue
        kind, description, offset, length, expected = found
        file.seek(offset)
        data = file.read(length)
        stop = offset + len(data)
        if len(data) == length and digest(data, 16) == expected:
            yield Record(kind, description, offset, length)
        else:
            yield Damage(place, stop, description)
        place = stop
