"""How what becomes of replicates is drawn: probabilities as points with bars, ends as bars stacked
to 1, and why a probability has no value.

Counts are those of the group `probabilities` {name: (…)}, in whatever order of axes.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from flocsim.io.confidence import bounded_sums, clustered_proportion, proportion
from flocsim.io.plots import style
from flocsim.io.results.events import NOT_COLLIDED, ends_of, events, events_of

COLOURS = {
    "aggregated": "#0072B2", "departed": "#56B4E9", "missed": "0.85", "held": "#009E73",
    "undecided": "#E69F00", "failed": "#D7191C",
}  # fmt: skip
"""Of the ends of replicates, in the order of the stack."""

ENDS = ("", "_low", "_high", "_numerical")

FEW = 10
"""Trials below which a point is hollow: its probability says little."""

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

INSIDE, OUTSIDE = "all inside", "all outside"
LETTERS = {
    "missed": "m",
    "held": "h",
    "undecided": "u",
    "failed": "f",
    INSIDE: "i",
    OUTSIDE: "o",
}
"""Marks of a probability without trials, by what became of most of its replicates."""

MARK_AT = 0.025
"""Where on the axis of probabilities these marks stand: above its line, where there is no value."""


def causes_of(counts: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    """Why the probability ``name`` has no trials, a word of LETTERS; "" where it has some."""
    trials = events_of(counts)[name].trials
    ends = ends_of(counts)
    causes = {word: ends[word] for word in NOT_COLLIDED}
    classes = np.asarray(counts["n_class"])
    if name == "pr_a_given_inside":
        causes[OUTSIDE] = classes[..., 2:].sum(axis=-1)
    elif name == "pr_a_given_outside":
        causes[INSIDE] = classes[..., :2].sum(axis=-1)
    words = np.array([*causes, ""], dtype=object)
    most = np.argmax(np.stack(list(causes.values())), axis=0)
    return words[np.where((trials == 0) & (np.asarray(counts["n_total"]) > 0), most, len(causes))]


def draw_ends(
    axes: Any, places: np.ndarray, counts: Mapping[str, np.ndarray], width: float, shift: float = 0
) -> None:
    """Bars (k,) stacked to 1 at these places, ``width`` and ``shift`` in points."""
    total = np.maximum(np.asarray(counts["n_total"]), 1)
    base = np.zeros(len(places))
    for word, number in ends_of(counts).items():
        top = base + number / total
        axes.vlines(places, base, top, color=COLOURS[word], linewidth=width, capstyle="butt",
                    transform=shifted(axes, shift), label=word)  # fmt: skip
        base = top


def mark_causes(
    axes: Any, places: np.ndarray, causes: np.ndarray, colour: Any, shift: float = 0.0
) -> set[str]:
    """A letter on the axis at each place (k,) that has a cause; the causes that were marked."""
    for word in (found := {str(each) for each in causes if each}):
        at = places[causes == word]
        axes.plot(at, np.full(len(at), MARK_AT), linestyle="", marker=f"${LETTERS[word]}$", ms=4.5,
                  color=colour, markeredgewidth=0.2, clip_on=False,
                  transform=shifted(axes, shift))  # fmt: skip
    return found


def words_of(marked: set[str]) -> str:
    """What the letters of these causes say, for a legend; "" for none."""
    lines = [f"\n {LETTERS[word]}: {word}" for word in LETTERS if word in marked]
    return "\nno value where" + "".join(lines) if lines else ""


def shifted(axes: Any, points: float) -> Any:
    """The transform of an axes' data, so many points to the right."""
    from matplotlib.transforms import ScaledTranslation

    return axes.transData + ScaledTranslation(points / 72.0, 0.0, axes.figure.dpi_scale_trans)


def end_handles() -> list[Any]:
    """Handles of a legend of the stack, the topmost first."""
    from matplotlib.patches import Patch

    return [Patch(facecolor=colour, label=word) for word, colour in reversed(COLOURS.items())]


def draw_probability(axes, results, number, name):
    """The lines of a type, for each delta; the causes of what has no value."""
    causes, marked = causes_of(results.probabilities, name)[number], set()
    bands = [band[number] for band in bands_of(results, name)]
    style.set_vertex_axis(axes, results.vertices)
    style.set_probability_axis(axes)
    count, few = results.delta.size, trials_of(results, name)[number] < FEW
    for index, colour in enumerate(style.graded_colours(count)[:count]):
        line = [band[:, index] for band in bands]
        marked |= draw_line(axes, results.vertices, line, index, count, colour, few[:, index],
                            causes[:, index])  # fmt: skip
    note_if_empty(axes, bands[0], NO_EVENTS[name])
    return marked


