"""The error by the shape: what probabilities would be with the outlines of all flocs cut closer, or
wider.

The same replicates are run with outlines at either end of their bands, so that the change is one of
paired proportions, over the replicates that count both times.  The interval of the shape reaches
from the lower 95 % bound of the one change to the upper bound of the other, and holds 0.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from flocsim.ensembles.estimates.paired import bounded_cells, bounded_difference
from flocsim.io.results.events import events
from flocsim.io.results.schema import BAND_ENDS, NOT_APPLICABLE, last_axis

OF_OUTLINES = " of outlines"
"""Behind the name of a probability: what is summed of it for either end."""


def outline_sums(
    first: Sequence[np.ndarray], ends: Sequence[Sequence[np.ndarray]]
) -> dict[str, np.ndarray]:
    """{"pr_a of outlines": whole numbers (end, 3, type, …, 4)}, bounded_cells of replicates with
    outlines cut otherwise, and as they were cut; nothing where none was run so.

    ``first``, ``ends``: outcome, inside and bond, codes (type, vertices, delta, replicate).
    """
    if all(np.all(outcome == NOT_APPLICABLE) for outcome, _, _ in ends):
        return {}
    as_cut = events(*first)
    found: dict[str, list[np.ndarray]] = {name: [] for name in as_cut}
    for codes in ends:
        run = codes[0] != NOT_APPLICABLE
        for name, here in events(*codes).items():
            there = as_cut[name]
            cells = bounded_cells(
                type(here)(*(run & flags for flags in here)),
                type(there)(*(run & flags for flags in there)),
            )
            # (3, class or bond, type, …, 4) → the class or bond before the cells.
            found[name].append(np.moveaxis(cells, 1, -2) if last_axis(name) else cells)
    return {name + OF_OUTLINES: np.stack(cells) for name, cells in found.items()}


def outline_changes(
    sums: Mapping[str, np.ndarray], table: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """The arrays of OUTLINES from outline_sums; NaN where no replicate counts.

    ``table``: the probabilities as cut, which no change takes beyond 0 and 1.
    """
    found: dict[str, np.ndarray] = {}
    for key, cells in sums.items():
        name = key.removesuffix(OF_OUTLINES)
        differences, lows, highs = zip(
            *(bounded_difference(each, scrambled=False) for each in cells), strict=True
        )
        found |= {f"{name}_{end}": change
                  for end, change in zip(BAND_ENDS, differences, strict=True)}  # fmt: skip
        low, high = np.minimum(*lows), np.maximum(*highs)
        found[f"{name}_shape_low"] = np.clip(low, -table[name], 0.0)
        found[f"{name}_shape_high"] = np.clip(high, 0.0, 1.0 - table[name])
    return found
