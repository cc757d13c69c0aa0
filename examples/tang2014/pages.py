"""Figures, tables and claims of a finished study: what reproduce.py writes at its end."""

import csv

import numpy as np

from flocsim.ensembles.claims import FIT_CLAIMS, check_claims
from flocsim.ensembles.claims.table import claims_table, verdicts_table
from flocsim.ensembles.config import IntegratorConfig
from flocsim.ensembles.flips import flips_between, share
from flocsim.io.intervals import proportion
from flocsim.io.plots import FIGURES, POPULATION_FIGURES, save
from flocsim.io.results import CLASSES, read_results
from flocsim.io.shape_library import read_library

FORMATS = ("png", "pdf")
MOST_VERTICES = 64
ESTIMATES = ("pr_inside", "pr_a_given_inside", "pr_a_given_outside", "pr_a")
FLIPPED = {"4": ("zone", (0, 1, 2, 3)), "5": ("aggregation", (0, 1)), "6": ("aggregation", (2, 3)),
           "8": ("outcome", (0, 1, 2, 3))}  # fmt: skip
"""Figure → which flips are its numerical error, and among which classes."""


def default_tolerance():
    """The tolerance [m] of a config that gives none."""
    return IntegratorConfig().tolerance


def write(folder, library, readings):
    """Write all of it into the folder; ``library`` with the errors of fits, or None."""
    study, check = (read_results(folder / name) for name in ("study.h5", "check.h5"))
    flips = flips_between(study, check)
    entries = read_library(library) if library else None
    draw_results(folder, study, check, flips)
    if entries:
        for name, figure in POPULATION_FIGURES.items():
            save_all(folder, name, figure(entries))
    write_probabilities(folder / "probabilities.csv", study, flips)
    write_claims(folder / "claims.md", study, entries, flips)
    if readings:
        write_readings(folder / "readings.md", readings)


def save_all(folder, name, figure):
    """Save a figure in every format."""
    for ending in FORMATS:
        path = folder / f"figure-{name}.{ending}"
        save(figure, path)
        print(path)


def draw_results(folder, study, check, flips):
    """Figs 4, 5, 6 and 8, the numerical error written into each panel."""
    for name, (kind, classes) in FLIPPED.items():
        figure = FIGURES[name](study)
        among = np.isin(check.replicates["outcome"], classes)[..., : flips.both.shape[-1]]
        changed = getattr(flips, kind)
        for place, axes in enumerate(figure.axes[: len(study.types)]):
            text = flip_text(changed[place] & among[place], among[place])
            axes.set_title(text, loc="right", fontsize=6, color="0.35")
        save_all(folder, name, figure)


def flip_text(changed, among):
    """ "flips 0.09 % of 1092"; nothing where nothing was run again."""
    count = int(np.count_nonzero(among))
    return f"flips {share(changed, among):.2g} % of {count}" if count else ""


def write_probabilities(path, study, flips):
    """One row per condition: every probability, its interval, and the flips beside it."""
    table = study.probabilities
    heads = ["type", "vertices", "delta", "n_total", "n_missed", "n_undecided", "n_failed"]
    heads += [f"{name}{end}" for name in ESTIMATES for end in ("", "_low", "_high")]
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow([*heads, "run_again", "zone_flips", "aggregation_flips", "outcome_flips"])
        for place in np.ndindex(*study.shape):
            t, v, d = place
            values = [table[name][place] for name in heads[3:]]
            counts = [int(np.sum(getattr(flips, kind)[place]))
                      for kind in ("zone", "aggregation", "outcome")]  # fmt: skip
            shown = [f"{value:.6g}" for value in values]
            rows.writerow([study.types[t], study.vertices[v], f"{study.delta[d]:g}", *shown,
                           flips.outcome.shape[-1], *counts])  # fmt: skip
    print(path)


def write_claims(path, study, entries, flips):
    """The claims table under the totals of the study."""
    text = f"{totals(study, flips)}\n\n{claims_table(check_claims(study, entries))}\n"
    path.write_text(text, "utf-8")
    print(path)


def totals(study, flips):
    """How many replicates there were, what was left open, and what flipped."""
    kinds = (
        ("aggregation", flips.both), ("zone", flips.both), ("outcome", np.ones_like(flips.outcome)),
    )  # fmt: skip
    lines = [counts_text(study)]
    for kind, among in kinds:
        changed, count = np.count_nonzero(getattr(flips, kind)), np.count_nonzero(among)
        value, low, high = (100.0 * float(each) for each in proportion(changed, count))
        lines.append(
            f"{kind} flips at a 100x tighter tolerance: {changed} of {count} "
            f"({value:.2f} %, 95 % {low:.2f} to {high:.2f} %)"
        )
    return "\n\n".join(lines)


def counts_text(results):
    """ "total 25500, collided 21905, missed …"; the classes last."""
    table = results.probabilities
    names = ("total", "collided", "missed", "undecided", "failed")
    counts = [f"{name} {int(table[f'n_{name}'].sum())}" for name in names]
    classes = table["n_class"].sum(axis=(0, 1, 2))
    counts += [f"{name} {count}" for name, count in zip(CLASSES, classes, strict=True)]
    return ", ".join(counts)


def write_readings(path, readings):
    """The claims about collisions against the readings."""
    results = {name: read_results(file) for name, file in readings.items()}
    found = {name: check_claims(each)[len(FIT_CLAIMS) :] for name, each in results.items()}
    lines = [verdicts_table(found), ""]
    lines += [f"- {name}: {counts_text(each)}" for name, each in results.items()]
    for name, findings in found.items():
        lines += ["", f"## {name}", "", claims_table(findings)]
    path.write_text("\n".join(lines) + "\n", "utf-8")
    print(path)


def examples_of_classes(path):
    """{class: replicate}: the first of each class among Type I, N = 64, δ = 0 (Fig. 7)."""
    results = read_results(path)
    if "I" not in results.types or MOST_VERTICES not in results.vertices:
        return {}
    place = results.types.index("I"), list(results.vertices).index(MOST_VERTICES), 0
    outcome = results.replicates["outcome"][place]
    first = {name: np.flatnonzero(outcome == code) for code, name in enumerate(CLASSES)}
    return {name: int(places[0]) for name, places in first.items() if len(places)}
