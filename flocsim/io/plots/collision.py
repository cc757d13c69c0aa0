"""One collision: a strip of frames (the paper's Fig. 7), distance, forces, and an animation."""

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.io.files import Rule
from flocsim.io.plots import style
from flocsim.io.plots.style import CONTACT_COLOUR, MICRO, WIDTH, Figure, drawing, plain

INSIDE_COLOUR = "#DCEBF5"
PALE = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
"""Behind text that lines may cross."""

RING: dict[str, Any] = {
    "marker": "o", "linestyle": "none", "markersize": 5, "markerfacecolor": "none",
    "markeredgecolor": CONTACT_COLOUR, "markeredgewidth": 1.0,
}  # fmt: skip
"""Of a contact point."""

PATH: dict[str, Any] = {"linewidth": 0.8, "linestyle": (0, (3, 1.5))}
"""Of the way of a body's centre."""

FRAMES_PER_ROW = 4

GRID = 24
"""Points along a side at which a place for a name is looked for."""

NANO = 1e9
DECADES = 8
"""Decades below the largest force that are shown."""
FEMTO = 1e15
ENERGY_DECADES = 4
"""Decades of an axis of energies on either side of 0."""
FORCE_COLOURS = (*style.BODY_COLOURS, "0.5", CONTACT_COLOUR)

Values = Sequence[float]

MILLISECONDS = 80
"""Of every frame of an animation."""


@attrs.frozen(eq=False)
class Frames:
    """Instants of a motion, seen from the first body's centroid; of a lone body, from where it is.

    ``times`` (f,) [s]; ``outlines`` per frame and body a list of rings (k, 2) [m]; ``contacts``
    per frame (c, 2) [m]; ``paths`` per body (m, 2) [m]; ``centre_distance`` (f,) of the first two
    [m], 0 of one.
    """

    times: np.ndarray
    outlines: list[list[list[np.ndarray]]]
    contacts: list[np.ndarray]
    paths: list[np.ndarray]
    centre_distance: np.ndarray


