"""What a results file of pairs or rates holds, for the commands: facts, text, the tables of its
page.
"""

import json
import math
from functools import partial
from typing import Any

import numpy as np

from flocsim.ensembles import report
from flocsim.ensembles.contents import (
    Contents,
    Facts,
    Figures,
    Joined,
    Summary,
    Table,
    in_words,
    later,
    origin,
)
from flocsim.errors import visible
from flocsim.io.plots.curves import KERNEL_FIGURES, SWEEP_FIGURES
from flocsim.io.plots.results import FIGURES, OF_ROWS
from flocsim.io.results import run_group, schema
from flocsim.io.results.events import ENDS_COUNTED, ends_of
from flocsim.io.results.file import Overview, read_overview, read_results, with_rows
from flocsim.io.results.run_group import stored

SHOWN = {
    "pr_inside": "Pr[inside]", "pr_a": "Pr[A]", "pr_sticks": "Pr[A, sticks]",
    "pr_hangs": "Pr[A, hangs]",
}  # fmt: skip
"""The probabilities of a condition that have columns of their own, and their headings."""

SAID_APART = (report.MOST_UNDECIDED, "settling", "size_classes", "equivalent_spheres")
"""Facts of the group ``run`` that the summary has in its own words."""

ERRORS_TEXT = (
    "Each probability is followed by its 95 % interval, which covers sampling (Wilson's) and the "
    "possible outcomes of undecided and failed replicates; by the lower and upper bound of its "
    "change if all replicates were computed exactly (95 %; for pooled ones the larger of the two, "
    "after ±); and, where outlines were also cut closer and wider, by its change if all were cut "
    "so (shape, 95 %). – means that there was no event, ± ? that no replicate was run again."
)


def tables_of(results: schema.Results) -> list[Table | str]:
    """The probabilities of every condition, and those pooled over displacements."""
    table = results.probabilities
    heads = ["type", "N", "δ/δ_max", "n", "collided", "inside", *SHOWN.values(), *schema.CLASSES,
             "missed", "held", "undecided", "failed", "run again", "flipped"]  # fmt: skip
    places = list(np.ndindex(*results.shape))
    rows = [condition_row(results, table, place) for place in places]
    firsts = [row for row, place in enumerate(places) if place[1:] == (0, 0)]
    said = [ERRORS_TEXT, *report.graze_lines(results.delta)]
    found: list[Table | str] = []
    if results.kernel is not None:
        found.append("\n".join(report.kernel_lines(results.kernel)))
    found.append(Table("Probabilities", heads, rows, said, firsts))
    if results.pooled:
        heads = ["type", "N", *(schema.PROBABILITIES[name] for name in schema.POOLED_PROBABILITIES)]
        rows = [
            [results.types[t], int(results.vertices[v]),
             *(with_errors(results.pooled, name, (t, v)) for name in schema.POOLED_PROBABILITIES)]
            for t, v in np.ndindex(*results.shape[:2])
        ]  # fmt: skip
        found.append(Table("All displacements pooled", heads, rows))
    if efficiencies := report.efficiency_rows(results):
        heads = ["type", "N", "in the plane", "axially"]
        found.append(Table("Efficiency", heads, efficiencies, [report.EFFICIENCY]))
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


def summary(results: Overview) -> Summary:
    """What a results file says of its study; ValueError where that cannot be read."""
    run = results.run
    facts = conditions(results) + sizes(results) + outcomes(results)
    checked = report.checked_line(results) or "unknown: no replicate was run again"
    facts.append(("numerical error", checked))
    facts += [("", line) for line in report.change_lines(results)]
    warnings = [str(line) for line in stored(run, "warnings")]
    warnings += filter(None, [report.undecided_line(results)])
    failed = [run_group.describe_note(note) for note in stored(run, "failed")]
    facts += settling(run) + thermal(run)
    facts += [("touched", line) for line in report.touch_lines(results)]
    return Summary(facts, origin(run, SAID_APART), warnings, failed)


