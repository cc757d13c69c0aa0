"""The structure of an HDF5 file, read from its bytes and checked before the HDF5 library sees it.

The library follows every address that a file gives it: made-up ones keep it busy for ever, and
external storage, virtual datasets, links and filters make it open other files or fill the memory.
A seal does not help, since anyone can seal a file. So what is not one of the few things that
flocsim writes (groups, whole datasets of plain numbers or text, attributes) is refused, and so
are two things that lie on the same bytes. The format is HDF5's oldest, which h5py writes unasked:
"HDF5 File Format Specification Version 3.0", superblock 0, object headers 1, symbol tables.
"""

import math
import re
import struct
from collections.abc import Callable
from typing import BinaryIO

import attrs

from flocsim.io.seals import HDF5_SIGNATURE

REFERENCE = struct.pack("<BBBBI", 0x17, 0, 0, 0, 8)
MEMBER = bytes(28)
"""Of a compound's member: what it says of dimensions, of which it has none."""

SIZES = {
    "u1": 1, "i4": 4, "i8": 8, "f8": 8, "text": 16, "flag": 1, "references": 16, "scales": 16
}  # fmt: skip
"""Bytes of one value, by the name of its type."""

FIXED_TEXT = re.compile(rb"\x13[\x00-\x02\x10-\x12]\0\0(.{4})", re.DOTALL)
LONGEST_FIXED = 256

LARGEST = 2**28
"""Bytes of a heap: far more than flocsim writes into one."""

END_OF_FREE = 1
"""In a heap of names, instead of the place of the next free piece."""

NOWHERE = 2**64 - 1
SUPERBLOCK = struct.Struct("<8s8BHHI4Q2QII16s")
LINK = struct.Struct("<QQII16s")
LEAF_SIZE, NODE_SIZE = 8, 32
"""Entries of a leaf and of a node of a group's tree."""

MOST_OBJECTS = 20_000
MOST_ATTRIBUTES = 100
MOST_LEVELS = 4
MOST_DIMENSIONS = 6
MOST_TEXTS = 2_000_000
LONGEST_HEADER = 2**20

NIL, SPACE, TYPE, FILL, LAYOUT, ATTRIBUTE, MORE, TABLE, TIME = 0, 1, 3, 5, 8, 12, 16, 17, 18
"""Messages of an object's header that flocsim writes."""

FOREIGN = {
    2: "links of the new kind",
    6: "links of the new kind",
    7: "values in another file",
    11: "filters or compression",
}


def integer(size: int, signed: bool) -> bytes:
    """The message of an integer type, little-endian."""
    return struct.pack("<BBBBIHH", 0x10, 0x08 if signed else 0, 0, 0, size, 0, 8 * size)


def text(charset: int) -> bytes:
    """The message of text of variable length, ASCII (0) or UTF-8 (1)."""
    return struct.pack("<BBBBI", 0x19, 1, charset, 0, 16) + integer(1, False)


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


class Unfit(ValueError):
    """What a file holds that flocsim does not write, in a line without the file's name."""


def checked_type(where: str, message: bytes) -> str:
    """What a datatype message names: a key of SIZES or "fixed N"; Unfit for all else.

    Messages may be padded with zeros.
    """
    for known, name in KNOWN.items():
        if message.startswith(known) and not any(message[len(known) :]):
            return name
    match = FIXED_TEXT.match(message)
    size = int.from_bytes(match[1], "little") if match and not any(message[8:]) else 0
    if not 0 < size <= LONGEST_FIXED:
        raise Unfit(f"{where} holds values of a type that flocsim does not write")
    return f"fixed {size}"


def size_of(name: str) -> int:
    """Bytes of one value of a type."""
    return SIZES[name] if name in SIZES else int(name.removeprefix("fixed "))


def name_table(take: Callable[[int, int], bytes], address: int) -> Callable[[int], bytes]:
    """place → name, of the heap of names at an address; Unfit where that is none.

    ``take(start, length)`` gives bytes of the file.
    """
    mark, version, length, free, start = struct.unpack("<4sB3xQQQ", take(address, 32))
    if mark != b"HEAP" or version != 0 or length > LARGEST:
        raise Unfit("a group has no heap of names")
    names = take(start, length)
    check_free(names, free)

    def name(place):
        stop = names.find(b"\0", place) if place < length else -1
        if stop < 0:
            raise Unfit("a name in it has no end")
        return names[place:stop]

    return name


