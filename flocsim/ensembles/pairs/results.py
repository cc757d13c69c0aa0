"""What a results file of pairs or rates holds, for the commands: facts, text, the tables of its
page.
"""

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from flocsim.ensembles import report
from flocsim.ensembles.config.sources import Allowed
from flocsim.ensembles.contents import (
    Contents,
    Facts,
    Figures,
    Row,
    Summary,
    later,
    study_summary,
)
from flocsim.io.labelled import Labelled
from flocsim.io.results import run_group, schema
from flocsim.io.results.events import ends_of
from flocsim.io.results.file import read_results
from flocsim.io.results.numerics import numerics_matter
from flocsim.io.results.run_group import stored

SAID_APART = (report.MOST_UNDECIDED, "settling", "size_classes", "equivalent_spheres")
"""Facts of the group ``run`` that the summary has in its own words."""


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


def sizes(results: schema.Results) -> Facts:
    """Return the size classes, and the radii of the types."""
    radii = zip(results.types, *results.radii.values(), strict=True)
    known = [f"{name}: {1e6 * i:.4g}, {1e6 * j:.4g}" for name, i, j in radii if i > 0.0 and j > 0.0]
    facts = [("r_i, r_j [um]", "; ".join(known))] if known else []
    if classes := run_group.class_words(stored(results.run, "size_classes")):
        facts.insert(0, ("size classes", classes.partition(": ")[2]))
    return facts


def outcomes(results: schema.Results) -> Facts:
    """Return how many replicates came to what, all conditions together."""
    table = {name: values.sum(axis=(0, 1, 2)) for name, values in results.probabilities.items()}
    counts = dict(zip(schema.CLASSES, table["n_class"], strict=True))
    counts |= {name: table[f"n_{name}"] for name in schema.OUTCOMES if name not in counts}
    bonds = zip(schema.BONDS, table["n_bond"], strict=True)
    return [
        ("outcomes", ", ".join(f"{counts[name]} {name}" for name in schema.OUTCOMES)),
        ("bonds", ", ".join(f"{n} {word}" for word, n in bonds)),
    ]


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


def swept_table(table: Labelled) -> tuple[Sequence[str], Row]:
    """Return outcomes and Pr[A] of the conditions of a sweep: heads, and the cells at a place."""
    columns = {name: each.values for name, each in table.columns.items()}
    ends = ends_of(columns)

    def row(place: tuple[int, ...]) -> Sequence[str]:
        counts = (str(each[place]) for each in (columns["n_total"], *ends.values()))
        pr_a = (columns[name][place] for name in ("pr_a", "pr_a_low", "pr_a_high"))
        return *counts, report.with_interval(*pr_a)

    return ("n", *ends, "Pr[A] [low, high]"), row


class PairFiles(Contents):
    """What becomes of the rows of a study of pairs or rates; what commands show of its files."""

    title = "results of a collision ensemble"
    on_examples = (
        "One pair of each class at the largest N, run again from the seed and seen from the "
        "receiving floc. It stays in contact longer than about three quarters of its class. Frames "
        "are spaced by distance, not by time. Red rings mark contacts."
    )
    first = ("kernels", "efficiency", "outcomes", "delta", "8")
    file = schema.RESULTS
    compared = schema.COMPARED
    swept = ("probabilities", "pooled")
    drawn = ("outcomes", "overview", "4", "5", "6", "8")
    swept_table = staticmethod(swept_table)
    results = later("ensembles.pairs.study", "results")
    old_rows = later("ensembles.pairs.study", "old_rows")
    so_far = later("ensembles.pairs.study", "so_far")
    facts = later("ensembles.pairs.study", "facts")
    stop_rule = later("ensembles.estimates.statistics", "stop_rule")
    dry_run = later("ensembles.diagnose.dry_run", "dry_run")
    opened = later("ensembles.pairs.opened", "StudyResults")
    compare = later("ensembles.pairs.comparison", "compare")
    examples = later("ensembles.pairs.opened", "examples_of")
    outlines = later("ensembles.pairs.opened", "outlines_of")
    answer = later("ensembles.pairs.answer", "answer_sentence")
    setting = later("ensembles.pairs.answer", "setting_sentence")
    verdict = staticmethod(report.verdict)
    read = staticmethod(read_results)

    def summary(self, results: schema.Results) -> Summary:
        """Return what a results file says of its study."""
        run = results.run
        facts = conditions(results) + sizes(results) + outcomes(results)
        facts += settling(run) + thermal(run)
        more = filter(None, [report.verdict(results)[1].removeprefix("warning: ")])
        return study_summary(facts, run, run_group.describe_note, SAID_APART, more)

    def table(self, results: schema.Results, numerics: bool = False, every: bool = False) -> str:
        """Return the rates; or the counts and probabilities; and their errors.

        ``numerics``, ``every``: as of `report.format_table`; numerics also where they matter,
        efficiencies only with every.
        """
        numerics = numerics or every or numerics_matter(results)
        if results.kernel is not None:
            lines = report.kernel_lines(results.kernel, numerics)
        else:
            lines = [report.format_table(results, numerics, every)]
            lines += report.efficiency_lines(results) * every
        lines += [*report.touch_lines(results), report.numerics_line(results)]
        return "\n".join(filter(None, [*lines, report.outlines_line(results)]))

    detailed = table

    def rows(self, results: schema.Results) -> list[list[str]]:
        """Return the table of every condition as cells; of rates there is the text."""
        if results.kernel is not None:
            return []
        columns = report.columns_of(results, numerics_matter(results), every=False)
        return [["type", *columns]] + [
            [results.types[at[0]], *(cell(at) for cell in columns.values())]
            for at in np.ndindex(results.shape)
        ]

    def running(self, found: Any) -> Facts:
        """Return the conditions of a study of pairs that still runs."""
        results = found.results
        planned = f", {found.asked // math.prod(results.shape)} planned" if found.asked else ""
        counts = results.probabilities["n_total"]
        return [
            *axes_of(results),
            ("replicates", f"{counts.min()} to {counts.max()} in each of {counts.size} conditions"
             f"{planned}"),
        ]  # fmt: skip

    def counts(self, found: schema.Results) -> Sequence[int]:
        """Return the numbers of replicates of all conditions."""
        numbers: list[int] = found.probabilities["n_total"].ravel().tolist()
        return numbers

    def figures(self, found: schema.Results) -> Figures:
        """Return the figures of pairs, or of rates."""
        from flocsim.io.plots.curves import KERNEL_FIGURES
        from flocsim.io.plots.results import FIGURES

        return FIGURES if found.kernel is None else KERNEL_FIGURES

    def water(self, path: Any, allowed: Allowed) -> list[str]:
        """Return lines on how often the equivalent spheres touch with water between them."""
        return list(map(run_group.water_words, self.opened(path, allowed).in_water()))


CONTENTS = PairFiles()