def counts_of(results: schema.Results) -> list[str]:
    """Return lines of the counts and probabilities, or of the rates."""
    if results.kernel is not None:
        return report.kernel_lines(results.kernel)
    return [report.format_table(results)]


def table(results: schema.Results) -> str:
    """Return the counts and probabilities, after the efficiencies if there are any; or the
    rates."""
    before = report.efficiency_lines(results) if results.kernel is None else []
    return "\n".join([*before, *[""] * bool(before), *counts_of(results)])


def told(found: schema.Results) -> str:
    """Return what is printed of a study that has been run."""
    errors = report.checked_line(found), *report.change_lines(found)
    return "\n".join([*counts_of(found), *report.touch_lines(found), *filter(None, errors)])


def conditions(results: schema.Results) -> Facts:
    """What was simulated."""
    over = stored(results.run, "overrides")
    return [
        *axes_of(results),
        ("replicates", f"{results.count} in each of {math.prod(results.shape)} conditions"),
        *([("overrides", json.dumps(over))] if over else []),
    ]


def axes_of(results: schema.Results) -> Facts:
    """The conditions."""
    return [
        ("types", ", ".join(results.types)),
        ("vertices", ", ".join(f"{n} (sphere)" if n == 1 else str(n) for n in results.vertices)),
        ("delta / delta_max", ", ".join(f"{share:g}" for share in results.delta)),
    ]


def sizes(results: Overview) -> Facts:
    """[(name, value)] of the radii of the types, and between which values the replicates were."""
    radii = zip(results.types, *results.radii.values(), strict=True)
    known = [f"{name}: {1e6 * i:.4g}, {1e6 * j:.4g}" for name, i, j in radii if i > 0.0 and j > 0.0]
    facts = [("r_i, r_j [um]", "; ".join(known))] if known else []
    if classes := run_group.class_words(stored(results.run, "size_classes")):
        facts.insert(0, ("size classes", classes.partition(": ")[2]))
    units = {"r_i": 1e6, "r_j": 1e6, "D_0": 1e6, "d_c_over_D_0": 1.0}
    words = {name: f"{name} [um]" for name in units} | {"d_c_over_D_0": "d_c/D_0 at touch"}
    for name, (low, high) in results.totals.spans.items():
        low, high = units[name] * low, units[name] * high
        if f"{low:.4g}" != f"{high:.4g}":
            facts.append((words[name], f"{low:.4g} to {high:.4g} in the replicates"))
    return facts


def outcomes(results: Overview) -> Facts:
    """(name, value) of what came out, all conditions together."""
    totals = results.totals
    found = zip(schema.OUTCOMES, totals.outcomes, strict=True)
    rows = [("outcomes", ", ".join(f"{n} {word}" for word, n in found))]
    numbers = results.probabilities["n_bond"].sum(axis=(0, 1, 2))
    bonds = zip(schema.BONDS, numbers, strict=True)
    rows.append(("bonds", ", ".join(f"{n} {word}" for word, n in bonds)))
    named = list(zip(results.failures, totals.failures, strict=True))[1:]
    if any(number for _, number in named):
        rows.append(("reasons", ", ".join(f"{n} {w}" for w, n in named if n)))
    if totals.count:
        steps = f"{totals.steps / totals.count:.4g} on average, {totals.most_steps} at "
        steps += f"most; {totals.rejected} of {totals.steps + totals.rejected} rejected"
        rows.append(("steps", steps))
    return rows


def settling(run):
    """[(name, value)] of the bodies at their terminal speeds, a line for each collision type."""
    types: dict[str, list[str]] = {}
    for each in stored(run, "settling"):
        number = f"{each['body']} Re {each['reynolds']:.2g} St {each['stokes']:.2g}"
        types.setdefault(each["type"], []).append(number)
    return [("settling", f"{name}: {', '.join(numbers)}") for name, numbers in types.items()]


