"""What is believed of bytes that anyone may have written: JSON, and the records of a journal.

JSON is parsed within limits and held against a pattern: a type (``str``, ``int``, ``float``,
``object`` for any value), ``[pattern]`` for a list of such, or ``{key: pattern}`` for an object
that has these keys and perhaps more.

A record is a head, a description and data, with checksums over all of it:

    head         mark (8 bytes), kind (u4), length of the description (u4), length of the data (u8),
                 blake2b-128 of the data, blake2b-64 of the head before it and the description
    description  JSON, UTF-8
    data         bytes

Little-endian. The lengths are believed only where the head's checksum is right; where it is not,
the next record is looked for by its mark. A file that was made to keep its reader busy is given up
after a while: what is left of it then counts as damaged.
"""

import json
import math
import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

import attrs

from flocsim.io.seals import digest_at, digest_of

LONGEST = 2**24
"""Letters of a text."""

DEEPEST = 8
"""Lists and objects within one another."""

LARGEST = 2**53
"""Whole numbers are below, so that every reader of JSON has them exactly."""


def read_json(text: str | bytes, pattern: Any = object) -> Any:
    """The value of a JSON text; ValueError, of one line, for what is none or fits no pattern.

    So for text beyond the limits above, and for numbers or letters that cannot be.
    """
    if not isinstance(text, str | bytes) or len(text) > LONGEST:
        raise ValueError(f"it is not a text of up to {LONGEST} letters")
    try:
        value = json.loads(text, parse_constant=no_number, parse_float=finite)
    except RecursionError:
        raise ValueError(f"it is nested more than {DEEPEST} deep") from None
    check_inside(value)
    if not matches(value, pattern):
        raise ValueError("its form is unknown")
    return value


def no_number(word):
    raise ValueError(f"{word} is not a number")


def finite(text):
    value = float(text)
    return value if math.isfinite(value) else no_number(text[:20])


def check_inside(value):
    """ValueError for what is nested too deeply, and for letters that no file can hold."""
    row = [value]
    for _ in range(DEEPEST + 1):
        inner = []
        for each in row:
            if isinstance(each, dict):
                inner += [*each, *each.values()]
            elif isinstance(each, list):
                inner += each
            elif isinstance(each, str):
                each.encode("utf-8")  # a lone half of a letter raises a ValueError
            elif isinstance(each, int) and abs(each) > LARGEST:
                raise ValueError("a number in it is too large")
        row = inner
    if row:
        raise ValueError(f"it is nested more than {DEEPEST} deep")


def matches(value: Any, pattern: Any) -> bool:
    """Whether a value that was read has the form of a pattern."""
    if isinstance(pattern, list):
        return isinstance(value, list) and all(matches(each, pattern[0]) for each in value)
    if isinstance(pattern, dict):
        return isinstance(value, dict) and all(
            key in value and matches(value[key], inner) for key, inner in pattern.items()
        )
    if pattern is object:
        return True
    if isinstance(value, bool):
        return False
    return isinstance(value, int | float) if pattern is float else isinstance(value, pattern)


MARK = b"\x93FLOCREC"
HEAD = struct.Struct("<8sIIQ16s8s")
CHECKED = HEAD.size - 8
LONGEST_DESCRIPTION = 2**24
LONGEST_DATA = 2**32
BLOCK = 2**16

MOST_WASTE = 2**28
"""Bytes that are read behind marks that turn out to be none, beside twice the file's own."""

SESSION, CHUNK, SNAPSHOT = 1, 2, 3
"""Kinds: what a run was started with; rows of finished replicates; what is kept of others."""


@attrs.frozen
class Record:
    """One whole record: its kind, its description, where its data lie, and their digest."""

    kind: int
    description: dict[str, Any]
    offset: int
    length: int
    digest: bytes


@attrs.frozen
class Damage:
    """Bytes [start, stop) of a journal that are no whole record, and what they held, if known.

    ``is_cut``: what a killed process leaves, the beginning of a record at the end of the file.
    """

    start: int
    stop: int
    description: dict[str, Any] | None = None
    is_cut: bool = False


def encode(kind: int, description: dict[str, Any], data: bytes = b"") -> bytes:
    words = json.dumps(description, sort_keys=True, ensure_ascii=False).encode("utf-8", "replace")
    head = HEAD.pack(MARK, kind, len(words), len(data), digest_of(data, 16), b"")[:CHECKED]
    return b"".join([head, digest_of(head + words, 8), words, data])


def data_digest(record: bytes) -> bytes:
    """The checksum of the data of an encoded record, as its head says it."""
    return HEAD.unpack_from(record)[4]


def record_at(record: bytes, offset: int) -> Record:
    """The Record of an encoded one that begins at ``offset`` of a file."""
    _, kind, words, length, expected, _ = HEAD.unpack_from(record)
    start = HEAD.size + words
    return Record(kind, json.loads(record[HEAD.size : start]), offset + start, length, expected)


def kind_of(record: bytes) -> int:
    return HEAD.unpack_from(record)[1]


def read_head(file, offset):
    """(kind, description, offset of the data, length, digest) of the record there, or None.

    Beside it the bytes that were read for it.
    """
    file.seek(offset)
    head = file.read(HEAD.size)
    if len(head) < HEAD.size or not head.startswith(MARK):
        return None, len(head)
    _, kind, words_length, length, expected, head_digest = HEAD.unpack(head)
    if words_length > LONGEST_DESCRIPTION or length > LONGEST_DATA:
        return None, len(head)
    words = file.read(words_length)
    read = len(head) + len(words)
    if digest_of(head[:CHECKED] + words, 8) != head_digest:
        return None, read
    try:
        description = read_json(words, {})
    except ValueError:
        return None, read  # its checksum is right, but no flocsim has written it
    return (kind, description, offset + HEAD.size + words_length, length, expected), read


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


def begins_a_record(file, place, end):
    """Whether the bytes from a place to the end are the beginning of a record, cut short."""
    file.seek(place)
    head = file.read(HEAD.size)
    if len(head) < HEAD.size:
        return head[: len(MARK)] == MARK[: len(head)]
    mark, _, words_length, _, _, _ = HEAD.unpack(head)
    return (
        mark == MARK
        and words_length <= LONGEST_DESCRIPTION
        and (place + HEAD.size + words_length > end)
    )


def scan(file: BinaryIO) -> Iterator[Record | Damage]:
    """Every Record and Damage of an open journal, in order; each byte is in one of them."""
    end = file.seek(0, 2)
    place, allowed = 0, 2 * end + MOST_WASTE
    damaged = None
    while place < end:
        found, read = read_head(file, place)
        if found is None:
            damaged = place if damaged is None else damaged
            allowed -= read + BLOCK
            following = next_mark(file, place + 1) if allowed > 0 else None
            if following is None:
                yield Damage(damaged, end, is_cut=begins_a_record(file, damaged, end))
                return
            place = following
            continue
        if damaged is not None:
            yield Damage(damaged, place)
            damaged = None
        kind, description, offset, length, expected = found
        seen, there = digest_at(file, offset, length, 16)
        stop = offset + there
        if there == length and seen == expected:
            yield Record(kind, description, offset, length, expected)
        else:
            yield Damage(place, stop, description, is_cut=there < length)
        place = stop
