"""The types of values that flocsim writes into HDF5, as the bytes by which a file names them."""

import re
import struct


def integer(size: int, signed: bool) -> bytes:
    """The message of an integer type, little-endian."""
    return struct.pack("<BBBBIHH", 0x10, 0x08 if signed else 0, 0, 0, size, 0, 8 * size)


def text(charset: int) -> bytes:
    """The message of text of variable length, ASCII (0) or UTF-8 (1)."""
    return struct.pack("<BBBBI", 0x19, 1, charset, 0, 16) + integer(1, False)


REFERENCE = struct.pack("<BBBBI", 0x17, 0, 0, 0, 8)
MEMBER = bytes(28)
"""Of a compound's member: what it says of dimensions, of which it has none."""

KNOWN = {
    integer(1, False): "u1",
    integer(4, True): "i4",
    integer(8, True): "i8",
    bytes.fromhex("11203f000800000000004000340b0034ff030000"): "f8",
    text(0): "text",
    text(1): "text",
    # How h5py writes a bool.
    bytes.fromhex("1802000001000000") + integer(1, True) + b"FALSE\0\0\0TRUE\0\0\0\0\0\1": "flag",
    # Of a dataset, its dimension scales.
    struct.pack("<BBBBI", 0x19, 0, 0, 0, 16) + REFERENCE: "references",
    # Of a dimension scale, the datasets that have it, and as which dimension.
    struct.pack("<BBBBI", 0x16, 2, 0, 0, 16)
    + b"dataset\0" + bytes(4) + MEMBER + REFERENCE
    + b"dimension\0\0\0\0\0\0\0" + struct.pack("<I", 8) + MEMBER + integer(4, False): "scales",
}  # fmt: skip
SIZES = {
    "u1": 1, "i4": 4, "i8": 8, "f8": 8, "text": 16, "flag": 1, "references": 16, "scales": 16
}  # fmt: skip
"""Bytes of one value, by the name of its type."""

FIXED_TEXT = re.compile(rb"\x13[\x00-\x02\x10-\x12]\0\0(.{4})", re.DOTALL)
LONGEST_FIXED = 256


def type_name(message: bytes) -> str | None:
    """What a datatype message names: a key of SIZES or "fixed N"; None for all else.

    Messages may be padded with zeros.
    """
    if message in KNOWN:
        return KNOWN[message]
    for known, name in KNOWN.items():
        if message.startswith(known) and not any(message[len(known) :]):
            return name
    match = FIXED_TEXT.match(message)
    if match and not any(message[8:]):
        size = int.from_bytes(match[1], "little")
        return f"fixed {size}" if 0 < size <= LONGEST_FIXED else None
    return None


def size_of(name: str) -> int:
    """Bytes of one value of a type."""
    return SIZES[name] if name in SIZES else int(name.removeprefix("fixed "))