def trials_of(results, name):
    """How many replicates a probability is of (type, vertices, delta)."""
    return events_of(results.probabilities)[name].trials


def draw_shares(axes, results, number, name):
    """The classes or kinds of bond of one type, counts pooled over delta."""
    bands = share_bands(results, number, name)
    style.set_vertex_axis(axes, results.vertices)
    style.set_probability_axis(axes)
    colours = SHARES[name][-1].values()
    for index, colour in enumerate(colours):
        line = [band[:, index] for band in bands]
        draw_line(axes, results.vertices, line, index, len(colours), colour)
    note_if_empty(axes, bands[0], NO_EVENTS[name])


def share_bands(results, number, name):
    """(share, low, high, least and most change by numerics) (vertices, class or bond) of one
    type."""
    table, share = results.probabilities, SHARES[name][0]
    errors = over_delta(table, share, table[f"{share}_numerical"])[number]
    changes = [-errors, errors]
    for side, end in enumerate(ENDS[1:3]) if results.outlines else ():
        shape = over_delta(table, share, results.outlines[f"{share}_shape{end}"])
        changes[side] = changes[side] + shape[number]
    return (*shares_of(results, number, name), *changes)


def bands_in(table, name):
    """[value, low, high, least and most change by numerics] of a probability in a table."""
    value, low, high, numerical = (table[name + end] for end in ENDS)
    return [value, low, high, -numerical, numerical]


def bands_of(results, name):
    """The same of the conditions of results, which may know the sign of what numerics change; with
    what outlines cut otherwise change."""
    bands = bands_in(results.probabilities, name)
    for side, end in enumerate(ENDS[1:3], start=3):
        if results.numerics:
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
    # A replicate is a cluster: (class or bond, vertices, delta, replicate) → over delta.
    trials, successes, unknown = (
        np.sum(each, axis=2, dtype=np.int64) for each in events(*codes)[share]
    )
    found = clustered_proportion(bounded_sums(successes, trials, unknown))[:3]
    return tuple(np.moveaxis(each, 0, -1) for each in found)


def draw_line(axes, vertices, bands, index, count, colour, few=None, causes=None):
    """Line ``index`` of ``count``: points with bars, joined in the order of N; the causes marked.

    Inner bars are intervals, outer ones, thin, these and the numerical error on either side;
    points are hollow where there are ``few`` trials, ``causes`` say why there are none.
    """
    order = np.argsort(vertices)
    places = style.vertex_positions(vertices)[order] + style.dodge(index, count)
    few = None if few is None else few[order]
    draw_bars(axes, places, [np.asarray(band)[order] for band in bands], index, colour, few)
    return set() if causes is None else mark_causes(axes, places, causes[order], colour)


def draw_bars(axes, places, bands, index, colour, few=None, shift=0.0):
    """A line of points with bars at these places: value, low, high, and by how much numerics may
    lower and raise it.

    ``shift``: to the right, in points, whatever the axis. Where there is an interval, but no value,
    it is dotted.
    """
    value, low, high, lowers, raises = bands
    reach = np.clip([value - low, high - value], 0.0, None)
    size, width = (2.2, 0.8) if len(places) > style.CROWDED else (4.0, 1.2)
    where = shifted(axes, shift)
    axes.errorbar(places, value, reach, capsize=0, clip_on=False, color=colour,
                  marker=style.marker(index), ms=size, lw=width,
                  elinewidth=0.6 * width, transform=where)  # fmt: skip
    if few is not None and few.any():
        axes.plot(places[few], value[few], linestyle="", marker=style.marker(index),
                  ms=size, color=colour, mfc="white", clip_on=False, zorder=3,
                  transform=where)  # fmt: skip
    alone = ~np.isfinite(value) & np.isfinite(high)
    if alone.any():
        axes.vlines(places[alone], low[alone], high[alone], color=colour, linestyle=":",
                    linewidth=0.6 * width, transform=where)  # fmt: skip
    if np.any((lowers < 0.0) | (raises > 0.0)):
        down, up = np.minimum(np.nan_to_num(lowers), 0.0), np.maximum(np.nan_to_num(raises), 0.0)
        outer = [value - np.maximum(low + down, 0.0), np.minimum(high + up, 1.0) - value]
        thin = 0.2 * width
        axes.errorbar(places, value, np.clip(outer, 0.0, None), capsize=1.5, clip_on=False,
                      fmt="none", ecolor=colour, elinewidth=thin, capthick=thin,
                      transform=where)  # fmt: skip


def note_if_empty(axes, values, text):
    if not np.any(np.isfinite(values)):
        style.note(axes, text)
