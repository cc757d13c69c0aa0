"""The file of `flocsim strength`: rates at which bound doublets open, one by one and by condition.

HDF5 with a checksum behind, groups with dimension scales:

- ``doublets``    every doublet that was tested: where it stands in the study, and what was found
- ``conditions``  how many of a condition were found bound, tested and opened, and quantiles

The attribute ``about`` (JSON) has the flow, the precision, where it came from, and whether all that
was asked for has been tested: the file of a survey that still runs, or was stopped, holds what
there is so far. Here its tables are made of rows, too, and told.
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.io.files import Rule, keep
from flocsim.io.groups import FileFormat, Group, declared
from flocsim.io.json_text import read_json
from flocsim.io.labelled import Labelled, Tables
from flocsim.io.results.schema import AXES, COORDINATES, FLAGS
from flocsim.io.terminal import aligned

STATUS = ("opened", "opens_at_least_rate", "holds_at_most_rate", "failed")
"""Words of the codes of ``status``: between two rates; at the lowest rate already; at none; a run
failed."""

OPENED, OPENS_AT_LEAST, HOLDS, FAILED = range(len(STATUS))

DOUBLETS = {
    "type": ("i8", "1", "place of the collision type in the study"),
    "vertices": ("i8", "1", "place of N in the study"),
    "delta": ("i8", "1", "place of the displacement in the study"),
    "replicate": ("i8", "1", "replicate of the study"),
    "bond": ("u1", "1", "what holds the pair"),
    "holds": ("f8", "s-1", "highest rate below the first opening at which it held; NaN: none"),
    "opens": ("f8", "s-1", "first rate found at which it opens; NaN: none"),
    "status": ("u1", "1", "what was found"),
    "runs": ("i8", "1", "rates at which it was run"),
    "tolerance": ("f8", "m", "largest tolerance that one of its runs needed; NaN: unknown"),
}
"""Columns (doublet,): {name: (type, units, long name)}."""

COUNTS = {
    "n_bound": ("i8", "1", "doublets found bound"),
    "n_tested": ("i8", "1", "doublets put into flows"),
    "n_opened": ("i8", "1", "doublets that opened"),
    "n_holding": ("i8", "1", "doublets that held at every rate"),
    "n_failed": ("i8", "1", "doublets with a failed run"),
}
"""Columns (type, vertices, delta) of ``conditions``."""

RATE = {"rate": ("f8", "s-1", "rate at which a share of the doublets has opened; inf: none")}
"""The column (type, vertices, delta, quantile)."""

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)

SCALES = COORDINATES | {
    "doublet": ("i8", "1", "number of the doublet"),
    "quantile": ("f8", "1", "share of the doublets"),
}
CODES = {"bond": FLAGS["bond"], "status": (range(len(STATUS)), STATUS)}

GROUPS = {
    "doublets": Group.of(
        declared(DOUBLETS, ("doublet",), CODES, along={name: name for name in AXES}), SCALES
    ),
    "conditions": Group.of(declared(COUNTS, AXES) | declared(RATE, (*AXES, "quantile")), SCALES),
}
STRENGTHS = FileFormat(
    "flocsim strength", 2, "strengths of bonds", GROUPS, lengths={"quantile": len(QUANTILES)},
    remedy="test the bonds again",
)  # fmt: skip


@attrs.frozen(eq=False)
class Strengths(Tables):
    """What `flocsim strength` has found: ``about``, how; the two groups of its file as Labelled."""

    about: dict[str, Any]
    doublets: Labelled
    conditions: Labelled
    indices = STRENGTHS.indices
    format = STRENGTHS.name

    @property
    def complete(self) -> bool:
        """Whether all doublets that were asked for have been tested."""
        return self.about.get("complete") is True

    @property
    def progress(self) -> str:
        """How many doublets have been tested, in words."""
        return f"{len(self.column('status'))} doublets"

    def labelled(self, group: str = "doublets") -> Labelled:
        """The arrays of "doublets" or "conditions"; UsageError for another group."""
        found: Labelled = getattr(self, self.known(group))
        return found

    def column(self, name: str) -> np.ndarray:
        """A column of the doublets (k,)."""
        return self.doublets.columns[name].values

    def table(self, name: str) -> np.ndarray:
        """A column of the conditions (type, vertices, delta, …)."""
        return self.conditions.columns[name].values


def write_strengths(path: str | Path, found: Strengths, rule: Rule = keep) -> None:
    """Write the file, whole or not at all; FileError if that is impossible."""
    groups = {"doublets": found.doublets, "conditions": found.conditions}
    STRENGTHS.write(path, groups, attributes={"about": json.dumps(found.about)}, rule=rule)


def read_strengths(path: str | os.PathLike) -> Strengths:
    """Return the Strengths of a file; FileError for one that is absent, damaged, or of another
    kind."""
    with STRENGTHS.opened(path) as file:
        stored = STRENGTHS.contents(file)
        about = read_json(stored.attributes["about"], {})
        return Strengths(about, stored.labelled("doublets"), stored.labelled("conditions"))


def quantiles_of(opens: np.ndarray, holding: int) -> np.ndarray:
    """Rates at which these shares of the doublets have opened, those that hold at any rate counted
    as inf; NaN without any doublet.

    The least rate at which at least the share has opened: no rate between two is made up.
    """
    ordered = np.concatenate([np.sort(opens), np.full(holding, np.inf)])
    if not len(ordered):
        return np.full(len(QUANTILES), np.nan)
    return np.quantile(ordered, QUANTILES, method="inverted_cdf")


def strengths_of(
    axes: tuple[Sequence[str], np.ndarray, np.ndarray], bound: np.ndarray,
    columns: dict[str, np.ndarray], about: dict[str, Any],
) -> Strengths:  # fmt: skip
    """The Strengths of tested doublets.

    ``axes``: types, N and δ of the study; ``bound``: how many it found bound of each condition;
    ``columns`` (k,): all of DOUBLETS.
    """
    status, opens = np.asarray(columns["status"]), np.asarray(columns["opens"])
    places = np.column_stack([columns[name] for name in AXES])
    shape = bound.shape
    counts = {name: np.zeros(shape, dtype=np.int64)
              for name in ("n_tested", "n_opened", "n_holding", "n_failed")}  # fmt: skip
    rate = np.full((*shape, len(QUANTILES)), np.nan)
    for place in map(tuple, np.unique(places, axis=0).tolist()):
        rows = np.all(places == place, axis=1)
        opened = rows & np.isin(status, (OPENED, OPENS_AT_LEAST))
        holding = int(np.sum(rows & (status == HOLDS)))
        counts["n_tested"][place], counts["n_opened"][place] = rows.sum(), opened.sum()
        counts["n_holding"][place] = holding
        counts["n_failed"][place] = np.sum(rows & (status == FAILED))
        rate[place] = quantiles_of(opens[opened], holding)
    scales = dict(zip(AXES, axes, strict=True)) | {"quantile": QUANTILES}
    return Strengths(
        about, GROUPS["doublets"].labelled({"doublet": np.arange(len(status)), **columns}),
        GROUPS["conditions"].labelled({**scales, "n_bound": bound, **counts, "rate": rate}),
    )  # fmt: skip


def table_of(found: Strengths) -> str:
    """Return counts and quantiles of every condition that has a bound doublet, as text."""
    counts = ("n_bound", "n_tested", "n_opened")
    heads = ["type", "N", "delta", *(name.removeprefix("n_") for name in counts)]
    rows = [heads + [f"G {100.0 * each:g} %" for each in QUANTILES]]
    axes = [found.conditions.axes[name].values.tolist() for name in AXES]
    for place in map(tuple, np.argwhere(found.table("n_bound"))):
        name, n, delta = (values[each] for values, each in zip(axes, place, strict=True))
        rates = [f"{each:.4g}" for each in found.table("rate")[place]]
        rows.append([name, str(n), f"{delta:g}", *(str(found.table(c)[place]) for c in counts),
                     *rates])  # fmt: skip
    return "\n".join(aligned(rows, left=1))
