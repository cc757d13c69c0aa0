"""How what becomes of replicates is drawn: probabilities as points with bars, ends as bars stacked
to 1; and what shapes do to them: Pr[A] and the classes against the shape measures of the flocs, and
how much of the variance of Pr those explain.

Counts are those of the group `probabilities` {name: (…)}, in whatever order of axes.
"""

from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from flocsim.io.confidence import bounded_sums, clustered_proportion, explained_share, proportion
from flocsim.io.plots import style
from flocsim.io.plots.style import Figure, drawing, plain
from flocsim.io.results.events import FEW, ends_of, events, events_of
from flocsim.io.results.numerics import numerics_matter
from flocsim.io.results.schema import SHAPE_MEASURES, Results

COLOURS = {
    "aggregated": "#0072B2", "departed": "#56B4E9", "missed": "0.8", "held": "#009E73",
    "undecided": "#E69F00", "failed": "#D7191C",
}  # fmt: skip
"""Of the ends of replicates, in the order of the stack."""

ENDS = ("", "_low", "_high", "_numerical")

NO_EVENTS = {
    "pr_inside": "no collision",
    "pr_a_given_inside": "no decided collision\ninside the zone",
    "pr_a_given_outside": "no decided collision\noutside the zone",
    "pr_a": "no decided collision",
    "classes": "no decided collision",
    "bonds": "no aggregation",
}

SHARES = {
    "classes": ("pr_class", style.CLASS_COLOURS),
    "bonds": ("pr_bond", style.BOND_COLOURS),
}
"""What is drawn as shares of a whole: its probabilities, its colours."""


def draw_ends(
    axes: Any, places: np.ndarray, counts: Mapping[str, np.ndarray], width: float, shift: float = 0
) -> None:
    """Bars (k,) stacked to 1 at these places, ``width`` and ``shift`` in points."""
    total = np.maximum(np.asarray(counts["n_total"]), 1)
    base = np.zeros(len(places))
    look = {"linewidth": width, "capstyle": "butt", "transform": shifted(axes, shift)}
    for word, number in ends_of(counts).items():
        top = base + number / total
        axes.vlines(places, base, top, color=COLOURS[word], label=word, **look)
        base = top


def bars_of(results: Any, numerics: bool) -> str:
    """What the bars of a figure mean, for the foot; with ``numerics`` drawn, and why."""
    outlines = bool(getattr(results, "outlines", {}))  # a sweep has none
    added = ["numerical error"] * numerics + ["error of the outlines"] * outlines
    thin = f"; thin: plus {' and '.join(added)}" if added else ""
    large = " (large somewhere)" * (numerics and numerics_matter(results))
    return f"Bars: 95 % sampling intervals{thin}{large}."


def shifted(axes: Any, points: float) -> Any:
    """The transform of an axes' data, so many points to the right."""
    from matplotlib.transforms import ScaledTranslation

    return axes.transData + ScaledTranslation(points / 72.0, 0.0, axes.figure.dpi_scale_trans)


def end_handles(counts: Mapping[str, np.ndarray]) -> list[Any]:
    """Handles of a legend of the ends that occur, in the order of the stack."""
    from matplotlib.patches import Patch

    there = [word for word, number in ends_of(counts).items() if np.any(number)]
    return [Patch(facecolor=COLOURS[word], label=word) for word in there]


def draw_probability(axes, results, number, name, numerics, most=style.MOST_LABELS):
    """Draw the lines of a type, one for each delta."""
    bands = [band[number] for band in bands_of(results, name, numerics)]
    style.set_vertex_axis(axes, results.vertices, most)
    style.set_probability_axis(axes)
    count, few = results.delta.size, trials_of(results, name)[number] < FEW
    for index, colour in enumerate(style.graded_colours(count)[:count]):
        line = [band[:, index] for band in bands]
        draw_line(axes, results.vertices, line, index, count, colour, few[:, index])
    note_if_empty(axes, bands[0], NO_EVENTS[name])


def trials_of(results, name):
    """How many replicates a probability is of (type, vertices, delta)."""
    return events_of(results.probabilities)[name].trials


def draw_shares(axes, results, number, name, numerics, most=style.MOST_LABELS):
    """The classes or kinds of bond of one type, counts pooled over delta."""
    bands = share_bands(results, number, name, numerics)
    style.set_vertex_axis(axes, results.vertices, most)
    style.set_probability_axis(axes)
    colours = SHARES[name][-1].values()
    for index, colour in enumerate(colours):
        line = [band[:, index] for band in bands]
        draw_line(axes, results.vertices, line, index, len(colours), colour)
    note_if_empty(axes, bands[0], NO_EVENTS[name])


