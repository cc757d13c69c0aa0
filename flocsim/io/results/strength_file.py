"""The file of `flocsim strength`: rates at which bound doublets open, one by one and by condition.

HDF5 with a checksum behind, groups with dimension scales:

- ``doublets``    every doublet that was tested: where it stands in the study, and what was found
- ``conditions``  how many of a condition were found bound, tested and opened, and quantiles

The attribute ``about`` (JSON) has the flow, the precision, where it came from, and whether all that
was asked for has been tested: the file of a survey that still runs, or was stopped, holds what
there is so far. Here its tables are made of rows, too, and told.
"""

import json
from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from flocsim.io.groups import FileFormat, Group, Stored, declared
from flocsim.io.json_text import read_json
from flocsim.io.results.schema import AXES, COORDINATES, FLAGS
from flocsim.io.terminal import aligned, rows_along

STATUS = ("opened", "opens_at_least_rate", "holds_at_most_rate", "failed")
"""Words of the codes of ``status``: between two rates; at the lowest rate already; at none; a run
failed."""

OPENED, OPENS_AT_LEAST, HOLDS, FAILED = range(len(STATUS))

DOUBLETS = {
    "type": ("i8", "1", "index of the collision type in the study"),
    "vertices": ("i8", "1", "index of N in the study"),
    "delta": ("i8", "1", "index of the displacement in the study"),
    "replicate": ("i8", "1", "replicate of the study"),
    "bond": ("u1", "1", "what holds the pair"),
    "holds": ("f8", "s-1", "highest rate below the first opening at which it held; NaN: none"),
    "opens": ("f8", "s-1", "lowest rate found at which it opens; NaN: none"),
    "status": ("u1", "1", "result of the test"),
    "runs": ("i8", "1", "number of rates at which it was run"),
    "tolerance": ("f8", "m", "largest tolerance among its runs; NaN: unknown"),
}
"""Columns (doublet,): {name: (type, units, long name)}."""

COUNTS = {
    "n_bound": ("i8", "1", "bound doublets"),
    "n_tested": ("i8", "1", "tested doublets"),
    "n_opened": ("i8", "1", "doublets that opened"),
    "n_holding": ("i8", "1", "doublets that did not open at any rate"),
    "n_failed": ("i8", "1", "doublets with a failed run"),
}
"""Columns (type, vertices, delta) of ``conditions``."""

RATE = {"rate": ("f8", "s-1", "rate at which a fraction of the doublets has opened; inf: none")}
"""The column (type, vertices, delta, quantile)."""

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)

SCALES = COORDINATES | {
    "doublet": ("i8", "1", "number of the doublet"),
    "quantile": ("f8", "1", "fraction of the doublets"),
}
CODES = {"bond": FLAGS["bond"], "status": (range(len(STATUS)), STATUS)}

GROUPS = {
    "doublets": Group.of(
        declared(DOUBLETS, ("doublet",), CODES, along={name: name for name in AXES}), SCALES
    ),
    "conditions": Group.of(declared(COUNTS, AXES) | declared(RATE, (*AXES, "quantile")), SCALES),
}


@attrs.frozen(eq=False, repr=False)
class Strengths(Stored):
    """What `flocsim strength` has found: the two groups of its file, and ``about``, how."""

    about: dict[str, Any] = attrs.field(init=False)

    def __attrs_post_init__(self) -> None:
        object.__setattr__(self, "about", read_json(self.attributes["about"], {}))

    @property
    def complete(self) -> bool:
        """Return True if all doublets that were asked for have been tested."""
        return self.about.get("complete") is True

    @property
    def progress(self) -> str:
        """Return how many doublets have been tested, in words."""
        return f"{len(self.column('status'))} doublets"

    def column(self, name: str) -> np.ndarray:
        """Return a column of the doublets (k,)."""
        return self.groups["doublets"][name]

    def table(self, name: str) -> np.ndarray:
        """Return a column of the conditions (type, vertices, delta, …)."""
        return self.groups["conditions"][name]


STRENGTHS = FileFormat(
    "flocsim strength", 2, "strengths of bonds", GROUPS, lengths={"quantile": len(QUANTILES)},
    remedy="test the bonds again", view=Strengths,
)  # fmt: skip
read_strengths = STRENGTHS.read
"""(path) → Strengths; FileError for a file that is absent, damaged or of another kind."""


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
    found = {name: np.zeros(bound.shape, np.int64) for name in COUNTS} | {"n_bound": bound}
    found["rate"] = np.full((*bound.shape, len(QUANTILES)), np.nan)
    has_opened = np.isin(status, (OPENED, OPENS_AT_LEAST))
    for place in map(tuple, np.unique(places, axis=0).tolist()):
        rows = np.all(places == place, axis=1)
        opened, holding = rows & has_opened, int(np.sum(rows & (status == HOLDS)))
        found["n_tested"][place], found["n_opened"][place] = rows.sum(), opened.sum()
        found["n_holding"][place] = holding
        found["n_failed"][place] = np.sum(rows & (status == FAILED))
        found["rate"][place] = quantiles_of(opens[opened], holding)
    scales = dict(zip(AXES, axes, strict=True)) | {"quantile": QUANTILES}
    made: Strengths = STRENGTHS.stored(
        {"doublets": columns, "conditions": found}, scales, {}, {"about": json.dumps(about)}
    )
    return made


def table_of(found: Strengths) -> str:
    """Return counts and quantiles of every condition that has a bound doublet, as text."""
    counts = ("n_bound", "n_tested", "n_opened")
    heads = [name.removeprefix("n_") for name in counts] + [f"G {100 * p:g} %" for p in QUANTILES]

    def row(place: tuple[int, ...]) -> Sequence[str]:
        rates = (f"{each:.4g}" for each in found.table("rate")[place])
        return *(str(found.table(name)[place]) for name in counts), *rates

    axes = {name: found.table(name) for name in AXES}
    places = map(tuple, np.argwhere(found.table("n_bound")).tolist())
    return "\n".join(aligned(rows_along(axes, heads, row, places), left=1))
