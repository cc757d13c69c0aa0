"""Describe an HDF5 file to another process: its groups, its text, and where its numbers lie.

The HDF5 library follows every address in a file: made-up ones keep it busy for ever, crash it or
fill the memory, and links, external storage, virtual datasets and filters make it open other files.
A checksum does not help, since anyone can make one. So the library runs here, in a process of its
own with limits of time, memory and files, and what flocsim does not write is refused. Numbers are
not read at all: they lie in one piece each, and whoever wants them reads them from there.

The file is standard input, its description goes to standard output as JSON. This module is run by
its path, and imports nothing of flocsim, so that such a process starts quickly.
"""

import contextlib
import json
import os
import signal
import sys
from typing import Any

CPU_SECONDS, SECONDS = 10, 60
"""Limits of CPU time, and of time. A file of 2,000,000 texts takes 4 s."""

MEMORY = 2**30
"""Bytes beyond those that the process has when it begins."""

MOST_OBJECTS = 20_000
MOST_LEVELS = 4
MOST_DIMENSIONS = 6
MOST_TEXTS = 2_000_000
MOST_VALUES = 1_000
"""Of an attribute."""

UNREAD = {
    "units", "long_name", "flag_values", "CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST"
}  # fmt: skip
"""Attributes that are for other programs: flocsim knows them from its schema."""

TEXT_ITEM = [("length", "<u4"), ("heap", "<u8"), ("number", "<u4")]
"""What a dataset of text has of each value: its length, and where it lies."""


class Refused(ValueError):
    """A file holds what flocsim does not write; a line without the file's name."""


def set_limits() -> None:
    """Limit this process; where the system has no such limit, only time is limited."""
    if not hasattr(signal, "alarm"):  # Windows, where a process of ours has no other such timer
        import faulthandler

        faulthandler.dump_traceback_later(SECONDS, exit=True, file=sys.stderr)
        return
    import resource

    for number in (signal.SIGALRM, signal.SIGXCPU):
        signal.signal(number, signal.SIG_DFL)
    signal.alarm(SECONDS)
    limits = {"CPU": CPU_SECONDS, "FSIZE": 0, "CORE": 0}
    with contextlib.suppress(OSError), open("/proc/self/statm") as file:
        # Linux. Elsewhere a limit of addresses is not enforced, but no number is read here, and of
        # text no more than the file has.
        limits["AS"] = int(file.read().split()[0]) * resource.getpagesize() + MEMORY
    for name, most in limits.items():
        limit_to(resource, getattr(resource, f"RLIMIT_{name}"), most)


def limit_to(resource, which, most):
    """Lower a limit; one that is lower already stays."""
    _, least = resource.getrlimit(which)
    most = most if least == resource.RLIM_INFINITY else min(most, least)
    resource.setrlimit(which, (most, least))


def main(root_only: bool) -> None:
    """Write the description of the file; ends the process."""
    try:
        import h5py

        set_limits()
        found: dict[str, Any] = {"nodes": Walk(h5py).described(root_only)}
    except MemoryError:
        found = {"refused": f"it takes more than {MEMORY >> 30} GiB of memory"}
    except Exception as error:
        line = " ".join(str(error).split())[:300]
        found = {"refused": "".join(each for each in line if each.isprintable())}
    with open(1, "wb", closefd=False) as output:
        output.write(json.dumps(found).encode())
    os._exit(0)


