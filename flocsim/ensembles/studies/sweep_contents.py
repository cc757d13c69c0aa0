"""What the joined file of a sweep holds, for the commands."""

import os
from typing import Any

from flocsim.ensembles.config.kinds import STUDIES, contents_of
from flocsim.ensembles.contents import Contents, Facts, Figures, Joined, Summary, in_words, studies
from flocsim.io.results.sweep_file import SweepResults, read_sweep
from flocsim.io.terminal import aligned


def kinds_joined() -> list[Joined]:
    """What is joined of each kind that sweeps can run."""
    return [each.joined for each in studies() if each.joined is not None]


def joined_of(results: Any) -> Joined | None:
    """What is joined of results; None for those of a kind that sweeps cannot run."""
    name = getattr(results, "format", "")
    found: Joined | None = contents_of(name).joined if name in STUDIES else None
    return found


def read_joined(path: str | os.PathLike) -> SweepResults:
    """The SweepResults in a joined file; FileError for one that is absent, damaged, of another kind
    or version."""
    return read_sweep(path, [(each.groups, each.axes) for each in kinds_joined()])


def kind_of(found: SweepResults) -> Joined:
    """What was joined in a file."""
    return next(each for each in kinds_joined() if each.groups.keys() == found.groups.keys())


def summary(found: SweepResults) -> Summary:
    """The swept keys, by the names of their dimensions, and their values."""
    facts: Facts = []
    for name, each in found.swept.items():
        unit = "" if each.unit == "1" else f" {each.unit}"
        values = ", ".join(map(in_words, each.values))
        facts.append((f"{each.key} (as {name})", f"{values}{unit}"))
    return Summary(facts)


def table(found: SweepResults) -> str:
    """Numbers at every value."""
    kind = kind_of(found)
    return "\n".join([*aligned(kind.rows(found)), *kind.below(found)])


def figures(found: SweepResults) -> Figures:
    """The figures of what was joined."""
    return kind_of(found).figures


CONTENTS = Contents(
    title="a sweep", read=read_joined, summary=summary, table=table,
    figures=figures,
    drawn={"the joined file of flocsim sweep":
           {name: draw for each in kinds_joined() for name, draw in each.figures.items()}},
    opened=lambda path, folder=None, sources=None: read_joined(path),
)  # fmt: skip
