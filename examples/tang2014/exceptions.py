"""The flocs of the replicates that contradict a claim about every collision, by their outlines."""

from collections import Counter

import numpy as np
from claims.robust import ALWAYS, contradicting
from matplotlib.patches import Polygon

from flocsim.io.plots.style import new_figure

MOST = 12
COLUMNS = 4


def exceptions_figure(study, entries, vertices=64):
    """Flocs that contradict, most frequent first: a figure; None for none.

    Black: the core of the fit with so many ``vertices``; blue: the disc of its area. Above: name,
    in how many of the contradicting pairs it is, of how many.
    """
    counts, pairs = flocs_against(study)
    least = min(entry.spheroradius for entry in entries)
    # A library of several spheroradii has them in the names.
    known = {entry.floc_id.partition(" r=")[0]: entry for entry in entries
             if vertices in entry.fits and entry.spheroradius == least}  # fmt: skip
    shown = [(name, times) for name, times in counts.most_common() if name in known][:MOST]
    if not shown:
        return None
    rows = -(-len(shown) // COLUMNS)
    figure = new_figure(1.8 * COLUMNS, 2.0 * rows)
    turn = np.linspace(0.0, 2.0 * np.pi, 90)
    for place, (name, times) in enumerate(shown):
        axes = figure.add_subplot(rows, COLUMNS, place + 1)
        core = known[name].fits[vertices].table.place
        size = known[name].equivalent_radius * known[name].pixel_size
        axes.add_patch(Polygon(core, facecolor="0.8", edgecolor="black", linewidth=0.8))
        axes.plot(size * np.cos(turn), size * np.sin(turn), linewidth=0.8)
        axes.set_title(f"{name}\nin {times} of {pairs} pairs", fontsize=6)
        axes.set_aspect("equal")
        axes.autoscale_view()
        axes.set_axis_off()
    return figure


def flocs_against(study, claims=tuple(ALWAYS)):
    """(Counter of the names of flocs in pairs that contradict these claims, how many pairs): a
    type and a replicate are a pair, as its flocs are the same in all conditions of N > 1."""
    flags = np.any([contradicting(study, number) for number in claims], axis=0)
    counts, pairs = Counter(), 0
    for kind, k in np.argwhere(flags.any(axis=(1, 2))):
        place = kind, *np.argwhere(flags[kind, ..., k])[-1], k
        numbers = {int(study.replicates[body][place]) for body in ("floc_i", "floc_j")}
        counts.update(study.flocs[number] for number in numbers if number >= 0)
        pairs += 1
    return counts, pairs
