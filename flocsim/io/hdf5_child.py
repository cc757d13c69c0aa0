"""Describe an HDF5 file to another process: its groups, its text, and where its numbers lie.

The HDF5 library follows every address in a file: made-up ones keep it busy for ever, crash it or
fill the memory, and links, external storage, virtual datasets and filters make it open other files.
A checksum does not help, since anyone can make one. So the library runs here, in a process of its
own with limits of time, memory and files, and what flocsim does not write is refused. Numbers are
not read at all: they lie in one piece each, and whoever wants them reads them from there.

The file is standard input, its description goes to standard output as JSON. This module is run by
its path, and imports nothing of flocsim, so that such a process starts quickly.
"""

import codecs
import json
import math
import os
import signal
import sys
import time
from typing import Any

PATIENCE = 20
"""How much longer a process may take that has little of a processor."""

MEMORY = 3 * 2**28
"""Bytes beyond those that the process has when it begins."""

MOST_OBJECTS, MOST_LEVELS = 20_000, 4

TYPES = {"<f8": "f8", "<i8": "i8", "<i4": "i4", "|u1": "u1"}

UNREAD = {
    "units", "long_name", "flag_values", "CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"
}  # fmt: skip
"""Attributes that are for other programs: flocsim knows them from its schema."""


class Refused(ValueError):
    """A file holds what flocsim does not write; a line without the file's name."""


def main() -> None:
    """Write the description of the file; ends the process."""
    try:
        import h5py

        set_limits()
        found: dict[str, Any] = {"nodes": described(h5py)}
        said = json.dumps(found, default=plain, ensure_ascii=False).encode()
    except MemoryError:
        said = json.dumps({"refused": "it takes more than 768 MiB of memory"}).encode()
    except Exception as error:
        said = json.dumps({"refused": str(error)}).encode()
    with open(1, "wb", closefd=False) as output:
        output.write(said)
    os._exit(0)


def cpu_seconds(size: int) -> int:
    """Return the CPU time [s] that a file of so many bytes may take: usual ones take 0.05 s, one of
    100 MB that is all text 4 s."""
    return 3 + size // 2**24


def set_limits() -> None:
    """Limit this process as far as its system can. Where that has no limit of memory it has still
    no more text to read than the file is long, and no numbers."""
    seconds = cpu_seconds(os.fstat(0).st_size)
    if os.name == "nt":
        import faulthandler  # whose timer is the only one that needs no help of Python

        faulthandler.dump_traceback_later(PATIENCE * seconds, exit=True, file=sys.stderr)
        return
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(PATIENCE * seconds)
    limit("CPU", seconds + int(time.process_time()))
    limit("FSIZE", 0)
    limit("CORE", 0)
    if os.path.exists("/proc/self/statm"):
        with open("/proc/self/statm") as file:
            limit("AS", int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE") + MEMORY)


def limit(name: str, most: int) -> None:
    """Lower a limit of this process; one that is lower already stays."""
    import resource

    which = getattr(resource, f"RLIMIT_{name}")
    _, least = resource.getrlimit(which)
    resource.setrlimit(which, (most if least < 0 else min(most, least), least))


def described(h5py: Any) -> dict[str, tuple]:
    """Return {path: (type, shape, offset of its values, attributes, text)} of all groups, of type
    None, and datasets; "" is the root."""
    # Not by its name, under which another file may lie by now.
    with open(0, "rb", 0, closefd=False) as source, h5py.File(source, "r") as file:
        if os.name != "nt":
            codecs.lookup("ascii")  # which Python loads from a file, and h5py asks for
            limit("NOFILE", 0)  # from here on nothing else can be opened
        root = h5py.h5o.open(file.id, b"/")
        nodes = {"": (None, (), None, attributes(h5py, root), None)}
        walk(h5py, root, "", nodes, [os.fstat(0).st_size])
    return nodes


def walk(h5py: Any, group: Any, above: str, nodes: dict[str, tuple], left: list[int]) -> None:
    """Add all that is in a group to the nodes; ``left``: bytes of the file that may have values."""
    names: list[bytes] = []
    group.links.iterate(names.append)
    for name in names:
        path = above + name.decode()
        if not path.isprintable():
            raise Refused("it has unprintable names")
        if len(nodes) >= MOST_OBJECTS or path.count("/") > MOST_LEVELS:
            raise Refused("its groups are nested too deep, or too many")
        if group.links.get_info(name).type != h5py.h5l.TYPE_HARD:
            raise Refused(f"{path} is a link, which flocsim never writes")
        each = h5py.h5o.open(group, name)
        if isinstance(each, h5py.h5g.GroupID):
            nodes[path] = (None, (), None, attributes(h5py, each), None)
            walk(h5py, each, f"{path}/", nodes, left)
        elif isinstance(each, h5py.h5d.DatasetID):
            nodes[path] = dataset(h5py, path, each, left)
        else:
            raise Refused(f"{path} is neither a group nor a dataset")


def dataset(h5py: Any, path: str, each: Any, left: list[int]) -> tuple:
    """Return the node of a dataset whose values lie in the file in one piece."""
    dtype, shape = each.dtype, each.shape
    words = h5py.check_string_dtype(dtype)
    kind = "text" if words and words.length is None else TYPES.get(dtype.str)
    if kind is None or each.get_space().get_simple_extent_type() == h5py.h5s.NULL:
        raise Refused(f"{path} has a type or a shape that flocsim does not write")
    plan = each.get_create_plist()
    whole = plan.get_layout() == h5py.h5d.CONTIGUOUS and not plan.get_nfilters()
    if not whole or plan.get_external_count():
        raise Refused(f"the values of {path} are packed, in pieces, or in another file or dataset")
    size = math.prod(shape) * (16 if words else dtype.itemsize)
    offset, text = each.get_offset(), None
    if size and (offset is None or each.get_storage_size() != size):
        raise Refused(f"the values of {path} are missing")
    take(size, left)
    if words:
        os.lseek(0, offset or 0, os.SEEK_SET)
        lengths = memoryview(os.read(0, size)).cast("I")[::4]
        take(sum(lengths), left)
        values = h5py.Dataset(each).asstr(errors="strict")[()]
        text = values.ravel().tolist() if shape else [values]
    return kind, shape, offset, attributes(h5py, each), text


def take(size: int, left: list[int]) -> None:
    """Count bytes of values: a thousand datasets or texts on the same bytes would fill the memory
    of whoever reads them."""
    left[0] -= size
    if left[0] < 0:
        raise Refused("it promises more values than it has bytes")


def attributes(h5py: Any, owner: Any) -> dict[str, Any]:
    """Return {name: value} of all attributes; None for those of UNREAD."""
    names: list[bytes] = []
    h5py.h5a.iterate(owner, names.append)
    found: dict[str, Any] = dict.fromkeys(name.decode() for name in names)
    if wanted := found.keys() - UNREAD:
        kind = h5py.Group if isinstance(owner, h5py.h5g.GroupID) else h5py.Dataset
        found |= {name: kind(owner).attrs[name] for name in wanted}
    return found


def plain(value: Any) -> Any:
    """Return a value of numpy as Python has it, for JSON."""
    if isinstance(value, bytes):
        return value.decode()
    if not hasattr(value, "tolist"):
        raise Refused("an attribute has a value that flocsim does not write")
    return value.tolist()


if __name__ == "__main__":
    main()
