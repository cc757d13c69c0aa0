"""Describe an HDF5 file to another process: its groups, its text, and where its numbers lie.

The HDF5 library follows every address in a file: made-up ones keep it busy for ever, crash it or
fill the memory, and links, external storage, virtual datasets and filters make it open other files.
A checksum does not help, since anyone can make one. So the library runs here, in a process of its
own with limits of time and memory, and what flocsim does not write is refused. Numbers are not read
at all: they lie in one piece each, and whoever wants them reads them from there.

The file is standard input, its description goes to standard output as JSON. This module is run by
its path, and imports nothing of flocsim, so that such a process starts quickly.
"""

import json
import os
import sys
import time
from typing import Any

PATIENCE = 20
"""How much longer a process may take that has little of a processor."""

MEMORY = 3 * 2**28
"""Bytes beyond those that the process has when it begins."""

MOST_LEVELS = 4
"""Groups within one another: a group may be linked into itself."""

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
        text = json.dumps({"nodes": described(h5py)}, default=plain, ensure_ascii=False).encode()
    except Exception as error:
        text = json.dumps({"refused": str(error) or "it takes too much memory"}).encode()
    with open(1, "wb", closefd=False) as output:
        output.write(text)
    os._exit(0)


def cpu_seconds(size: int) -> int:
    """Return the CPU time [s] that a file of so many bytes may take.

    Usual files take 0.05 s, one of 100 MB that is all text 4 s.
    """
    return 3 + size // 2**24


def set_limits() -> None:
    """Limit time and memory of this process, as far as its system can."""
    if os.name == "nt":
        return  # whoever started it waits so long at most
    import resource

    limits = {"CPU": cpu_seconds(os.fstat(0).st_size) + int(time.process_time())}
    if os.path.exists("/proc/self/statm"):
        with open("/proc/self/statm") as file:
            limits["AS"] = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE") + MEMORY
    for name, most in limits.items():
        which = getattr(resource, f"RLIMIT_{name}")
        _, hard = resource.getrlimit(which)
        resource.setrlimit(which, (most if hard < 0 else min(most, hard), hard))


def described(h5py: Any) -> dict[str, tuple]:
    """Return {path: (type, shape, offset of its values, attributes, text)} of all groups, of type
    None, and datasets; "" is the root."""
    # Not by its name, under which another file may lie by now.
    with open(0, "rb", 0, closefd=False) as source, h5py.File(source, "r") as file:
        nodes = {"": (None, (), None, attributes(file), None)}
        walk(h5py, file, "", nodes)
    return nodes


def walk(h5py: Any, group: Any, above: str, nodes: dict[str, tuple]) -> None:
    """Add all that is in a group to the nodes."""
    for name in group:
        path = above + name
        # Links are not followed: they lead to other files, or nowhere.
        is_own = isinstance(group.get(name, getlink=True), h5py.HardLink)
        each = group[name] if is_own and path.isprintable() else None
        if isinstance(each, h5py.Group) and path.count("/") < MOST_LEVELS:
            nodes[path] = (None, (), None, attributes(each), None)
            walk(h5py, each, f"{path}/", nodes)
        elif isinstance(each, h5py.Dataset):
            nodes[path] = dataset(h5py, path, each)
        else:
            raise Refused(f"{path} is no group and no dataset that flocsim writes")


def dataset(h5py: Any, path: str, each: Any) -> tuple:
    """Return the node of a dataset whose values lie in the file in one piece."""
    words = h5py.check_string_dtype(each.dtype)
    kind = "text" if words and words.length is None else TYPES.get(each.dtype.str)
    plan, end = each.id.get_create_plist(), os.fstat(0).st_size
    whole = plan.get_layout() == h5py.h5d.CONTIGUOUS and not plan.get_nfilters()
    if kind is None or each.shape is None or not whole or plan.get_external_count():
        raise Refused(f"{path} has a type, a shape or a layout that flocsim does not write")
    size, offset = each.size * each.dtype.itemsize, each.id.get_offset()
    if size and (not each.id.get_storage_size() or (offset or end) + size > end):
        raise Refused(f"the values of {path} are missing")
    text = None
    if words:
        values = each.asstr(errors="strict")[()]
        text = values.ravel().tolist() if each.shape else [values]
    return kind, each.shape, offset, attributes(each), text


def attributes(owner: Any) -> dict[str, Any]:
    """Return {name: value} of all attributes but those of UNREAD."""
    return {name: owner.attrs[name] for name in owner.attrs if name not in UNREAD}


def plain(value: Any) -> Any:
    """Return a value of numpy as Python has it, for JSON."""
    if isinstance(value, bytes):
        return value.decode()
    if not hasattr(value, "tolist"):
        raise Refused("an attribute has a value that flocsim does not write")
    return value.tolist()


if __name__ == "__main__":
    # What Python itself has comes first: no file of a folder there stands in for it.
    sys.path += sys.argv[1:]
    main()
