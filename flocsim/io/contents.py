"""What a file that flocsim wrote holds, by what it says that it is: the table of all kinds."""

import os
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from flocsim.errors import FileError
from flocsim.io.files import held
from flocsim.io.opening import kind_of
from flocsim.io.results import layout, strength_file, swarm_file, sweep_file
from flocsim.io.results.file import read_results
from flocsim.io.shapes import library
from flocsim.io.trajectory import KIND as TRAJECTORY
from flocsim.io.trajectory import read_trajectory

RESULTS, SWARM, SWEEP = layout.FORMAT, swarm_file.FORMAT, sweep_file.FORMAT
STRENGTH, LIBRARY = strength_file.FORMAT, library.KIND

READERS: dict[str, Callable[[Any], Any]] = {
    RESULTS: partial(read_results, replicates=False),
    SWARM: swarm_file.read_swarm,
    SWEEP: sweep_file.read_sweep,
    STRENGTH: strength_file.read_strengths,
    TRAJECTORY: read_trajectory,
    LIBRARY: library.read_library,
}
"""Kind of a file → what reads it."""


def content_of(
    path: str | os.PathLike, kinds: Iterable[str] = tuple(READERS),
    readers: Mapping[str, Callable[[Any], Any]] = READERS,
) -> tuple[str, Any]:  # fmt: skip
    """(kind, content) of a file of one of these kinds; FileError for one of another kind, or that
    is absent or damaged. What does not say its kind is read as the first of them."""
    source, known = held(path), list(kinds)
    kind = kind_of(source)
    if kind and kind not in known:
        raise FileError(f"{path} holds a {kind}: name a file of {' or '.join(known)}")
    kind = kind or known[0]
    return kind, readers[kind](source)
