"""What the commands may write to: the one rule for every file that one of them makes.

- What a command reads is never what it writes, whatever its options.
- A file that exists is left alone, and the command ends before anything is run. Only a results
  file that is extended is replaced.
- With ``--overwrite`` the new file takes the place, and the old one is kept as name.1.h5.
"""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from flocsim.errors import UsageError
from flocsim.io.files import Rule, check_writable, is_kept, ordinary_target

WAYS = "add --overwrite (in Python overwrite=True), which keeps the old one under another name"
"""What a user can do where a file is in the way, besides naming another place."""


def check_ending(path: str | os.PathLike, endings: Sequence[str]) -> None:
    """Raise UsageError for a name that has none of these endings, capital or not."""
    if Path(path).suffix.lower() not in endings:
        raise UsageError(f"{path}: its name must end in {' or '.join(endings)}")


def check_outputs(
    outputs: Iterable[str | os.PathLike], rule: Rule, inputs: Iterable[str | os.PathLike] = (),
    ways: str = WAYS, endings: Sequence[str] = (),
) -> None:  # fmt: skip
    """Raise now what would keep files from being written later, before anything is run.

    UsageError for an output that has none of the ``endings``, if any are given, that is one of the
    ``inputs`` or of the other outputs, and for a file in the way; FileError for what cannot be
    written.
    """
    sources = {os.path.realpath(source): source for source in inputs}
    seen: dict[str, str | os.PathLike] = {}
    for output in outputs:
        if endings:
            check_ending(output, endings)
        target = ordinary_target(output)
        if (name := str(target)) in sources:
            raise UsageError(
                f"writing {output} would replace {sources[name]}, which is an input: name another"
            )
        if name in seen:
            raise UsageError(
                f"{output} and {seen[name]} are the same file, but two outputs are to be "
                "written: name another file for one of them"
            )
        seen[name] = output
        if os.path.lexists(target) and is_kept(target, rule):
            raise in_the_way(output, ways)
        check_writable(output)


def in_the_way(path: str | os.PathLike, ways: str = WAYS) -> UsageError:
    """Return the UsageError for a file that exists where another is to be written."""
    return UsageError(f"{path} already exists and is left as it is: name another output, or {ways}")