def share_bands(results, number, name, numerics):
    """(share, low, high, least and most change by numerics) (vertices, class or bond) of one
    type."""
    table, share = results.probabilities, SHARES[name][0]
    errors = numerics * over_delta(table, share, table[f"{share}_numerical"])[number]
    changes = [-errors, errors]
    for side, end in enumerate(ENDS[1:3]) if results.outlines else ():
        shape = over_delta(table, share, results.outlines[f"{share}_shape{end}"])
        changes[side] = changes[side] + shape[number]
    return (*shares_of(results, number, name), *changes)


def bands_in(table, name, numerics):
    """[value, low, high, least and most change by numerics, if drawn] of a probability."""
    value, low, high, error = (table[name + end] for end in ENDS)
    return [value, low, high, -numerics * error, numerics * error]


def bands_of(results, name, numerics):
    """The same of the conditions of results, which may know the sign of what numerics change; with
    what outlines cut otherwise change."""
    bands = bands_in(results.probabilities, name, numerics)
    for side, end in enumerate(ENDS[1:3], start=3):
        if results.numerics and numerics:
            bands[side] = results.numerics[f"{name}_change{end}"]
        if results.outlines:
            bands[side] = bands[side] + np.nan_to_num(results.outlines[f"{name}_shape{end}"])
    return bands


def over_delta(table, share, errors):
    """Errors (type, vertices, class or bond) of shares, pooled over delta: the mean of those at
    each, by their trials."""
    trials = events_of(table)[share].trials
    errors = np.where(trials > 0, errors, 0.0)
    with np.errstate(invalid="ignore"):
        return (trials * errors).sum(axis=2) / trials.sum(axis=2)


def shares_of(results, number, name):
    """(share, low, high) (vertices, class or bond) of one type; Wilson's without the replicates."""
    share = SHARES[name][0]
    if results.replicates is None:
        counts = {
            name: values[number].sum(axis=1)
            for name, values in results.probabilities.items()
            if name.startswith("n_")
        }
        trials, successes, unknown = events_of(counts)[share]
        return proportion(successes, trials, unknown=unknown)
    codes = (results.replicates[column][number] for column in ("outcome", "inside", "bond"))
    # A replicate is a cluster: (vertices, delta, class or bond, replicate) → over delta.
    trials, successes, unknown = (
        np.sum(each, axis=1, dtype=np.int64) for each in events(*codes)[share]
    )
    return clustered_proportion(bounded_sums(successes, trials, unknown))[:3]


def draw_line(axes, vertices, bands, index, count, colour, few=None):
    """Draw line ``index`` of ``count``: points with bars, joined in the order of N.

    Inner bars are intervals, outer ones, thin, these and the numerical error on either side;
    points are hollow where there are ``few`` trials, and missing where there are none.
    """
    order = np.argsort(vertices)
    places = style.vertex_positions(vertices)[order] + style.dodge(index, count)
    few = None if few is None else few[order]
    draw_bars(axes, places, [np.asarray(band)[order] for band in bands], index, colour, few)


def draw_bars(axes, places, bands, index, colour, few=None, shift=0.0):
    """A line of points with bars at these places: value, low, high, and by how much numerics may
    lower and raise it.

    ``shift``: to the right, in points, whatever the axis. Where there is an interval, but no value,
    it is dotted.
    """
    value, low, high, lowers, raises = bands
    reach = np.clip([value - low, high - value], 0.0, None)
    size, width = (1.8, 0.7) if len(places) > style.CROWDED else (3.2, 1.0)
    thin, thinner = 0.8 * width, 0.4 * width
    moved = {"transform": shifted(axes, shift)}
    whole = moved | {"clip_on": False}
    points = whole | {"color": colour, "marker": style.marker(index), "ms": size}
    axes.errorbar(places, value, reach, lw=width, elinewidth=thin, **points)
    if few is not None and few.any():
        axes.plot(places[few], value[few], linestyle="", mfc="white", zorder=3, **points)
    alone = ~np.isfinite(value) & np.isfinite(high)
    if alone.any():
        axes.vlines(places[alone], low[alone], high[alone], colour, ":", lw=thin, **moved)
    if np.any((lowers < 0.0) | (raises > 0.0)):
        down, up = np.minimum(np.nan_to_num(lowers), 0.0), np.maximum(np.nan_to_num(raises), 0.0)
        outer = [value - np.maximum(low + down, 0.0), np.minimum(high + up, 1.0) - value]
        outer, bars = np.clip(outer, 0.0, None), whole | {"fmt": "none", "ecolor": colour}
        axes.errorbar(
            places, value, outer, capsize=1.5, elinewidth=thinner, capthick=thinner, **bars
        )


