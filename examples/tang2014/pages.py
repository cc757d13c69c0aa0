"""Figures, tables and claims of a finished study: what reproduce.py writes at its end."""

import numpy as np
from changes import second_run_changes
from claims import COLLISION_CLAIMS, check_claims
from claims.several import read_touches
from claims.table import claims_table
from exceptions import exceptions_figure
from output import save_all, write_page, write_table
from summary import write_summary

from flocsim.ensembles.collision.start import zone_distance
from flocsim.io.plots.results import FIGURES
from flocsim.io.plots.shapes import POPULATION_FIGURES
from flocsim.io.results.file import read_results
from flocsim.io.results.schema import CLASSES
from flocsim.io.shape_library import read_library

MOST_VERTICES = 64
ESTIMATES = ("pr_inside", "pr_a_given_inside", "pr_a_given_outside", "pr_a")
ENDS = ("", "_low", "_high", "_numerical")
FLIPPED = {"4": ("zone", (0, 1, 2, 3)), "5": ("aggregation", (0, 1)), "6": ("aggregation", (2, 3)),
           "8": ("outcome", (0, 1, 2, 3))}  # fmt: skip
"""Figure → which flips are its numerical error, and among which classes."""


def write(folder, config, readings):
    """Write all of it into the folder; ``config``: the study's; ``readings``: {name: file}."""
    study = read_results(folder / "study.h5")
    changes = second_run_changes(study)
    entries = library_of(folder, "errors.h5")
    draw_results(folder, study, changes)
    if entries:
        for name, figure in POPULATION_FIGURES.items():
            write_figure(folder, name, figure(entries))
        if (figure := exceptions_figure(study, entries)) is not None:
            write_figure(folder, "exceptions", figure)
    write_probabilities(folder / "probabilities.csv", study, changes)
    held = hold_readings(readings)
    if held:
        write_readings(folder / "readings.md", held)
    ways = {"flocsim": check_claims(study, entries, read_touches(folder / "several.csv"))}
    if (folder / "study-paper.h5").exists():
        errors = library_of(folder, "errors-paper.h5")
        ways["paper"] = check_claims(read_results(folder / "study-paper.h5"), errors)
    clay = read_results(folder / "study-clay.h5")
    ways["clay"] = check_claims(clay)
    write_summary(folder, {"flocsim": study, "clay": clay}, changes, ways, held, zones_of(config))


def library_of(folder, name):
    """Return the entries of a shape library in the folder, None without."""
    return read_library(folder / name) if (folder / name).exists() else None


def zones_of(config):
    """{type: D_0 [m]}."""
    return {
        name: zone_distance(config.zone, config.forces, *radii)
        for name, radii in config.scene.given
    }


def write_figure(folder, name, figure):
    """Save a figure in every format, and say where."""
    for path in save_all(figure, folder / f"figure-{name}"):
        print(path)


def draw_results(folder, study, changes):
    """Figs 4, 5, 6 and 8, the numerical error written into each panel."""
    for name, (kind, classes) in FLIPPED.items():
        figure = FIGURES[name](study)
        among = np.isin(study.replicates["checked_outcome"], classes)
        changed = getattr(changes, kind)
        for place, axes in enumerate(figure.axes[: len(study.types)]):
            text = flip_text(changed[place] & among[place], among[place])
            axes.set_title(text, loc="right", fontsize=6, color="0.35")
        write_figure(folder, name, figure)


def flip_text(changed, among):
    """ "flips 1 of 1092 (0.09 %)"; nothing where nothing was run again."""
    count, flipped = int(np.count_nonzero(among)), int(np.count_nonzero(changed & among))
    share = f" ({100.0 * flipped / count:.2g} %)" if flipped else ""
    return f"flips {flipped} of {count}{share}" if count else ""


def write_probabilities(path, study, changes):
    """One row per condition: every probability, both errors, and the flips beside it."""
    table = study.probabilities
    heads = ["type", "vertices", "delta", "n_total", "n_missed", "n_undecided", "n_failed"]
    heads += [f"{name}{end}" for name in ESTIMATES for end in ENDS]
    rows = [[*heads, "run_again", "zone_flips", "aggregation_flips", "outcome_flips"]]
    for place in np.ndindex(*study.shape):
        t, v, d = place
        values = [table[name][place] for name in heads[3:]]
        counts = [int(np.sum(getattr(changes, kind)[place]))
                  for kind in ("checked", "zone", "aggregation", "outcome")]  # fmt: skip
        shown = [f"{value:.6g}" for value in values]
        rows.append([study.types[t], study.vertices[v], f"{study.delta[d]:g}", *shown, *counts])
    write_table(path, rows)
    print(path)


def hold_readings(readings):
    """{name: (Results, Findings of the claims about collisions)}."""
    results = {name: read_results(file) for name, file in readings.items()}
    return {
        name: (each, [found for found in check_claims(each) if found.number in COLLISION_CLAIMS])
        for name, each in results.items()
    }


def write_readings(path, held):
    """Every part of the claims under every reading."""
    lines = []
    for name, (_, findings) in held.items():
        lines += [f"## {name}", "", claims_table(findings), ""]
    write_page(path, "\n".join(lines))
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
