"""What shapes do: Pr[A] and the classes against the shape measures of the flocs, and how much of
the variance of Pr those explain."""

from collections.abc import Mapping

import attrs
import numpy as np

from flocsim.io.confidence import bounded_sums, clustered_proportion, explained_share
from flocsim.io.plots import style
from flocsim.io.plots.style import Figure, drawing, plain
from flocsim.io.results.events import events
from flocsim.io.results.schema import Results

ALL_COLOUR = "0.15"

PAIR_MEASURES = {
    "aspect_ratio": "mean aspect ratio",
    "circularity": "mean circularity",
    "solidity": "mean solidity",
    "size_ratio": "size ratio, smaller over larger",
}
"""What is said of the shapes of two flocs: of both the mean, of their radii the ratio."""

BINS = 5
"""Of about as many replicates each."""


@attrs.frozen(eq=False)
class ShapeEffect:
    """Pr[A] of a collision type, all displacements pooled, against a measure of its pairs.

    ``measure``: the median of each bin (k,); ``pr_a`` and ``pr_class``: (value, low, high) of 95 %
    (3, k) and (3, 4, k), a replicate being a cluster; ``explained``: (share, low, high) of the
    variance of Pr between replicates that the bins explain, ``by_pair`` the same of which two flocs
    met: what any measure of their shapes can explain at most. NaN where too little is known.
    """

    measure: np.ndarray
    pr_a: np.ndarray
    pr_class: np.ndarray
    explained: tuple[float, float, float]
    by_pair: tuple[float, float, float]


def shape_effect(rows: Mapping[str, np.ndarray], name: str) -> ShapeEffect:
    """The ShapeEffect of a measure of PAIR_MEASURES.

    ``rows``: the columns of a collision type at one N (delta, replicate).
    """
    found = events(rows["outcome"], rows["inside"], rows["bond"])
    counts = [np.asarray(np.sum(each, axis=0, dtype=np.int64)) for each in found["pr_a"]]
    trials, successes = counts[:2]
    # A replicate has the same flocs at all displacements; one that failed does not say which.
    if name == "size_ratio":
        values = np.minimum(rows["r_i"], rows["r_j"]) / np.maximum(rows["r_i"], rows["r_j"])
    else:
        values = 0.5 * (rows[f"{name}_i"] + rows[f"{name}_j"])
    known = np.isfinite(values).any(axis=0)
    value = np.where(known, np.nanmax(np.where(known, values, -np.inf), axis=0), np.nan)
    places = bins_of(value)
    groups = [places == k for k in range(places.max(initial=-1) + 1)]
    classes = [np.sum(each, axis=1, dtype=np.int64) for each in found["pr_class"]]
    middle = np.array([np.median(value[group]) for group in groups])
    pr_a = [pooled(counts, group) for group in groups]
    pr_class = [pooled(classes, group) for group in groups]
    counted = (trials > 0) & known
    mean = successes[counted] / trials[counted]
    flocs = np.stack([np.max(rows[name], axis=0)[counted] for name in ("floc_i", "floc_j")])
    pairs = np.unique(flocs, axis=1, return_inverse=True)[1].ravel()
    return ShapeEffect(
        middle,
        np.array(pr_a).reshape(-1, 3).T,
        np.moveaxis(np.array(pr_class).reshape(-1, 3, 4), 0, -1),
        explained_share(places[counted], mean),
        explained_share(pairs, mean),
    )


def pooled(counts, group):
    """(value, low, high) over a group of replicates, the last axis of the counts of Events."""
    trials, successes, unknown = (each[..., group] for each in counts)
    sums = bounded_sums(successes, trials, unknown)
    return clustered_proportion(sums)[:3]


def bins_of(values: np.ndarray) -> np.ndarray:
    """The bin of every value, from 0 in rising order, −1 for NaN: of about equally many each, or of
    one value each where there are no more than BINS."""
    places = np.full(values.shape, -1)
    known = np.isfinite(values)
    # Values that differ by rounding alone are one.
    exact, number = np.unique(np.round(values[known], 9), return_inverse=True)
    if len(exact) <= BINS:
        places[known] = number
        return places
    edges = np.unique(np.quantile(exact[number], np.arange(1, BINS) / BINS))
    places[known] = np.unique(np.searchsorted(edges, exact[number], "left"), return_inverse=True)[1]
    return places


def shape_effects(results: Results) -> Figure:
    """Pr[A] and classes against shape: aspect ratio, circularity, solidity, size ratio.

    A row of panels for each collision type, at the largest N, all displacements pooled. Points:
    the replicates in up to five bins of about equally many, with 95 % intervals. Titles: the share
    of the variance of Pr[A] between replicates that the bins explain, with its 95 % interval, and
    at the end of a row that which is explained by which two flocs met.
    """
    number = int(np.argmax(results.vertices))
    count = len(results.types)
    with drawing(2.15 * len(PAIR_MEASURES) + 1.9, 1.95 * count + 0.5) as figure:
        grid = figure.subplots(count, len(PAIR_MEASURES), sharey=True, sharex="col", squeeze=False)
        for t, (row, title) in enumerate(zip(grid, style.type_titles(results.types), strict=True)):
            row[0].set_ylabel(f"{title}\nprobability")
            for axes in row:
                style.set_probability_axis(axes)
            if results.replicates is None:
                style.note(row[0], "only for finished studies")
                continue
            rows = {name: each[t, number] for name, each in results.replicates.items()}
            effects = {name: shape_effect(rows, name) for name in PAIR_MEASURES}
            for axes, effect in zip(row, effects.values(), strict=True):
                draw_effect(axes, effect)
                axes.set_title(share_words("explains", effect.explained), fontsize=7.5)
            of_pairs = share_words("which flocs met\nexplains", effects["size_ratio"].by_pair)
            row[-1].text(1.04, 0.0, of_pairs, fontsize=7.5, transform=row[-1].transAxes)
        for axes, label in zip(grid[-1], PAIR_MEASURES.values(), strict=True):
            axes.set_xlabel(label)
        words = [r"$\Pr[A]$", *(plain(style.CLASS_WORDS[name]) for name in style.CLASS_COLOURS)]
        title = f"$N$ = {results.vertices[number]}\n(bars: 95 %)"
        colours = [ALL_COLOUR, *style.CLASS_COLOURS.values()]
        style.add_line_legend(grid[0, -1], words, colours, title)
        return figure


def draw_effect(axes, effect):
    """Pr[A] with its intervals, and the classes, against a measure."""
    for index, (name, colour) in enumerate(style.CLASS_COLOURS.items()):
        if effect.measure.size:
            axes.plot(effect.measure, effect.pr_class[0, index], color=colour, linewidth=0.9,
                      marker=style.MARKERS[1 + index], ms=2.5, label=name)  # fmt: skip
    value, low, high = effect.pr_a if effect.measure.size else np.empty((3, 0))
    reach = np.clip([value - low, high - value], 0.0, None)
    axes.errorbar(effect.measure, value, reach, color=ALL_COLOUR, marker=style.MARKERS[0], ms=3.5,
                  elinewidth=0.8, clip_on=False)  # fmt: skip
    if not np.isfinite(value).any():
        style.note(axes, "no decided collision\nof known shapes")


def share_words(subject, share):
    """A share of variance in words."""
    value, low, high = (100.0 * each for each in share)
    if np.isnan(value):
        return ""
    return f"{subject} {value:.2g} % ({low:.2g} to {high:.2g})"