def note_if_empty(axes, values, text):
    if not np.any(np.isfinite(values)):
        style.note(axes, text)


ALL_COLOUR = "0.15"

PAIR_MEASURES = {
    "aspect_ratio": "mean\naspect ratio",
    "circularity": "mean\ncircularity",
    "solidity": "mean\nsolidity",
    "size_ratio": "size\nratio",
}
"""What is said of the shapes of two flocs: of both the mean, of their radii the ratio."""

SHAPE_COLUMNS = (
    "outcome", "inside", "bond", "r_i", "r_j", "floc_i", "floc_j",
    *(f"{name}_{body}" for name in SHAPE_MEASURES for body in "ij"),
)  # fmt: skip
"""Columns of replicates that Pr[A] against shape is drawn of."""

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
    classes = [np.sum(each, axis=0, dtype=np.int64) for each in found["pr_class"]]
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
    beside a row that which is explained by which two flocs met.
    """
    number = int(np.argmax(results.vertices))
    count = len(results.types)
    rows = {} if results.replicates is None else {
        name: results.replicates[name][:, number] for name in SHAPE_COLUMNS
    }  # fmt: skip
    with drawing(style.WIDTH, 1.15 * count + 0.4) as figure:
        grid = figure.subplots(count, len(PAIR_MEASURES), sharey=True, sharex="col", squeeze=False)
        for t, (row, title) in enumerate(zip(grid, style.type_titles(results.types), strict=True)):
            for axes in row:
                style.set_probability_axis(axes)
                axes.locator_params(axis="x", nbins=2)
                axes.xaxis.set_major_formatter("{x:g}")
            row[0].set_ylabel(title)
            if not rows:
                style.note(row[0], "only for\nfinished\nstudies")
                continue
            own = {name: each[t] for name, each in rows.items()}
            effects = {name: shape_effect(own, name) for name in PAIR_MEASURES}
            for axes, effect in zip(row, effects.values(), strict=True):
                draw_effect(axes, effect)
                axes.set_title(share_words(effect.explained), fontsize=style.SMALL)
            if of_pairs := share_words(effects["size_ratio"].by_pair):
                row[0].set_ylabel(f"{title}\nflocs: {of_pairs}")
        for axes, label in zip(grid[-1], PAIR_MEASURES.values(), strict=True):
            axes.set_xlabel(label)
        words = [r"$\Pr[A]$", *(plain(style.CLASS_WORDS[name]) for name in style.CLASS_COLOURS)]
        colours = [ALL_COLOUR, *style.CLASS_COLOURS.values()]
        title = f"$N$ = {results.vertices[number]}"
        style.place_legend(figure, {title: style.line_handles(words, colours)})
        style.add_foot(figure, "Above panels: share of the variance of Pr[A] that the measure "
                       "explains (95 %); beside rows: that which flocs met explains. "
                       "Bars: 95 % sampling intervals.")  # fmt: skip
        return figure


def draw_effect(axes, effect):
    """Pr[A] with its intervals, and the classes, against a measure."""
    measure, known = effect.measure, effect.measure.size
    for index, (name, colour) in enumerate(style.CLASS_COLOURS.items()):
        if known:
            look = {"color": colour, "marker": style.MARKERS[1 + index], "clip_on": False}
            axes.plot(measure, effect.pr_class[0, index], lw=0.9, ms=2.5, label=name, **look)
    value, low, high = effect.pr_a if known else np.empty((3, 0))
    reach = np.clip([value - low, high - value], 0.0, None)
    look = {"color": ALL_COLOUR, "marker": style.MARKERS[0], "clip_on": False}
    axes.errorbar(measure, value, reach, ms=3.5, elinewidth=0.8, **look)
    if not np.isfinite(value).any():
        style.note(axes, "no decided collision\nof known shapes")


def share_words(share):
    """A share of variance in words."""
    value, low, high = (100.0 * each for each in share)
    if np.isnan(value):
        return ""
    return f"{value:.0f} % ({low:.0f}–{high:.0f})"
