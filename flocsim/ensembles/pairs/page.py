"""The tables of a page on pairs: probabilities of every condition, pooled ones, efficiencies."""

import math

import numpy as np

from flocsim.ensembles.contents import Table
from flocsim.ensembles.report import EFFICIENCY, efficiency_rows, graze_lines, kernel_lines
from flocsim.io.results.schema import CLASSES, POOLED_PROBABILITIES, PROBABILITIES, Results

SHOWN = {
    "pr_inside": "Pr[inside]", "pr_a": "Pr[A]", "pr_sticks": "Pr[A, sticks]",
    "pr_hangs": "Pr[A, hangs]",
}  # fmt: skip
"""The probabilities of a condition that have columns of their own, and their headings."""

ERRORS_TEXT = (
    "Each probability is followed by its 95 % interval, of sampling (Wilson's) and of what "
    "undecided and failed replicates could have come to, and by the least and the most by which it "
    "would change if all replicates were computed exactly (95 %; of those pooled the larger, after "
    "±), and, where outlines were cut closer and wider as well, if all were cut so (shape, 95 %). "
    "– where there was no event, ± ? where none was run again."
)


def tables_of(results: Results) -> list[Table | str]:
    """The probabilities of every condition, and those pooled over displacements."""
    table = results.probabilities
    heads = ["type", "N", "δ/δ_max", "n", "collided", "inside", *SHOWN.values(), *CLASSES,
             "missed", "held", "undecided", "failed", "run again", "flipped"]  # fmt: skip
    places = list(np.ndindex(*results.shape))
    rows = [condition_row(results, table, place) for place in places]
    firsts = [row for row, place in enumerate(places) if place[1:] == (0, 0)]
    said = [ERRORS_TEXT, *graze_lines(results.delta)]
    found: list[Table | str] = []
    if results.kernel is not None:
        found.append("\n".join(kernel_lines(results.kernel)))
    found.append(Table("Probabilities", heads, rows, said, firsts))
    if results.pooled:
        heads = ["type", "N", *(PROBABILITIES[name] for name in POOLED_PROBABILITIES)]
        rows = [
            [results.types[t], int(results.vertices[v]),
             *(with_errors(results.pooled, name, (t, v)) for name in POOLED_PROBABILITIES)]
            for t, v in np.ndindex(*results.shape[:2])
        ]  # fmt: skip
        found.append(Table("All displacements pooled", heads, rows))
    if efficiencies := efficiency_rows(results):
        heads = ["type", "N", "in the plane", "axially"]
        found.append(Table("Efficiency", heads, efficiencies, [EFFICIENCY]))
    return found


def condition_row(results, table, place):
    t, v, d = place
    counts = [int(table[name][place]) for name in ("n_total", "n_collided", "n_inside")]
    names = ("missed", "held", "undecided", "failed", "checked", "flipped")
    ends = [int(table[f"n_{name}"][place]) for name in names]
    return [
        results.types[t], int(results.vertices[v]), f"{results.delta[d]:g}", *counts,
        *(with_errors(table, name, place, results.numerics)
          + shape_error(results.outlines, name, place) for name in SHOWN),
        *(int(number) for number in table["n_class"][place]), *ends,
    ]  # fmt: skip


def shape_error(outlines, name, place):
    """ " shape −0.020 +0.050": by how much outlines cut otherwise would change a probability."""
    if not outlines or math.isnan(outlines[f"{name}_shape_low"][place]):
        return ""
    down, up = (float(outlines[f"{name}_shape{end}"][place]) for end in ("_low", "_high"))
    return f" shape {down:+.3f} {up:+.3f}".replace("-", "−")


def with_errors(table, name, place, numerics=None):
    """ "0.600 [0.571, 0.629] −0.004 +0.010": value, sampling interval, by how much numerics change
    it, or "± 0.010" where their sign is not known."""
    value, low, high, numerical = (
        float(table[name + end][place]) for end in ("", "_low", "_high", "_numerical")
    )
    if math.isnan(value):
        return "–" if math.isnan(high) else f"[{low:.3f}, {high:.3f}]"
    added = "± ?" if math.isnan(numerical) else f"± {numerical:.3f}"
    if numerics and not math.isnan(numerical):
        down, up = (float(numerics[f"{name}_change{end}"][place]) for end in ("_low", "_high"))
        added = f"{down:+.3f} {up:+.3f}".replace("-", "−")
    return f"{value:.3f} [{low:.3f}, {high:.3f}] {added}"