def draw_strip(frames: Frames, title: str = "", zone_distance: float = math.nan) -> Figure:
    """A row of Frames; returns the matplotlib Figure.

    d_c of a pair is written beneath each frame, and on which side of ``zone_distance``, D_0 [m], it
    lies; contacts are ringed in red. A legend names the bodies (i and j where there are two) and
    says what the lines are. All frames have one scale and are centred on their bodies.
    """
    count, bodies = len(frames.times), len(frames.outlines[0])
    # The numbers of bodies are places in the list that System was given.
    names = ["i", "j"] if bodies == 2 else [str(number) for number in range(bodies)]
    centres, half = windows(frames.outlines)
    unit, factor = time_unit(frames.times)
    rows = -(-count // FRAMES_PER_ROW)
    columns = -(-count // rows)
    with drawing(WIDTH, (WIDTH / columns + 0.3) * rows + 0.15 * bool(title)) as figure:
        grid = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes in grid[count:]:
            axes.set_visible(False)
        for number, axes in enumerate(grid[:count]):
            draw_frame(axes, frames.paths, frames.outlines[number], frames.contacts[number])
            frame_axes(axes, centres[number], half)
            axes.set_title(f"{frames.times[number] * factor:.4g} {unit}", loc="center")
            if bodies == 2:
                distance = frames.centre_distance[number]
                side = r" $<D_0$" if distance < zone_distance else r" $\geq D_0$"
                side = side if math.isfinite(zone_distance) else ""
                axes.set_xlabel(f"{distance * MICRO:.1f} µm{side}", fontsize=style.SMALL)
        draw_scale_bar(grid[0], centres[0], half)
        name_bodies(grid[0], frames.outlines[0], names)
        figure.suptitle(title, x=0.01, ha="left", fontsize=7) if title else None
        style.place_legend(figure, {"": strip_keys(names)})
        told = "Above frames: time; below: distance $d_c$ of the centres."
        style.add_foot(figure, told.replace("$d_c$", "d_c") if bodies == 2 else "")
        style.keep_titles_whole(figure)
        return figure


def name_bodies(axes, frame, names):
    """Each body's name where it is widest, clear of the path drawn there."""
    from matplotlib.patheffects import withStroke

    look = {"ha": "center", "va": "center", "fontsize": 8, "weight": "bold", "zorder": 7}
    look["path_effects"] = [withStroke(linewidth=2.0, foreground="white")]
    for number, (body, name) in enumerate(zip(frame, names, strict=True)):
        colour = style.BODY_COLOURS[number % len(style.BODY_COLOURS)]
        axes.text(*deepest_inside(max(body, key=len)), name, color=colour, **look)


def deepest_inside(polygon):
    """Of the points of a grid, that inside a polygon (k, 2) which is farthest from its outline."""
    from matplotlib.path import Path as Outline

    low, high = polygon.min(axis=0), polygon.max(axis=0)
    steps = (np.arange(GRID) + 0.5) / GRID
    grid = low + (high - low) * np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    inside = grid[Outline(polygon).contains_points(grid)]
    if not len(inside):
        return polygon.mean(axis=0)
    ends = np.roll(polygon, -1, axis=0)
    points = np.concatenate(
        [polygon + share * (ends - polygon) for share in (0.0, 0.25, 0.5, 0.75)]
    )
    distance = np.hypot(*np.moveaxis(inside[:, None] - points, 2, 0)).min(axis=1)
    return inside[np.argmax(distance)]


def strip_keys(names):
    """The keys of a strip's legend: bodies, the paths of their centres, contacts."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    keys = [
        Patch(facecolor=(colour, 0.3), edgecolor=colour, label=f"body {name}")
        for colour, name in zip(style.BODY_COLOURS, names, strict=False)
    ]
    seen = f" seen from {names[0]}" if len(names) > 1 else ""
    way = Line2D([], [], color="0.4", label=f"path of the centre{seen}", **PATH)
    return [*keys, way, Line2D([], [], **RING, label="contact")]


@contextlib.contextmanager
def over_time(times: Values, label: str, title: str) -> Iterator[tuple[Any, np.ndarray, float]]:
    """(axes of a new figure, times (k,) in a unit that suits them, that unit per second)."""
    unit, factor = time_unit(times)
    with drawing(WIDTH, 2.0) as figure:
        axes = figure.subplots()
        axes.set(xlabel=f"time [{unit}]", ylabel=label, title=title)
        yield axes, np.asarray(times) * factor, factor
        style.keep_titles_whole(figure)


def draw_distance(
    times: Values, centre_distance: Values, zone_distance: float = math.nan, title: str = ""
) -> Figure:
    """The centre distance d_c against time, with D_0 where there is a zone; returns the Figure.

    ``times`` (k,) [s], ``centre_distance`` (k,) [m], ``zone_distance`` [m], NaN for none.
    """
    with over_time(times, "centre distance $d_c$ [µm]", title) as (axes, time, _):
        axes.plot(time, np.asarray(centre_distance) * MICRO, color=style.BODY_COLOURS[0])
        axes.margins(x=0.02, y=0.12)
        draw_zone(axes, zone_distance)
    return axes.figure


def draw_forces(
    times: Values, forces: Mapping[str, Values], collision: float = math.nan, title: str = ""
) -> Figure:
    """Magnitudes of forces [N] against time [s], solid where they push apart; returns the Figure.

    ``forces``: {name: (k,)}, above 0 where a force pushes the bodies apart; ``collision``: the
    time of the first touch, NaN for none.
    """
    curves = {plain(name): np.asarray(force) * NANO for name, force in forces.items()}
    label = "force along the centres [nN]"
    with over_time(times, label, title) as (axes, time, factor):
        for name, force, look in styled(curves):
            axes.plot(time, np.where(force > 0.0, force, np.nan), label=name, **look)
            pull = np.where(force < 0.0, -force, np.nan)
            axes.plot(time, pull, linestyle=(0, (3, 1.5)), **look)
        if np.isfinite(collision):
            axes.axvline(collision * factor, color="0.6", linewidth=0.7, linestyle=":",
                         label="first touch")  # fmt: skip
        if (largest := largest_of(curves)) > 0.0:
            axes.set_yscale("log")
            axes.set_ylim(largest * 10.0**-DECADES, 3.0 * largest)
        groups = {"pushes —   pulls - -": axes.get_legend_handles_labels()[0]}
        style.place_legend(axes.figure, groups)
    return axes.figure


def draw_energies(
    times: Values, work: Mapping[str, Values], kinetic: Values, title: str = ""
) -> Figure:
    """Work that each force has done since the start [J], and kinetic energies, against time [s].

    ``work``: {name: (k,)}; ``kinetic`` (k,), of all bodies together. Returns the Figure. Energies
    of settling flocs differ by many orders of magnitude: the axis is linear around 0 and
    logarithmic beyond.
    """
    curves = {f"work of {plain(name)}": np.asarray(each) * FEMTO for name, each in work.items()}
    curves["kinetic energy"] = np.asarray(kinetic) * FEMTO
    with over_time(times, "energy [fJ]", title) as (axes, time, _):
        for name, each, look in styled(curves):
            axes.plot(time, each, label=name, **look)
        axes.axhline(0.0, color="0.8", linewidth=0.6, zorder=0)
        if (largest := largest_of(curves)) > 0.0:
            least = math.ceil(math.log10(largest)) - ENERGY_DECADES
            axes.set_yscale("symlog", linthresh=10.0**least)
        style.place_legend(axes.figure, {"": axes.get_legend_handles_labels()[0]})
    return axes.figure


def styled(curves):
    """(name, values, look) of curves: what lies under another is seen on both sides of it, as drag
    does, which balances weight."""
    for place, (name, values) in enumerate(curves.items()):
        colour = FORCE_COLOURS[place % len(FORCE_COLOURS)]
        yield name, values, {"color": colour, "linewidth": max(2.6 - 0.5 * place, 0.8)}


def largest_of(curves):
    """The largest size of all values that are numbers; 0 for none."""
    sizes = np.abs(np.concatenate([*curves.values()]))
    return np.max(sizes[np.isfinite(sizes)], initial=0.0)


def write_animation(
    path: str | Path, frames: Frames, motion: tuple[Values, Values],
    zone_distance: float = math.nan, title: str = "", rule: Rule = False,
) -> None:  # fmt: skip
    """Write Frames as a GIF that loops.

    ``motion``: times (k,) [s] and centre distances (k,) [m] of the whole run; ``zone_distance``
    D_0 [m]; ``rule`` as in `save`. FileError if it cannot be written.
    """
    unit, factor = time_unit(motion[0])
    centres, half = windows(frames.outlines)
    pictures = []
    for place, time in enumerate(frames.times * factor):
        with drawing(6.4, 3.0) as figure:
            bodies, graph = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
            draw_frame(bodies, frames.paths, frames.outlines[place], frames.contacts[place])
            frame_axes(bodies, centres[place], half)
            draw_scale_bar(bodies, centres[place], half)
            bodies.set_title(f"{time:.4g} {unit}", loc="center")
            graph.plot(np.asarray(motion[0]) * factor, np.asarray(motion[1]) * MICRO, color="0.7")
            distance = frames.centre_distance[place] * MICRO
            graph.plot(time, distance, "o", color=style.BODY_COLOURS[0])
            graph.set(xlabel=f"time [{unit}]", ylabel="centre distance $d_c$ [µm]")
            draw_zone(graph, zone_distance)
            figure.suptitle(title, x=0.01, ha="left", fontsize=7) if title else None
            style.keep_titles_whole(figure)  # which draws it
            pictures.append(style.frame_of(figure))
    style.save_gif(path, pictures, MILLISECONDS, rule)


def draw_zone(axes, zone_distance):
    """The line d_c = D_0 with its name, the inside of the zone shaded beneath it."""
    if not math.isfinite(zone_distance):
        return
    level = zone_distance * MICRO
    low, high = axes.get_ylim()
    margin = 0.12 * (max(high, level) - min(low, level))
    low, high = min(low, level - margin), max(high, level + margin)
    axes.set_ylim(low, high)
    axes.axhspan(low, level, color=INSIDE_COLOUR, zorder=0)
    axes.axhline(level, color="0.35", linestyle=(0, (4, 2)), linewidth=0.9)
    # Where the fewest points of the panel's first line lie: to the left or right, above or below.
    x, y = (np.asarray(values, dtype=float) for values in axes.lines[0].get_data())
    left, above = x < x.mean(), y >= level
    crowded = {
        (side, up): np.sum((left == (side == "left")) & (above == up) & (abs(y - level) <= margin))
        for up in (True, False) for side in ("right", "left")
    }  # fmt: skip
    side, up = min(crowded, key=crowded.__getitem__)
    axes.annotate(
        f"$D_0$ = {level:.4g} µm",
        (0.0 if side == "left" else 1.0, level),
        xycoords=("axes fraction", "data"),
        xytext=(2 if side == "left" else -2, 2 if up else -2),
        textcoords="offset points",
        ha=side,
        va="bottom" if up else "top",
        color="0.25",
        bbox=PALE,
    )


def windows(outlines_per_frame):
    """The middle of the bodies in every frame, and one half width [m] that fits them all."""
    boxes = []
    for frame in outlines_per_frame:
        points = np.concatenate([polygon for body in frame for polygon in body])
        boxes.append((points.min(axis=0), points.max(axis=0)))
    low, high = np.moveaxis(np.array(boxes), 1, 0)
    return 0.5 * (low + high), 0.55 * float(np.max(high - low))


def time_unit(times):
    """The unit that keeps the longest time between 1 and 1000, and its factor from seconds."""
    longest = max(abs(float(time)) for time in times)
    for unit, factor in (("s", 1.0), ("ms", 1e3)):
        if longest * factor >= 1.0 or longest == 0.0:
            return unit, factor
    return "µs", 1e6


def draw_frame(axes, paths, frame, contacts):
    """The bodies, the paths of their centres, and the points where they touch."""
    from matplotlib.patches import PathPatch

    for number, path in enumerate(map(np.asarray, paths)):
        colour = style.BODY_COLOURS[number % len(style.BODY_COLOURS)]
        axes.plot(path[:, 0], path[:, 1], color=colour, **PATH)
    for number, body in enumerate(frame):
        colour = style.BODY_COLOURS[number % len(style.BODY_COLOURS)]
        look = {"facecolor": (colour, 0.3), "edgecolor": colour, "lw": 0.9}
        axes.add_patch(PathPatch(rings_path(body), **look))
    points = np.asarray(contacts, dtype=float).reshape(-1, 2)
    axes.plot(points[:, 0], points[:, 1], zorder=5, **RING)


def rings_path(rings):
    """The rings of a body as one path, in which those of holes stay open."""
    from matplotlib.path import Path as Outline

    ends = [ring if np.array_equal(ring[0], ring[-1]) else [*ring, ring[0]] for ring in rings]
    return Outline.make_compound_path(*(Outline(ring, closed=True) for ring in ends))


def svg_path(rings: Sequence[np.ndarray]) -> str:
    """Return rings (k, 2) [m] as the path of an SVG [µm]."""
    return " ".join(
        "M" + " ".join(f"{u:.5g},{v:.5g}" for u, v in style.MICRO * ring) + "Z" for ring in rings
    )


def frame_axes(axes, centre, half):
    """A square window without numbers; the scale bar gives the size."""
    (left, right), (low, high) = ((each - half, each + half) for each in centre)
    axes.set(xlim=(left, right), ylim=(low, high), aspect="equal", xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set(visible=True, color="0.8")


def draw_scale_bar(axes, centre, half):
    """A bar of 1, 2 or 5 times a power of ten, near a quarter of the window."""
    length = rounded_length(0.5 * half)
    left, level = centre[0] - 0.92 * half, centre[1] - 0.92 * half
    axes.plot([left, left + length], [level, level], color="0.1", linewidth=2.0, zorder=6)
    text = f"{length * MICRO:g} µm"
    axes.text(
        left, level + 0.04 * half, text, va="bottom", fontsize=style.SMALL, zorder=6, bbox=PALE
    )


def rounded_length(length):
    """The largest of 1, 2, 5 times a power of ten that is not above ``length``."""
    power = 10.0 ** math.floor(math.log10(length))
    return power * max(step for step in (1, 2, 5) if step * power <= length * (1 + 1e-9))