def check_free(names, free):
    """Unfit unless the list of the heap's free pieces goes up and ends."""
    least = 0
    while free not in (END_OF_FREE, 2**64 - 1):
        if not least <= free <= len(names) - 16:
            raise Unfit("a group's heap of names is damaged")
        following, size = struct.unpack_from("<QQ", names, free)
        if size < 16 or free + size > len(names):
            raise Unfit("a group's heap of names is damaged")
        free, least = following, free + size


@attrs.frozen
class Node:
    """A group (``type`` None) or a dataset: its type's name, its shape, and the same of attributes.

    ``attributes``: {name: (type, shape)}.
    """

    type: str | None
    shape: tuple[int, ...]
    attributes: dict[str, tuple[str, tuple[int, ...]]]


def structure_of(file: BinaryIO, size: int) -> dict[str, Node]:
    """{path: Node} of the HDF5 data in the first ``size`` bytes of an open file; "" is its root.

    No value of a dataset of numbers is read. Raises Unfit for all that flocsim does not write.
    """
    walk = Walk(file, size)
    try:
        walk.begin()
    except (struct.error, IndexError) as error:
        raise Unfit("a header in it is truncated") from error
    walk.check_apart()
    return walk.nodes


@attrs.define
class Walk:
    """A walk through all of a file; ``claims`` are the bytes [start, stop) that have an owner."""

    file: BinaryIO
    size: int
    nodes: dict[str, Node] = attrs.Factory(dict)
    claims: list[tuple[int, int]] = attrs.Factory(list)
    texts: dict[int, dict[int, bytes]] = attrs.Factory(dict)
    """The collections of text and references, each text being of one value."""
    left: int = attrs.field(init=False)

    def __attrs_post_init__(self):
        self.left = self.size

    def claim(self, start, length):
        if not 0 <= start <= start + length <= self.size:
            raise Unfit("an address or a length in it leads out of the file")
        # More than the file has in all: something is met again and again.
        self.left -= length
        if self.left < 0:
            raise Unfit("two parts of it lie on the same bytes")
        if length:
            self.claims.append((start, start + length))

    def take(self, start, length):
        """Bytes that nothing else may lie on."""
        self.claim(start, length)
        self.file.seek(start)
        found = self.file.read(length)
        if len(found) < length:
            raise Unfit("it ends early")
        return found

    def check_apart(self):
        self.claims.sort()
        for (_, stop), (start, _) in zip(self.claims, self.claims[1:], strict=False):
            if start < stop:
                raise Unfit("two parts of it lie on the same bytes")

    def begin(self):
        block = self.take(0, SUPERBLOCK.size)
        signature, *rest = SUPERBLOCK.unpack(block)
        versions, sizes, plan = rest[:5], rest[5:8], rest[8:11]
        base, free, end, driver, name, root, kind, _, scratch = rest[11:]
        if signature != HDF5_SIGNATURE:
            raise Unfit("it is not HDF5")
        if versions != [0] * 5 or sizes != [8, 8, 0] or plan != [LEAF_SIZE // 2, NODE_SIZE // 2, 0]:
            raise Unfit("its HDF5 format is not the one that h5py writes")
        if (base, free, end, driver, name) != (0, NOWHERE, self.size, NOWHERE, 0):
            raise Unfit("its superblock is not one that h5py writes")
        self.object_at("", root, kind, scratch)

    def object_at(self, path, address, kind, scratch):
        """Walk the group or dataset whose header lies there; ``kind`` is that of its link."""
        if len(self.nodes) >= MOST_OBJECTS:
            raise Unfit(f"it has more than {MOST_OBJECTS} groups and datasets")
        if path.count("/") > MOST_LEVELS:
            raise Unfit(f"its groups are nested more than {MOST_LEVELS} deep")
        where = path or "the root"
        if kind not in (0, 1):
            raise Unfit(f"{where} is a link, which flocsim never writes")
        found, attributes = {}, {}
        for number, body in self.messages(where, address):
            if number == ATTRIBUTE:
                name, about = self.attribute(where, body)
                if name in attributes or len(attributes) >= MOST_ATTRIBUTES:
                    raise Unfit(f"{where} has an attribute twice, or more than {MOST_ATTRIBUTES}")
                attributes[name] = about
            elif number in (SPACE, TYPE, FILL, LAYOUT, TABLE):
                if number in found:
                    raise Unfit(f"the header of {where} has the same entry twice")
                found[number] = body
        if TABLE in found and len(found) == 1:
            self.nodes[path] = Node(None, (), attributes)
            if kind == 1 and scratch != found[TABLE][:16]:
                raise Unfit(f"{where} occurs twice")
            self.group(path, found[TABLE])
        elif found.keys() == {SPACE, TYPE, FILL, LAYOUT} and kind == 0 and path:
            type_, shape = self.values_of(where, found)
            self.nodes[path] = Node(type_, shape, attributes)
        else:
            raise Unfit(f"{where} is neither a group nor a dataset")

    def messages(self, where, address):
        """(number, body) of each message in the header of an object."""
        version, _, count, _, length = struct.unpack("<BBHII", self.take(address, 16)[:12])
        if version != 1 or length > LONGEST_HEADER:
            raise Unfit(f"the header of {where} is not one that h5py writes")
        blocks, seen = [(address + 16, length)], 0
        for start, size in blocks:
            block, place = self.take(start, size), 0
            while place + 8 <= size:
                number, long, flags = struct.unpack_from("<HHB", block, place)
                body = block[place + 8 : place + 8 + long]
                place += 8 + long
                seen += 1
                if number in FOREIGN:
                    raise Unfit(f"{where} has {FOREIGN[number]}, which flocsim never writes")
                known = number in (
                    NIL, SPACE, TYPE, FILL, LAYOUT, ATTRIBUTE, MORE, TABLE, TIME
                )  # fmt: skip
                if not known or flags > 1 or place > size or long % 8:
                    raise Unfit(f"the header of {where} has an entry that flocsim does not write")
                if number == MORE:
                    if long < 16 or len(blocks) > MOST_ATTRIBUTES:
                        raise Unfit(f"the header of {where} is scattered")
                    blocks.append(struct.unpack_from("<QQ", body))
                yield number, body
            if place != size:
                raise Unfit(f"the header of {where} is truncated")
        if seen != count:
            raise Unfit(f"the header of {where} has {seen} entries and promises {count}")

    def group(self, path, table):
        tree, heap = struct.unpack_from("<QQ", table)
        names = name_table(self.take, heap)
        last = b""
        for start, address, kind, scratch in self.entries(tree):
            name = names(start)
            if name <= last:
                raise Unfit(f"the names in {path or 'the root'} are not in order")
            last = name
            self.object_at(f"{path}/{decoded(name)}".removeprefix("/"), address, kind, scratch)

    def entries(self, tree):
        """(place of the name, address, kind, scratch) of each link of a group, in order."""
        row, level = [tree], None
        while True:
            beside, children = [NOWHERE, *row, NOWHERE], []
            levels = set()
            for number, address in enumerate(row):
                node = self.take(address, 24 + 8 * (2 * NODE_SIZE + 1))
                mark, kind, height, used, left, right = struct.unpack_from("<4sBBHQQ", node)
                levels.add(height)
                if mark != b"TREE" or kind != 0 or used > NODE_SIZE:
                    raise Unfit("a group's list of names is damaged")
                if (left, right) != (beside[number], beside[number + 2]):
                    raise Unfit("a group's list of names is tangled")
                children += [
                    struct.unpack_from("<Q", node, 32 + 16 * place)[0] for place in range(used)
                ]
            if len(levels) > 1 or (level is not None and levels != {level - 1}):
                raise Unfit("a group's list of names is tangled")
            if row:
                level = levels.pop()
            if level > MOST_LEVELS or len(children) > MOST_OBJECTS:
                raise Unfit("a group's list of names is too long")
            if level == 0 or not children:
                break
            row = children
        for address in children:
            leaf = self.take(address, 8 + 40 * LEAF_SIZE)
            mark, version, _, used = struct.unpack_from("<4sBBH", leaf)
            if mark != b"SNOD" or version != 1 or used > LEAF_SIZE:
                raise Unfit("a group's list of names is damaged")
            for place in range(used):
                name, header, kind, _, scratch = LINK.unpack_from(leaf, 8 + LINK.size * place)
                yield name, header, kind, scratch

    def values_of(self, where, found):
        """(type, shape) of a dataset, whose values lie in the file in one piece."""
        kind = checked_type(where, found[TYPE])
        shape = shape_of(where, found[SPACE])
        version, layout, start, length = struct.unpack_from("<BBQQ", padded(found[LAYOUT], 18))
        if (version, layout) != (3, 1):
            raise Unfit(f"the values of {where} are chunked, compressed, or in another dataset")
        if not (found[FILL][0] == 2 and found[FILL][1] in (1, 2, 3) and found[FILL][2] <= 2
                and found[FILL][3:8] in (b"\0" * 5, b"\1" + b"\0" * 4)):  # fmt: skip
            raise Unfit(f"{where} has a fill value of its own")
        wanted = math.prod(shape) * size_of(kind)
        if length != wanted:
            raise Unfit(f"{where} has {length} bytes of values, where its shape needs {wanted}")
        if kind in ("references", "scales", "flag"):
            raise Unfit(f"{where} holds values of a type that flocsim does not write")
        if kind == "text":
            self.text_values(where, self.take(start, wanted) if wanted else b"")
        elif wanted:
            self.claim(start, wanted)
        return kind, shape

    def attribute(self, where, body):
        """(name, (type, shape)) of an attribute."""
        version, _, *sizes = struct.unpack_from("<BBHHH", body)
        if version != 1 or not 1 < sizes[0] <= 256:
            raise Unfit(f"{where} has an attribute that h5py does not write")
        parts, place = [], 8
        for size in sizes:
            parts.append(body[place : place + size])
            place += -(-size // 8) * 8
        name = parts[0][:-1]
        if parts[0][-1:] != b"\0" or b"\0" in name:
            raise Unfit(f"{where} has an attribute that h5py does not write")
        inside = f"attribute {decoded(name)} of {where}"
        kind, shape = checked_type(inside, parts[1]), shape_of(inside, parts[2])
        length = math.prod(shape) * size_of(kind)
        values = body[place : place + length]
        if len(values) < length:
            raise Unfit(f"{inside} is truncated")
        if kind == "text":
            self.text_values(inside, values)
        elif kind == "references":
            for count, heap, number in struct.iter_unpack("<IQI", values):
                if count != 1 or len(self.content(heap, number)) != 8:
                    raise Unfit(f"{inside} does not lead to a dataset")
        return decoded(name), (kind, shape)

    def content(self, address, number):
        """What lies at a number of the collection at an address; Unfit where nothing does.

        Each is given out once: many values that share a long one would fill the memory.
        """
        if address not in self.texts:
            self.texts[address] = self.collection(address)
        found = self.texts[address].pop(number, None)
        if found is None:
            raise Unfit("a text in it is missing, or is that of several values")
        return found

    def collection(self, address):
        mark, version, size = struct.unpack("<4sB3xQ", self.take(address, 16))
        if mark != b"GCOL" or version != 1 or not 16 <= size <= LARGEST:
            raise Unfit("a text in it is missing")
        data, place, found = self.take(address + 16, size - 16), 0, {}
        while place + 16 <= len(data):
            number, _, length = struct.unpack_from("<HH4xQ", data, place)
            step = length if number == 0 else 16 + -(-length // 8) * 8
            if step < 16 or place + step > len(data) or number in found:
                raise Unfit("its texts are damaged")
            if number:
                found[number] = data[place + 16 : place + 16 + length]
            place += step
        return found

    def text_values(self, where, values):
        if len(values) > 16 * MOST_TEXTS:
            raise Unfit(f"{where} has more than {MOST_TEXTS} texts")
        for length, heap, number in struct.iter_unpack("<IQI", values):
            if length and len(self.content(heap, number)) != length:
                raise Unfit(f"a text of {where} is not as long as stated")


def padded(body, length):
    return body + bytes(max(length - len(body), 0))


def decoded(name):
    """A name as text: printable, and no path."""
    try:
        text = name.decode("utf-8")
    except UnicodeDecodeError:
        raise Unfit("a name in it is not UTF-8") from None
    if not text.isprintable() or "/" in text or text in ("", ".", ".."):
        raise Unfit(f"a name in it is not one that flocsim writes: {text!r}")
    return text


def shape_of(where, message):
    """The shape that a dataspace message gives, if that can never change."""
    version, rank, flags, *_ = padded(message, 8)
    sizes = struct.unpack(f"<{2 * rank}Q", padded(message[8:], 16 * rank)[: 16 * rank])
    if version != 1 or rank > MOST_DIMENSIONS or flags > 1 or len(message) < 8 * (1 + rank):
        raise Unfit(f"{where} has a shape that flocsim does not write")
    if flags and sizes[:rank] != sizes[rank:]:
        raise Unfit(f"{where} has a resizable shape, which flocsim never writes")
    return sizes[:rank]
