"""Figures of one collision: a strip of frames (the paper's Fig. 7) and the centre distance."""

import math

import numpy as np

from flocsim.errors import UsageError
from flocsim.io.plots.style import BODY_COLOURS, CONTACT_COLOUR, house_style, new_figure

MICRO = 1e6
INSIDE_COLOUR = "#DCEBF5"
PALE = {"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
"""Behind text that lines may cross."""


def draw_strip(
    outlines_per_frame,
    times,
    paths,
    title="",
    *,
    centre_distance=None,
    zone_distance=None,
    contacts=None,
):
    """A row of frames of a trajectory; returns the matplotlib Figure.

    ``outlines_per_frame``: per frame, per body, a list of (k, 2) outline polygons [m];
    ``times`` (frames,) [s]; ``paths``: per body the (m, 2) path of its centre [m];
    ``centre_distance`` (frames,) d_c [m], written beneath each frame; ``zone_distance`` D_0 [m],
    to say on which side of it d_c lies; ``contacts``: per frame the (c, 2) contact points [m],
    marked in red. All frames have one scale and are centred on their bodies, in whatever frame of
    reference the outlines and paths are given. Raises UsageError if the lengths disagree.
    """
    contacts = [()] * len(times) if contacts is None else contacts
    labels = frame_labels(len(times), centre_distance, zone_distance)
    check_lengths(len(times), outlines_per_frame, contacts, labels)
    centres, half = windows(outlines_per_frame)
    unit, factor = time_unit(times)
    with house_style():
        figure = new_figure(1.65 * len(times) + 0.1, 2.4 if title else 2.15)
        row = figure.subplots(1, len(times), squeeze=False)[0]
        for number, axes in enumerate(row):
            draw_paths(axes, paths)
            draw_bodies(axes, outlines_per_frame[number])
            draw_contacts(axes, contacts[number])
            frame_axes(axes, centres[number], half)
            axes.set_title(f"{times[number] * factor:.4g} {unit}", loc="center", fontsize=8)
            axes.set_xlabel(labels[number])
        draw_scale_bar(row[0], centres[0], half)
        figure.suptitle(title, x=0.01, ha="left", fontsize=9) if title else None
        return figure


def draw_distance(times, centre_distance, zone_distance=None, title=""):
    """The centre distance d_c against time, with D_0 where there is a zone; returns the Figure.

    ``times`` (k,) [s], ``centre_distance`` (k,) [m], ``zone_distance`` [m], None or NaN for none.
    """
    check_lengths(len(times), centre_distance)
    unit, factor = time_unit(times)
    with house_style():
        figure = new_figure(3.6, 2.3)
        axes = figure.subplots()
        time = np.asarray(times) * factor
        axes.plot(time, np.asarray(centre_distance) * MICRO, color=BODY_COLOURS[0])
        axes.set_xlabel(f"time [{unit}]")
        axes.set_ylabel("centre distance $d_c$ [µm]")
        axes.set_title(title)
        axes.margins(x=0.02, y=0.12)
        draw_zone(axes, zone_distance)
        return figure


def draw_zone(axes, zone_distance):
    """The line d_c = D_0 with its name, the inside of the zone shaded beneath it."""
    if zone_distance is None or not math.isfinite(zone_distance):
        return
    level = zone_distance * MICRO
    low, high = axes.get_ylim()
    margin = 0.12 * (max(high, level) - min(low, level))
    low, high = min(low, level - margin), max(high, level + margin)
    axes.set_ylim(low, high)
    axes.axhspan(low, level, color=INSIDE_COLOUR, zorder=0)
    axes.axhline(level, color="0.35", linestyle=(0, (4, 2)), linewidth=0.9)
    side = free_side(axes, level, level + margin)
    axes.annotate(
        f"$D_0$ = {level:.4g} µm",
        (0.0 if side == "left" else 1.0, level),
        xycoords=("axes fraction", "data"),
        xytext=(2 if side == "left" else -2, 2),
        textcoords="offset points",
        ha=side,
        color="0.25",
        bbox=PALE,
    )


def free_side(axes, low, high):
    """ "left" or "right": where fewer points of the panel's first line lie between two heights."""
    x, y = (np.asarray(values, dtype=float) for values in axes.lines[0].get_data())
    crowded = x[(y >= low) & (y <= high)]
    return "left" if np.sum(crowded > x.mean()) > np.sum(crowded <= x.mean()) else "right"


def check_lengths(count, *sequences):
    """UsageError unless there is at least one time, and one entry of each sequence per time."""
    lengths = [len(sequence) for sequence in sequences]
    if count == 0 or any(length != count for length in lengths):
        raise UsageError(f"a figure of {count} times needs as many of all else, found {lengths}")


def frame_labels(count, centre_distance, zone_distance):
    """What stands beneath the frames: d_c and, if a zone is known, its side of D_0."""
    if centre_distance is None:
        return [""] * count
    known = zone_distance is not None and math.isfinite(zone_distance)
    labels = []
    for distance in centre_distance:
        side = "" if not known else r" $<D_0$" if distance < zone_distance else r" $\geq D_0$"
        labels.append(f"$d_c$ = {distance * MICRO:.1f} µm{side}")
    return labels


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


def draw_bodies(axes, frame):
    """The outlines, filled lightly, one colour per body."""
    from matplotlib.patches import Polygon

    for number, body in enumerate(frame):
        colour = BODY_COLOURS[number % len(BODY_COLOURS)]
        for polygon in body:
            axes.add_patch(Polygon(polygon, facecolor=(colour, 0.3), edgecolor=colour, lw=0.9))


def draw_paths(axes, paths):
    """The centres' paths, one colour per body."""
    for number, path in enumerate(paths):
        colour = BODY_COLOURS[number % len(BODY_COLOURS)]
        path = np.asarray(path)
        axes.plot(path[:, 0], path[:, 1], color=colour, linewidth=0.8, linestyle=(0, (3, 1.5)))


def draw_contacts(axes, points):
    """A red ring around every contact point."""
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    ring = {"markerfacecolor": "none", "markeredgecolor": CONTACT_COLOUR, "markeredgewidth": 1.2}
    axes.plot(points[:, 0], points[:, 1], "o", markersize=6, zorder=5, **ring)


def frame_axes(axes, centre, half):
    """A square window without numbers; the scale bar gives the size."""
    axes.set_xlim(centre[0] - half, centre[0] + half)
    axes.set_ylim(centre[1] - half, centre[1] + half)
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set(visible=True, color="0.8")


def draw_scale_bar(axes, centre, half):
    """A bar of 1, 2 or 5 times a power of ten, near a quarter of the window."""
    length = rounded_length(0.5 * half)
    left, level = centre[0] - 0.92 * half, centre[1] - 0.92 * half
    axes.plot([left, left + length], [level, level], color="0.1", linewidth=2.0, zorder=6)
    text = f"{length * MICRO:g} µm"
    axes.text(left, level + 0.04 * half, text, va="bottom", fontsize=7, zorder=6, bbox=PALE)


def rounded_length(length):
    """The largest of 1, 2, 5 times a power of ten that is not above ``length``."""
    power = 10.0 ** math.floor(math.log10(length))
    return power * max(step for step in (1, 2, 5) if step * power <= length * (1 + 1e-9))
