"""What all ranks of a job have to agree on before the first replicate, and which rank differs.

Rank 0 reads the config, the user's own modules and the flocs, and broadcasts them. What cannot be
broadcast is compared: the command line, and all that rows follow from, which includes the versions
of Python and of the packages, the code of the kernels, and how the machine rounds.
"""

import platform
from collections.abc import Mapping, Sequence
from typing import Any

import attrs

from flocsim.compiler.processor import versions
from flocsim.ensembles.config.sources import Sources
from flocsim.errors import UsageError

MOST_DIFFERENCES = 3

HASHED = {
    "code": "flocsim's own code",
    "kernels": "compiled code",
    "flocs": "flocs",
    "numbers": "parameters of the forces",
    "arithmetic": "rounding of sin, exp and similar functions (processor, C library or numpy)",
}
"""First part of a name of the identity → words in place of two hashes."""


@attrs.frozen
class Launch:
    """What rank 0 hands out: the words it was started with, and what it has read."""

    words: dict[str, Any]
    sources: Sources
    host: str = attrs.Factory(platform.node)


@attrs.frozen
class Facts:
    """What a rank's rows follow from: the identity of its study, versions; and its machine."""

    identity: dict[str, Any]
    versions: dict[str, str] = attrs.Factory(lambda: versions())
    host: str = attrs.Factory(platform.node)

    @property
    def values(self) -> dict[str, Any]:
        """All that has to be the same on all ranks, by name."""
        return self.versions | self.identity


def refuse_other_words(rank: int, launch: Launch, words: Mapping[str, Any]) -> None:
    """UsageError where this rank was started with other words than rank 0."""
    names = launch.words.keys() | words.keys()
    apart = [name for name in sorted(names) if launch.words.get(name) != words.get(name)]
    if apart:
        shown = [(name, words.get(name), launch.words.get(name)) for name in apart]
        raise UsageError(unlike(rank, shown, launch.host))


def disagreement(rank: int, leader: Facts, own: Facts) -> str:
    """What this rank would compute otherwise than rank 0, in one line; "" for nothing."""
    names = leader.values.keys() | own.values.keys()
    apart = [name for name in sorted(names) if leader.values.get(name) != own.values.get(name)]
    # Other versions have other code: what comes first in a list is why.
    apart.sort(key=lambda name: (not name.startswith("version"), kind_of(name) in HASHED))
    shown = [(name, own.values.get(name), leader.values.get(name)) for name in apart]
    return unlike(rank, shown, leader.host) if shown else ""


def kind_of(name):
    return name.partition(".")[0]


def unlike(rank: int, apart: Sequence[tuple[str, Any, Any]], host: str) -> str:
    """One line: who differs, in what (name, there, at rank 0), and what to do."""
    parts = []
    for name, there, here in apart[:MOST_DIFFERENCES]:
        if kind_of(name) in HASHED:
            rest = name.partition(".")[2]
            parts.append(f"other {HASHED[kind_of(name)]}" + (f" ({rest})" if rest else ""))
        else:
            parts.append(f"{name} {brief(there)} where rank 0 has {brief(here)}")
    more = len(apart) - len(parts)
    return (
        f"rank {rank} on {platform.node()} has {', '.join(parts)}"
        f"{f', and {more} more' if more > 0 else ''}, unlike rank 0 on {host}: nothing was run; "
        "start all ranks with the same arguments, files and installation"
    )


def brief(value):
    text = " ".join(repr(value).split()) if value is not None else "nothing"
    return text if len(text) <= 60 else f"{text[:57]}..."
