"""The two places in which HDF5 keeps text: a heap of names for each group, one for all values."""

import struct
from collections.abc import Callable

import attrs

LARGEST = 2**28
"""Bytes of a heap: far more than flocsim writes into one."""

END_OF_FREE = 1
"""In a heap of names, instead of the place of the next free piece."""


def name_table(take: Callable[[int, int], bytes], address: int) -> Callable[[int], bytes]:
    """place → name, of the heap of names at an address; ValueError where that is none.

    ``take(start, length)`` gives bytes of the file.
    """
    mark, version, length, free, start = struct.unpack("<4sB3xQQQ", take(address, 32))
    if mark != b"HEAP" or version != 0 or length > LARGEST:
        raise ValueError("a group has no heap of names")
    names = take(start, length)
    check_free(names, free)

    def name(place):
        stop = names.find(b"\0", place) if place < length else -1
        if stop < 0:
            raise ValueError("a name in it has no end")
        return names[place:stop]

    return name


def check_free(names, free):
    """ValueError unless the list of the heap's free pieces goes up and ends."""
    least = 0
    while free not in (END_OF_FREE, 2**64 - 1):
        if not least <= free <= len(names) - 16:
            raise ValueError("a group's heap of names is damaged")
        following, size = struct.unpack_from("<QQ", names, free)
        if size < 16 or free + size > len(names):
            raise ValueError("a group's heap of names is damaged")
        free, least = following, free + size


@attrs.define
class TextHeap:
    """The collections of text and references of a file, each text being of one value."""

    take: Callable[[int, int], bytes]
    known: dict[int, dict[int, bytes]] = attrs.Factory(dict)

    def content(self, address: int, number: int) -> bytes:
        """What lies at a number of the collection at an address; ValueError where nothing does.

        Each is given out once: many values that share a long one would fill the memory.
        """
        if address not in self.known:
            self.known[address] = self.collection(address)
        found = self.known[address].pop(number, None)
        if found is None:
            raise ValueError("a text in it is missing, or is that of several values")
        return found

    def collection(self, address):
        mark, version, size = struct.unpack("<4sB3xQ", self.take(address, 16))
        if mark != b"GCOL" or version != 1 or not 16 <= size <= LARGEST:
            raise ValueError("a text in it is missing")
        data, place, found = self.take(address + 16, size - 16), 0, {}
        while place + 16 <= len(data):
            number, _, length = struct.unpack_from("<HH4xQ", data, place)
            step = length if number == 0 else 16 + -(-length // 8) * 8
            if step < 16 or place + step > len(data) or number in found:
                raise ValueError("its texts are damaged")
            if number:
                found[number] = data[place + 16 : place + 16 + length]
            place += step
        return found