class Walk:
    """A walk through all groups and datasets of the file.

    ``nodes``: {path: (type, shape, offset of its values, attributes, text)}, the type None for a
    group, the path of the root "".
    """

    def __init__(self, h5py: Any) -> None:
        self.h5py = h5py
        self.nodes: dict[str, tuple] = {}
        self.bytes_left = os.fstat(0).st_size
        types = h5py.h5t
        self.types = {
            "f8": types.IEEE_F64LE, "i8": types.STD_I64LE, "u1": types.STD_U8LE,
            "i4": types.STD_I32LE,
        }  # fmt: skip

    def described(self, root_only: bool) -> dict[str, tuple]:
        """Return the nodes of the file, or of its root alone."""
        proc = "/proc/self/fd/0"
        with contextlib.ExitStack() as resources:
            source = proc if os.path.exists(proc) else open(0, "rb", 0, closefd=False)  # noqa: SIM115
            file = resources.enter_context(self.h5py.File(source, "r", locking=False))
            if os.name == "posix":
                import resource

                # From here on nothing else can be opened.
                limit_to(resource, resource.RLIMIT_NOFILE, 0)
            root = self.h5py.h5o.open(file.id, b"/")
            self.nodes[""] = (None, (), None, self.attributes("the root", root), None)
            if not root_only:
                self.group("", root)
        return self.nodes

    def group(self, path: str, group: Any) -> None:
        """Walk all that is in a group."""
        names: list[bytes] = []

        def note(name: bytes) -> None:
            if len(names) + len(self.nodes) >= MOST_OBJECTS:
                raise Refused(f"it has more than {MOST_OBJECTS} groups and datasets")
            names.append(name)

        group.links.iterate(note)
        for name in names:
            inner = f"{path}/{checked_name(name)}".removeprefix("/")
            if group.links.get_info(name).type != self.h5py.h5l.TYPE_HARD:
                raise Refused(f"{inner} is a link, which flocsim never writes")
            if len(self.nodes) >= MOST_OBJECTS or inner.count("/") > MOST_LEVELS:
                raise Refused("its groups are nested too deep, or too many")
            each = self.h5py.h5o.open(group, name)
            attributes = self.attributes(inner, each)
            if isinstance(each, self.h5py.h5g.GroupID):
                self.nodes[inner] = (None, (), None, attributes, None)
                self.group(inner, each)
            elif isinstance(each, self.h5py.h5d.DatasetID):
                self.nodes[inner] = self.dataset(inner, each, attributes)
            else:
                raise Refused(f"{inner} is neither a group nor a dataset")

    def dataset(self, path: str, dataset: Any, attributes: dict) -> tuple:
        """Return the node of a dataset whose values lie in the file in one piece."""
        plan, layouts = dataset.get_create_plist(), self.h5py.h5d
        if plan.get_external_count():
            raise Refused(f"{path} has values in another file, which flocsim never writes")
        if plan.get_nfilters() or plan.get_layout() != layouts.CONTIGUOUS:
            raise Refused(f"the values of {path} are chunked, compressed, or in another dataset")
        kind = self.type_of(path, dataset.get_type())
        shape = self.shape_of(path, dataset.get_space())
        size = 16 if kind == "text" else int(kind[1:]) if kind in self.types else 0
        if not size:
            raise Refused(f"{path} holds values of a type that flocsim does not write")
        for length in shape:
            size *= length
        # A thousand datasets on the same bytes would fill the memory of whoever reads them.
        self.bytes_left -= size
        if self.bytes_left < 0:
            raise Refused("it promises more values than it has bytes")
        offset = dataset.get_offset()
        if size and (offset is None or dataset.get_storage_size() != size):
            raise Refused(f"the values of {path} are missing")
        text = self.text_in(path, dataset, shape, offset) if kind == "text" else None
        return kind, shape, offset, attributes, text

    def text_in(self, path: str, dataset: Any, shape: tuple, offset: int | None) -> list[str]:
        """Return all text of a dataset, once its lengths are known to be those of a file."""
        import numpy as np

        count = int(np.prod(shape))
        if not count:
            return []
        if count > MOST_TEXTS:
            raise Refused(f"{path} has more than {MOST_TEXTS} texts")
        with open(0, "rb", 0, closefd=False) as file:
            file.seek(offset or 0)
            items = np.frombuffer(file.read(16 * count), TEXT_ITEM)
        self.bytes_left -= int(items["length"].sum(dtype="u8"))
        if self.bytes_left < 0:
            raise Refused("it promises more text than it has bytes")
        values = self.h5py.Dataset(dataset)[()]
        return [each.decode() for each in (values.ravel() if shape else [values])]

    def attributes(self, where: str, owner: Any) -> dict[str, Any]:
        """Return {name: value} of all attributes; None for those of UNREAD."""
        names: list[bytes] = []
        self.h5py.h5a.iterate(owner, names.append)
        if len(names) > MOST_VALUES:
            raise Refused(f"{where} has more than {MOST_VALUES} attributes")
        named = {checked_name(name): name for name in names}
        found: dict[str, Any] = dict.fromkeys(named)
        for text in named.keys() - UNREAD:
            found[text] = self.attribute(f"attribute {text} of {where}", owner, named[text])
        return found

    def attribute(self, where: str, owner: Any, name: bytes) -> Any:
        """Return the value of an attribute: text, a number, or a list of such."""
        import numpy as np

        attribute = self.h5py.h5a.open(owner, name)
        kind = self.type_of(where, attribute.get_type())
        shape = self.shape_of(where, attribute.get_space())
        if np.prod(shape, dtype=object) > MOST_VALUES:
            raise Refused(f"{where} has more than {MOST_VALUES} values")
        values = np.zeros(shape, attribute.dtype)
        attribute.read(values)
        found = values.tolist()
        if kind in ("text", "fixed"):
            found = found.decode() if shape == () else [each.decode() for each in values.ravel()]
        return found

    def type_of(self, where: str, kind: Any) -> str:
        """Return the name of a type: a key of ``types``, "text", "fixed" (text of fixed length) or
        "flag"; Refused for all else."""
        known = next((name for name, each in self.types.items() if kind.equal(each)), "")
        classes = self.h5py.h5t
        if not known and kind.get_class() == classes.STRING:
            known = "text" if kind.is_variable_str() else "fixed"
        if not known and kind.get_class() == classes.ENUM and kind.dtype == bool:
            known = "flag"
        if not known:
            raise Refused(f"{where} holds values of a type that flocsim does not write")
        return known

    def shape_of(self, where: str, space: Any) -> tuple[int, ...]:
        """Return the shape of values that there are."""
        spaces = self.h5py.h5s
        simple = space.get_simple_extent_type() in (spaces.SCALAR, spaces.SIMPLE)
        if not simple or space.get_simple_extent_ndims() > MOST_DIMENSIONS:
            raise Refused(f"{where} has a shape that flocsim does not write")
        return tuple(space.get_simple_extent_dims())


def checked_name(name: bytes) -> str:
    """Return a name as text: printable, and not a path."""
    text = name.decode("utf-8", "replace")
    if not text.isprintable() or "/" in text or text in ("", ".", ".."):
        raise Refused(f"a name in it is not one that flocsim writes: {text!r}")
    return text


if __name__ == "__main__":
    main(sys.argv[1:] == ["root"])
