"""What the commands may write to: the one rule for every file that one of them makes.

- What a command reads is never what it writes, whatever its options.
- A file that exists is left alone, and the command ends before anything is run. Only a results
  file that is extended is replaced.
- With ``--overwrite`` the new file takes the place, and the old one is kept as name.1.h5.
"""

import contextlib
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import attrs

from flocsim.errors import UsageError
from flocsim.io.files import Old, Rule, check_writable, keep, ordinary_target


def data_rule(overwrite: bool = False) -> Rule:
    """Return the rule for new files: with ``overwrite`` the old one is kept under another name."""
    return (lambda _: Old.SET_ASIDE) if overwrite else keep


def extension_rule(path: str | os.PathLike) -> Rule:
    """Return the rule for a file that was read, and is written anew with more in it.

    As long as it is the file that it was when this was called; any other one is kept.
    """
    before = fingerprint(path)
    return lambda target: Old.REPLACED if fingerprint(target) == before else Old.KEPT


def fingerprint(path):
    about = os.stat(path)
    return about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns


WAYS = "add --overwrite, which keeps the old one under another name"
"""What a user can do where a file is in the way, besides naming another place."""

SCRIPT_WAYS = "give overwrite=True, which keeps the old one under another name"
"""The same in Python."""


@attrs.frozen
class Output:
    """A file to be written: its rule, the longest ending that a name made from it gets, and the
    ``endings`` of which it must have one, as (".png", ".pdf")."""

    path: str | os.PathLike
    rule: Rule = keep
    suffix: str = ""
    ways: str = WAYS
    endings: Sequence[str] = ()


def check_ending(path: str | os.PathLike, endings: Sequence[str]) -> None:
    """Raise UsageError for a name that has none of these endings, capital or not."""
    if Path(path).suffix.lower() not in endings:
        raise UsageError(f"{path}: its name must end in {' or '.join(endings)}")


def check_outputs(outputs: Iterable[Output], inputs: Iterable[str | os.PathLike]) -> None:
    """Raise now what would keep these from being written later, before anything is run.

    UsageError for another ending, for an output that is one of the ``inputs`` or of the other
    outputs, and for a file in the way; FileError for what cannot be written.
    """
    sources = {mark_of(source): source for source in inputs}
    sources.pop(None, None)
    seen: dict[object, Output] = {}
    for output in outputs:
        if output.endings:
            check_ending(output.path, output.endings)
        target = ordinary_target(output.path)
        for name in (target, target.with_name(target.name + output.suffix)):
            if (source := sources.get(mark_of(name))) is not None:
                raise UsageError(
                    f"writing {output.path} would replace {source}, which is an input: name another"
                )
        if (mark := mark_of(target)) in seen:
            raise UsageError(
                f"{output.path} and {seen[mark].path} are the same file, but two outputs are to be "
                "written: name another file for one of them"
            )
        if mark is not None:
            seen[mark] = output
        if os.path.lexists(target) and output.rule(target) is Old.KEPT:
            raise in_the_way(output.path, output.ways)
        check_writable(output.path)


def in_the_way(path: str | os.PathLike, ways: str = WAYS) -> UsageError:
    """Return the UsageError for a file that exists where another is to be written."""
    return UsageError(f"{path} already exists and is left as it is: name another output, or {ways}")


def mark_of(path):
    """What all paths of a file have in common: its inode, or the resolved path of what is not
    there; None for a name that the system cannot take, of which whoever opens it tells."""
    with contextlib.suppress(OSError, ValueError):
        about = os.stat(path)
        return about.st_dev, about.st_ino
    with contextlib.suppress(OSError, ValueError):
        return os.path.realpath(path)
    return None


def loaded_sources() -> list[str]:
    """Return the files of all modules that are loaded: a user's own force is read as well."""
    files = (getattr(module, "__file__", None) for module in list(sys.modules.values()))
    return [file for file in files if isinstance(file, str)]
