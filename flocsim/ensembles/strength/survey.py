"""The bound doublets of a results file, each put into flows: what is tested, and what was found."""

import hashlib
import json
import os
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import attrs
import numpy as np

from flocsim.ensembles.config.sources import Allowed
from flocsim.ensembles.pairs.opened import StudyResults
from flocsim.ensembles.strength.opening import FLOWS, Doublet, Opening
from flocsim.errors import UsageError
from flocsim.fields import is_number
from flocsim.forces.outline import refuse_outlines
from flocsim.io.results.run_group import SOURCE, now
from flocsim.io.results.schema import AGGREGATED, OUTCOMES
from flocsim.io.results.strength_file import DOUBLETS, Strengths, strengths_of


class Bound(NamedTuple):
    """A bound doublet of a file: indices of type, N and δ, the replicate, and what holds it.

    Its fields, and those of Opening after them, are the columns of DOUBLETS.
    """

    type: int
    vertices: int
    delta: int
    replicate: int
    bond: int


@attrs.frozen
class Survey:
    """What is tested, and how; it can be sent to other processes.

    Parameters
    ----------
    path : path
        Results file of `flocsim ensemble`.
    flow : str
        "shear" or "extension": a key of `opening.FLOWS`.
    count : int, optional
        Number of doublets of each condition; all by default.
    precision : float
        Relative precision of a rate.
    allowed : Allowed
        Modules of the study's own classes that may be imported.

    Raises
    ------
    UsageError
        If a value is out of range.
    """

    path: Path = attrs.field(converter=Path)
    flow: str = "shear"
    count: int | None = None
    precision: float = 5e-3
    allowed: Allowed = attrs.Factory(Allowed)

    def __attrs_post_init__(self) -> None:
        if self.flow not in FLOWS:
            raise UsageError(f"flow must be one of {', '.join(FLOWS)}, found {self.flow!r}")
        if not is_number(self.precision) or not 1e-9 <= self.precision <= 1.0:
            raise UsageError(f"precision must lie between 1e-9 and 1, found {self.precision!r}")

    @property
    def results(self) -> Any:
        """The results, opened by each process for itself: after a fork two processes share the
        position in a file that was open before, and either would read where the other one is."""
        return opened(self.path, self.allowed.folder, tuple(self.allowed.own), os.getpid())

    def test(self, doublet: Bound) -> Opening:
        """Run a doublet again until it is bound, and then in flows of rising rate."""
        results = self.results
        start = results.replicate(
            doublet.replicate,
            results.types[doublet.type],
            int(results.vertices[doublet.vertices]),
            float(results.delta[doublet.delta]),
        )
        return Doublet(start, self.flow).opening(self.precision)

    @property
    def about(self) -> dict[str, Any]:
        """What two surveys have to agree on, so that one can continue the other."""
        run = {name: str(self.results.run[name]) for name in SOURCE if name in self.results.run}
        text = json.dumps(self.results.stored("identity"), sort_keys=True)
        digest = hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
        return run | {
            "flow": self.flow, "precision": self.precision, "study": self.path.name,
            "study_digest": digest,
        }  # fmt: skip


@cache
def opened(path: Path, folder: Path | None, own: tuple[str, ...], process: int) -> Any:
    """Return opened results whose bonds can be tested; ``process``: number of the reader."""
    results = StudyResults(path, Allowed(folder, own))
    refuse_outlines(results.config.forces, "the strength of a bond")
    return results


def bound_doublets(results: Any, count: int | None = None) -> list[Bound]:
    """Return the doublets that a study found bound, at most ``count`` of each condition.

    UsageError where there is none.
    """
    outcomes, bonds = results.replicates["outcome"], results.replicates["bond"]
    codes = [OUTCOMES.index(name) for name in AGGREGATED]
    found, taken = [], Counter[tuple[int, ...]]()
    for place in map(tuple, np.argwhere(np.isin(outcomes, codes)).tolist()):
        taken[place[:3]] += 1
        if count is None or taken[place[:3]] <= count:
            found.append(Bound._make((*place, int(bonds[place]))))
    if not found:
        raise UsageError(
            f"{results.path} has no bound doublet (class {' or '.join(AGGREGATED)}): there is no "
            "bond to test"
        )
    return found


def gathered(survey: Survey, tested: dict[Bound, Opening], complete: bool) -> Strengths:
    """Return the Strengths of the doublets that were tested, all that were asked for or not."""
    results = survey.results
    bound = np.zeros((len(results.types), len(results.vertices), len(results.delta)), np.int64)
    for each in bound_doublets(results):
        bound[each[:3]] += 1
    table = zip(*((*doublet, *opening) for doublet, opening in sorted(tested.items())), strict=True)
    columns = {
        name: np.array(values, kind)
        for (name, (kind, _, _)), values in zip(DOUBLETS.items(), table, strict=True)
    }
    about = survey.about | {"date": now(), "complete": complete}
    return strengths_of((results.types, results.vertices, results.delta), bound, columns, about)


def tested_in(found: Strengths) -> dict[Bound, Opening]:
    """Return what an earlier survey has tested, by doublet."""
    known = len(Bound._fields)
    rows = zip(*(found.column(name).tolist() for name in DOUBLETS), strict=True)
    return {Bound(*row[:known]): Opening(*row[known:]) for row in rows}


IN_WORDS = (
    "opens at {0.opens:.4g} 1/s",
    "already opens at {0.opens:.4g} 1/s, the lowest rate",
    "holds up to {0.holds:.4g} 1/s, the highest rate",
    "a run failed above {0.holds:.4g} 1/s",
)
"""What was found of a doublet, by its status."""


def in_words(opening: Opening) -> str:
    """Describe what was found of one doublet."""
    return f"{IN_WORDS[opening.status].format(opening)} ({opening.runs} runs)"