def thermal(run):
    """[(name, value)] of what integrals say of equivalent spheres, for each type of a brownian
    study."""
    found = stored(run, "equivalent_spheres")
    return [("thermal", f"{each['type']}: {run_group.sphere_words(each)}") for each in found]


def running(found: Any) -> Facts:
    """[(name, value)] of the conditions of a study of pairs that still runs."""
    results = found.results
    planned = f", {found.asked // math.prod(results.shape)} planned" if found.asked else ""
    counts = results.probabilities["n_total"]
    return [
        *axes_of(results),
        ("replicates", f"{counts.min()} to {counts.max()} in each of {counts.size} conditions"
         f"{planned}"),
        ("numerical error",
         report.checked_line(results) or "unknown: no replicate was run again yet"),
    ]  # fmt: skip


def sweep_rows(found: Any) -> list[tuple[str, ...]]:
    """Outcomes and Pr[A] of every value and condition, heads first."""
    table = found.labelled("probabilities")
    ends = ends_of({name: table.columns[name].values for name in ENDS_COUNTED})
    rows = [(*found.swept, "type", "N", "delta", "n", *ends, "Pr[A]", "[95 %]")]
    axes = [table.axes[name].values.tolist() for name in table.columns["pr_a"].axes]
    columns = [table.columns[name].values for name in ("n_total", "pr_a", "pr_a_low", "pr_a_high")]
    for place in np.ndindex(*columns[0].shape):
        names = [axis[k] for axis, k in zip(axes, place, strict=True)]
        n, value, low, high = (column[place] for column in columns)
        told = (f"{value:.3f}" if value == value else "-",
                f"[{low:.3f}, {high:.3f}]" if high == high else "-")  # fmt: skip
        counts = (str(each[place]) for each in ends.values())
        rows.append((*(visible(in_words(each), "") for each in names), str(n), *counts, *told))
    return rows


def figures(results: schema.Results) -> Figures:
    """The figures of pairs, or of rates."""
    return FIGURES if results.kernel is None else KERNEL_FIGURES


def asked(results: Any) -> dict[str, Any]:
    """The axes of results, and how many replicates each condition has."""
    return {"types": list(results.types), "vertices": results.vertices.tolist(),
            "delta": results.delta.tolist(), "replicates": results.count}  # fmt: skip


OF_KIND = partial(later, "ensembles.pairs.study")
OPENED = later("ensembles.pairs.opened", "open_results")

CONTENTS = Contents(
    title="results of a collision ensemble",
    read=partial(read_results, replicates=False), overview=read_overview, summary=summary,
    table=table, told=told, figures=figures, tables=tables_of,
    examples=later("ensembles.pairs.opened", "examples_of"),
    drawn={
        "a results file, with bars of Wilson's 95 % and thin outer ones with the numerical error":
            FIGURES,
        "a kernel study": KERNEL_FIGURES,
    },
    with_rows=with_rows, rows_drawn=OF_ROWS, running=running, run=lambda found: found.run,
    opened=OPENED, compare=later("ensembles.pairs.comparison", "compare"), compared=schema.COMPARED,
    joined=Joined(
        {name: schema.GROUPS[name] for name in ("probabilities", "pooled")}, sweep_rows,
        SWEEP_FIGURES, asked, {axis: len(words) for axis, words in schema.LAST_AXES.items()},
        tuple(schema.RADII),
        lambda swept: report.graze_lines(swept.labelled("probabilities").axes["delta"].values),
    ),
    results=OF_KIND("results"), old_rows=OF_KIND("old_rows"), so_far=OF_KIND("so_far"),
    facts=OF_KIND("facts"), verdict=report.verdict,
    stop_rule=later("ensembles.estimates.statistics", "stop_rule"),
    dry_run=later("ensembles.diagnose.dry_run", "dry_run"),
    rates=lambda found: found.kernel,
    water=lambda path, allowed: list(map(run_group.water_words, OPENED(path, allowed).in_water())),
)  # fmt: skip
