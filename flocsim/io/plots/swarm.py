"""Figures of a swarm study: snapshots with clusters in colours, clusters over time, an animation.

A figure is a function of SwarmResults, and stands in SWARM_FIGURES under the name that
`flocsim plot` gives it.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.errors import FileError
from flocsim.geometry.shapes.cores import PointTable, parts_in
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.spheropolygon import shape_of_parts
from flocsim.io.files import Rule
from flocsim.io.plots.collision import rings_path, svg_path
from flocsim.io.plots.style import (
    MICRO,
    WIDTH,
    Figure,
    add_foot,
    drawing,
    frame_of,
    graded_colours,
    line_handles,
    marker,
    panel_grid,
    place_legend,
    save_gif,
    set_log_axis,
)
from flocsim.io.results.swarm_file import GONE, POINTS, RINGS, WALL, SwarmResults, mean

MOST_POINTS = 160
"""Points of an outline that is drawn: arcs finer than a picture of many bodies shows are left."""

ALONE, FIXED = "#c7c7c7", "#595959"
"""Colours of bodies that belong to no cluster of two or more, and of walls."""

BOND_COLOURS = (
    ("certificate", "certificate", "#0072B2"), ("rest", "rest", "#56B4E9"),
    ("hook", "hook", "#E69F00"), ("touching", "touching", "0.82"),
)  # fmt: skip
"""Kinds of bonds, from below, with their words and colours."""

SNAPSHOTS = 4
"""Times that the figure of snapshots shows."""

MILLISECONDS = 120
"""Of every frame of an animation."""

MOST_MOMENTS, BETWEEN = 120, 12
"""Snapshots of a motion on a page, and frames from one to the next."""


def snapshots(results: SwarmResults) -> Figure:
    """Snapshots of the first swarm, each cluster in a colour; single bodies are grey."""
    times = results.scales["time"]
    chosen = places_shown(results, SNAPSHOTS)
    width, height = results.groups["bodies"]["box"][0]
    titles = [f"{times[place]:.4g} s" for place in chosen]
    tall = 0.25 + min(max(1.4 * height / width, 0.8), 3.0)
    with panel_grid(titles, "y [µm]", "x [µm]", tall) as (figure, panels, _):
        for axes, place in zip(panels, chosen, strict=True):
            draw_bodies(axes, results, 0, int(place))
        return figure


def clusters(results: SwarmResults) -> Figure:
    """Clusters over time: their number, sizes, radius of gyration and settling, of all swarms."""
    counts, times = results.groups["counts"], results.scales["time"]
    shown = [
        ("clusters", 1.0, "clusters"),
        ("mean_size", 1.0, "body-weighted mean size"),
        ("gyration", MICRO, "radius of gyration [µm]"),
        ("settling", 1e3, "settling [mm/s]"),
    ]
    with drawing(WIDTH, 3.3) as figure:
        panels = figure.subplots(3, 2, sharex=True).ravel()
        for axes, (name, factor, label) in zip(panels, shown, strict=False):
            values = factor * counts[name]
            for each in values if len(values) > 1 else ():
                axes.plot(times, each, color="0.75", linewidth=0.7, label="a swarm")
            axes.plot(times, mean(values), color="#0072B2", label="mean")
            set_time_panel(axes, label)
        draw_bonds(panels[4], results)
        for axes in panels[3:5]:
            axes.set_xlabel("time [s]")
            axes.xaxis.set_tick_params(labelbottom=True)
        lines = dict(zip(*reversed(panels[0].get_legend_handles_labels()), strict=True))
        handles = [*(lines.values() if len(values) > 1 else ()), *panels[4].collections]
        place_legend(figure, {"": handles}, panels[5])
        if np.any(counts["percolating"] > 0.0):
            add_foot(figure, "Radii of gyration: of clusters that do not percolate.")
        return figure


def set_time_panel(axes, title):
    axes.set_title(title)
    axes.set_ylim(bottom=0.0)


def draw_bonds(axes, results):
    """The pairs that touch over time, by what holds them, in the mean over swarms."""
    counts, times, below = results.groups["counts"], results.scales["time"], 0.0
    for kind, word, colour in BOND_COLOURS:
        number = mean(counts[f"bonds_{kind}"])
        if not np.nansum(number) > 0.0:
            continue
        level = below + number
        axes.fill_between(times, below, level, color=colour, label=word, linewidth=0.0)
        below = level
    set_time_panel(axes, "bonds")


def sizes(results: SwarmResults) -> Figure:
    """Share of bodies in clusters of each size or less, at several times, all swarms together."""
    labels, times = results.groups["snapshots"]["cluster"], results.scales["time"]
    chosen = places_shown(results, SNAPSHOTS)
    with drawing(WIDTH, 1.9) as figure:
        axes, colours = figure.subplots(), graded_colours(len(chosen))
        for index, place in enumerate(chosen):
            inside = [each[each >= 0] for each in labels[:, place]]
            found = np.concatenate([np.bincount(own)[own] for own in inside])
            values, number = np.unique(found, return_counts=True)
            share = np.cumsum(number) / number.sum()
            ends, shares = np.append(values, values[-1] * 1.3), np.append(share, 1.0)
            look = {"color": colours[index], "marker": marker(index)}
            axes.step(ends, shares, where="post", **look)
        axes.set(xscale="log", ylim=(0.0, 1.03), xlabel="bodies in the cluster",
                 ylabel="share of bodies in clusters\nup to that size")  # fmt: skip
        set_log_axis(axes.xaxis)
        place_legend(figure, {"time": line_handles(times_in_words(times[chosen]), colours)})
        return figure


def speed(results: SwarmResults) -> Figure:
    """Speed of clusters against their radius of gyration, at several times, all swarms together."""
    found, times = results.groups["clusters"], results.scales["time"]
    chosen = places_shown(results, SNAPSHOTS)
    shown = (found["cluster_gyration"] > 0.0) & (found["cluster_speed"] > 0.0)
    with drawing(WIDTH, 2.1) as figure:
        axes, colours = figure.subplots(), graded_colours(len(chosen))
        for index, place in enumerate(chosen):
            rows = shown & (found["cluster_time"] == place)
            size, fall = MICRO * found["cluster_gyration"][rows], 1e3 * found["cluster_speed"][rows]
            axes.plot(size, fall, marker(index), color=colours[index], ms=2.5)
        axes.set(xlabel="radius of gyration [µm]", ylabel="settling [mm/s]")
        if shown.any():
            axes.set(xscale="log", yscale="log")
            set_log_axis(axes.xaxis)
            set_log_axis(axes.yaxis)
        place_legend(figure, {"time": line_handles(times_in_words(times[chosen]), colours)})
        if np.isnan(found["cluster_gyration"]).any():
            add_foot(figure, "Clusters that do not percolate.")
        return figure


def times_in_words(times):
    return [f"{time:.4g} s" for time in times]


def classes(results: SwarmResults) -> Figure:
    """Clusters of each size class over time, by equivalent radius, in the mean over swarms."""
    numbers = mean(results.groups["counts"]["n_class"])
    low, times = MICRO * results.scales["class"], results.scales["time"]
    words = [
        f"from {a:.4g} µm" if b is None else (f"{a:.4g} to {b:.4g} µm" if a else f"to {b:.4g} µm")
        for a, b in zip(low, [*low[1:], None], strict=True)
    ]
    with drawing(WIDTH, 1.9) as figure:
        axes, colours = figure.subplots(), graded_colours(len(low))
        for index, each in enumerate(numbers.T):
            axes.plot(times, each, color=colours[index], marker=marker(index), markevery=0.2)
        axes.set(xlabel="time [s]", ylabel="clusters in the box")
        axes.set_ylim(bottom=0.0)
        title = r"$r_\mathrm{eq} = \sqrt{A/\pi}$"
        place_legend(figure, {title: line_handles(words if len(low) > 1 else ["all"], colours)})
        return figure


def places_shown(results: SwarmResults, count: int) -> np.ndarray:
    """The places of so many times, evenly up to the last known."""
    return np.unique(np.linspace(0, last_known(results), count).round().astype(int))


def last_known(results: SwarmResults) -> int:
    """The place of the last time that the first swarm has reached."""
    snapshots = results.groups["snapshots"]
    known = np.isfinite(snapshots["position"][0, :, :, 0]) | (snapshots["cluster"][0] == GONE)
    return int(np.flatnonzero(known.all(axis=1))[-1])


def shape_of(results: SwarmResults, replicate: int, body: int) -> Shape:
    """The shape of a body, made of what the file has of it; FileError where that is none."""
    bodies = results.groups["bodies"]
    first, count = (int(bodies[name][replicate, body]) for name in ("first_point", "point_count"))
    rows = slice(first, first + count)
    table = PointTable(*(bodies[name][replicate, rows] for name in (*POINTS, *RINGS)))
    try:
        return shape_of_parts(parts_in(table))
    except ValueError as error:
        raise FileError(
            f"body {body} of swarm {replicate} is no readable shape: {error}"
        ) from error


def outlines_of(results: SwarmResults, replicate: int) -> list[list[np.ndarray]]:
    """The rings of the outline of every body about its centroid, (k, 2) [m]."""
    bodies = results.groups["bodies"]["r_eq"].shape[1]
    found = []
    for body in range(bodies):
        rings = shape_of(results, replicate, body).outline(0.0, 0.0, 0.0)
        found.append([ring[:: max(1, len(ring) // MOST_POINTS)] for ring in rings])
    return found


def cluster_colours(labels: np.ndarray) -> list[str]:
    """A colour for every body: that of its cluster, which follows from its first body."""
    import matplotlib
    from matplotlib.colors import to_hex

    tab20 = matplotlib.colormaps["tab20"]
    palette = [to_hex(tab20(place)) for place in range(20)]
    _, first, place, size = np.unique(labels, True, True, True)
    return [
        FIXED if label < 0 else (palette[first[own] % 20] if size[own] > 1 else ALONE)
        for label, own in zip(labels, place, strict=True)
    ]


def draw_bodies(axes, results, replicate, place, outlines=None):
    """All bodies at a time, inside the box, which repeats itself where it does."""
    from matplotlib.collections import PathCollection

    outlines = outlines_of(results, replicate) if outlines is None else outlines
    width, height = results.groups["bodies"]["box"][replicate]
    repeats = str(results.run.get("periodic", "xy"))
    position = results.groups["snapshots"]["position"][replicate, place]
    colours = cluster_colours(results.groups["snapshots"]["cluster"][replicate, place])
    paths, shades, lowest = [], [], []
    for outline, (x, y, angle), colour in zip(outlines, position, colours, strict=True):
        if not np.isfinite(x):
            continue  # It has left the box.
        c, s = np.cos(angle), np.sin(angle)
        turned = [ring @ np.array([[c, s], [-s, c]]) for ring in outline]
        if colour != FIXED:
            x, y = (x % width if "x" in repeats else x), (y % height if "y" in repeats else y)
        reach = max(np.hypot(*ring.T).max() for ring in outline)
        for i in shifts(x, reach, width, "x" in repeats and colour != FIXED):
            for j in shifts(y, reach, height, "y" in repeats and colour != FIXED):
                rings = [MICRO * (ring + [x + i, y + j]) for ring in turned]
                paths.append(rings_path(rings))
                lowest.append(min(ring[:, 1].min() for ring in rings))
                shades.append(colour)
    axes.add_collection(PathCollection(paths, facecolors=shades, edgecolors="0.25", lw=0.2))
    high = MICRO * height
    low = 0.0 if "y" in repeats else max(min([0.0, *lowest]), -0.1 * high)
    axes.set(xlim=(0.0, MICRO * width), ylim=(low, high), aspect="equal")
    for spine in axes.spines.values():
        spine.set_visible(True)


def shifts(place, reach, side, repeats):
    """By how much a body is shifted to be seen at both sides of a seam that it lies across."""
    if not repeats or reach <= place <= side - reach:
        return (0.0,)
    return (0.0, side if place < reach else -side)


def write_swarm_animation(path: str | Path, results: SwarmResults, rule: Rule = False) -> None:
    """Write the first swarm at all its times as a GIF that loops; FileError if it cannot be
    written."""
    outlines, pictures = outlines_of(results, 0), []
    width, height = results.groups["bodies"]["box"][0]
    for place in range(last_known(results) + 1):
        with drawing(4.0, min(max(4.0 * height / width, 2.0), 8.0) + 0.3) as figure:
            axes = figure.subplots()
            draw_bodies(axes, results, 0, place, outlines)
            time = results.scales["time"][place]
            axes.set(xlabel="x [µm]", ylabel="y [µm]", title=f"{time:.4g} s")
            figure.canvas.draw()
            pictures.append(frame_of(figure))
    save_gif(path, pictures, MILLISECONDS, rule)


def motion_data(results: SwarmResults) -> dict[str, Any]:
    """Return what the script of a page needs to show the first swarm at its snapshots.

    Lengths in µm. The view moves with the bodies along the sides on which the box repeats itself:
    their settling would hide how they move against each other.
    """
    chosen, bodies, moments = places_shown(results, MOST_MOMENTS), *(
        results.groups[name] for name in ("bodies", "snapshots")
    )  # fmt: skip
    box, free = MICRO * bodies["box"][0], bodies["floc"][0] != WALL
    repeats = box * [axis in str(results.run.get("periodic", "xy")) for axis in "xy"]
    pose = moments["position"][0, chosen] * [MICRO, MICRO, np.degrees(1.0)]
    moved = np.nanmean(pose[:, free, :2] - pose[0, free, :2], axis=1)
    pose[:, free, :2] -= (moved * (repeats > 0.0))[:, np.newaxis]
    times = results.scales["time"][chosen]
    count, largest = (results.groups["counts"][name][0, chosen] for name in ("clusters", "largest"))
    return {
        "paths": [svg_path(rings) for rings in outlines_of(results, 0)],
        "fixed": (~free).tolist(), "box": box.tolist(), "repeats": repeats.tolist(),
        "pose": [[body if np.isfinite(body[0]) else None for body in each]
                 for each in np.round(pose, 3).tolist()],
        "colour": [cluster_colours(each) for each in moments["cluster"][0, chosen]],
        "t": times.tolist(), "shown": len(times) - 1, "between": BETWEEN,
        "words": [f"t = {time:.3g} s: {n:.0f} clusters, largest {most:.0f}"
                  for time, n, most in zip(times, count, largest, strict=True)],
    }  # fmt: skip


SWARM_FIGURES: dict[str, Callable[[SwarmResults], Figure]] = {
    "snapshots": snapshots,
    "clusters": clusters,
    "sizes": sizes,
    "speed": speed,
    "classes": classes,
}
