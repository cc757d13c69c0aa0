"""The whole page of a results file: what `flocsim info` and `plot` say of it, and motion."""

import io
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from flocsim.commands.info import summary, swarm_summary
from flocsim.commands.plot import swarm_figures
from flocsim.commands.reporting.examples import Example
from flocsim.commands.reporting.markup import facts_of, list_of, page_of, picture_of, table_of, text
from flocsim.commands.reporting.motion import SCRIPT, motion_of
from flocsim.ensembles.report import EFFICIENCY, efficiency_rows, graze_lines
from flocsim.io.plots.results import FIGURES
from flocsim.io.plots.style import METADATA, house_style
from flocsim.io.results.file import Totals
from flocsim.io.results.schema import CLASSES, POOLED_PROBABILITIES, PROBABILITIES, Results
from flocsim.io.results.swarm_file import SwarmResults, table_rows

MOST_FAILURES = 20
Section = tuple[str, str, str]
"""Anchor, heading and HTML."""

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


def report_page(path: str, results: Results, totals: Totals, examples: Sequence[Example]) -> str:
    """The HTML of a results file; FileError as `summary` raises it."""
    said = summary(path, results, totals)
    sections = [("results", "What was run, and what came out", facts_of(said.facts))]
    if said.warnings or said.failed:
        more = len(said.failed) - MOST_FAILURES
        shown = said.failed[:MOST_FAILURES]
        shown += [f"and {more} more in run/failed"] if more > 0 else []
        content = list_of(said.warnings, "warnings") + list_of(shown, "failed")
        sections.append(("warnings", "Warnings", content))
    sections.append(("figures", "Figures", figures_of(FIGURES, results)))
    sections.append(("tables", "Probabilities", tables_of(results)))
    if examples:
        motions = "\n".join(map(motion_of, examples))
        told = (
            "<p>The first replicate of each class, of the flocs with the most vertices, run again "
            "from the seed. Seen from the receiving floc; frames follow the way, not the time. "
            "Red rings: outlines overlap there.</p>"
        )
        sections.append(("motion", "In motion", f"{told}<div class='motions'>{motions}</div>"))
    sections.append(provenance_of(results.run, said.origin))
    return page_of(f"{path}: results of a collision ensemble", sections, SCRIPT)


def swarm_page(path: str, results: SwarmResults) -> str:
    """The HTML of a results file of swarms."""
    facts, came, warnings = swarm_summary(path, results)
    sections = [("results", "What was run, and what came out", facts_of(facts))]
    if warnings:
        sections.append(("warnings", "Warnings", list_of(warnings, "warnings")))
    sections.append(("figures", "Figures", figures_of(swarm_figures(results), results)))
    heads, *rows = table_rows(results)
    sections.append(("tables", "Clusters over time, means over swarms", table_of(heads, rows)))
    sections.append(provenance_of(results.run, came))
    return page_of(f"{path}: results of a swarm study", sections, SCRIPT)


def provenance_of(run: Mapping[str, Any], origin: Sequence[tuple[str, str]]) -> Section:
    """The section on where results came from."""
    config, came = str(run.get("config", "")), facts_of(origin)
    if config:
        lines = "\n".join(map(text, config.splitlines()))
        came += f"<h3>Config</h3><pre>{lines}</pre>"
    return "provenance", "Where it came from", came


def figures_of(figures: Mapping[str, Callable[..., Any]], results: Any) -> str:
    """Figures of `flocsim plot`, outcomes and that of everything first."""
    first = ("outcomes", "overview")
    names = sorted(figures, key=lambda name: first.index(name) if name in first else len(first))
    return "\n".join(figure_of(name, figures[name], results) for name in names)


def figure_of(name: str, draw: Callable[..., Any], results: Any) -> str:
    """A figure of `flocsim plot` inside the page, its caption being the help of it."""
    picture = io.BytesIO()
    with house_style():
        draw(results).savefig(picture, format="svg", metadata=METADATA["svg"])
    title = f"Figure {name}" if name.isdigit() else name.capitalize()
    return picture_of(picture.getvalue(), f"{title}: {(draw.__doc__ or '').partition(chr(10))[0]}")


def tables_of(results: Results) -> str:
    """The probabilities of every condition, and those pooled over displacements."""
    table = results.probabilities
    heads = ["type", "N", "δ/δ_max", "n", "collided", "inside", *SHOWN.values(), *CLASSES,
             "missed", "held", "undecided", "failed", "run again", "flipped"]  # fmt: skip
    places = list(np.ndindex(*results.shape))
    rows = [condition_row(results, table, place) for place in places]
    firsts = [row for row, place in enumerate(places) if place[1:] == (0, 0)]
    told = [ERRORS_TEXT, *graze_lines(results.delta)]
    parts = [*(f"<p>{text(line)}</p>" for line in told), table_of(heads, rows, firsts)]
    if results.pooled:
        heads = ["type", "N", *(PROBABILITIES[name] for name in POOLED_PROBABILITIES)]
        places = list(np.ndindex(*results.shape[:2]))
        rows = [
            [results.types[t], int(results.vertices[v]),
             *(with_errors(results.pooled, name, (t, v)) for name in POOLED_PROBABILITIES)]
            for t, v in places
        ]  # fmt: skip
        parts.append("<h3>All displacements pooled</h3>" + table_of(heads, rows))
    if rows := efficiency_rows(results):
        heads = ["type", "N", "in the plane", "axially"]
        parts.append(f"<h3>Efficiency</h3><p>{text(EFFICIENCY)}</p>" + table_of(heads, rows))
    return "\n".join(parts)


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
