"""The mark of figures and pages that flocsim made and that nobody has changed since.

It is a checksum of all the rest of the file, where the format has a place for remarks: such a file
can be drawn again from the data, so a new one may take its place. A photograph, a figure of
another program, or one that was touched up by hand has no mark or a wrong one.
"""

import os
import stat
import struct
import zlib
from pathlib import Path

from flocsim.io.pieces import digest_of

NAME = b"flocsim blake2b-256"

MOST_BYTES = 2**30
"""No figure is larger."""


def png_remark(text):
    body = b"tEXt" + NAME.replace(b" ", b"\0", 1) + b" " + text
    return struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))


def gif_remark(text):
    words = NAME + b" " + text
    return b"\x21\xfe" + bytes([len(words)]) + words + b"\0"


def markup_remark(text):
    return b"<!-- " + NAME + b" " + text + b" -->\n"


def pdf_remark(text):
    return b"% " + NAME + b" " + text + b"\n"


PLACES = {
    # ending: (remark in the format, bytes of the file that come after it)
    ".png": (png_remark, 12),
    ".gif": (gif_remark, 1),
    ".svg": (markup_remark, 0),
    ".md": (markup_remark, 0),
    ".html": (markup_remark, 0),
    ".pdf": (pdf_remark, 0),
}


def marked(data: bytes, suffix: str) -> bytes:
    """The bytes of a figure or page with their mark; ``suffix`` such as ".png" tells the format."""
    remark, after = PLACES[suffix]
    end = len(data) - after
    return data[:end] + remark(digest_of(data).hex().encode()) + data[end:]


def is_marked(data: bytes, suffix: str) -> bool:
    """Whether these are bytes that `marked` gave."""
    if suffix not in PLACES:
        return False
    remark, after = PLACES[suffix]
    end = len(data) - after
    start = end - len(remark(b"0" * 64))
    return start >= 0 and marked(data[:start] + data[end:], suffix) == data


def is_own(path: Path) -> bool:
    """Whether an ordinary file is a figure or page of flocsim's that was not changed since."""
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    try:
        with open(os.open(path, flags), "rb") as file:
            about = os.fstat(file.fileno())
            if not stat.S_ISREG(about.st_mode) or about.st_size > MOST_BYTES:
                return False
            return is_marked(file.read(), path.suffix.lower())
    except OSError:
        return False
