"""A file in memory of which only what is written takes space: the frame of a large HDF5 file.

HDF5 lays out its large datasets and writes all that describes them; their values go to the disk
without it, a block at a time. So memory stays flat, and a full disk is never met inside HDF5,
where it can end the process.
"""

import io


class SparseImage(io.RawIOBase):
    """What h5py takes for a file."""

    def __init__(self):
        """An empty file."""
        self.writes = []
        self.length = 0
        self.place = 0

    def readable(self):
        """Yes."""
        return True

    def writable(self):
        """Yes."""
        return True

    def seekable(self):
        """Yes."""
        return True

    def seek(self, offset, whence=io.SEEK_SET):
        """Go to a place."""
        self.place = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self.place}.get(whence, self.length)
        return self.place

    def tell(self):
        """The place."""
        return self.place

    def write(self, data):
        """Keep the bytes."""
        data = bytes(data)
        self.writes.append((self.place, data))
        self.place += len(data)
        self.length = max(self.length, self.place)
        return len(data)

    def readinto(self, buffer):
        """Bytes at the place, zero where nothing was written."""
        stop = min(self.place + len(buffer), self.length)
        data = self.content(self.place, stop)
        buffer[: len(data)] = data
        self.place += len(data)
        return len(data)

    def truncate(self, size=None):
        """Set the length."""
        self.length = self.place if size is None else size
        return self.length

    def content(self, start, stop):
        """The bytes [start, stop), as a later write has left them."""
        found = bytearray(max(stop - start, 0))
        for place, data in self.writes:
            low, high = max(place, start), min(place + len(data), stop)
            if low < high:
                found[low - start : high - start] = data[low - place : high - place]
        return bytes(found)

    def blocks(self, streams):
        """All bytes in order; ``streams`` are (offset, length, iterator of bytes) of the values."""
        place = 0
        for offset, length, values in sorted(streams, key=lambda stream: stream[0]):
            yield self.content(place, offset)
            yield from values
            place = offset + length
        yield self.content(place, self.length)
