"""A collision as an animated GIF: the bodies beside the centre distance, by Pillow."""

import io

import numpy as np

from flocsim.io.files import replace_file
from flocsim.io.plots.style import BODY_COLOURS, house_style, new_figure
from flocsim.io.plots.trajectory import (
    MICRO,
    check_lengths,
    draw_bodies,
    draw_contacts,
    draw_paths,
    draw_scale_bar,
    draw_zone,
    frame_axes,
    time_unit,
    windows,
)

MILLISECONDS = 80
"""Per frame; the last stays for LAST."""
LAST = 1500


def write_animation(path, frames, motion, zone_distance=None, title=""):
    """Write Frames (times, outlines, paths, contacts, centre_distance) as a GIF that loops.

    ``motion``: times (k,) [s] and centre distances (k,) [m] of the whole run; ``zone_distance``
    D_0 [m]. FileError if it cannot be written.
    """
    check_lengths(len(frames.times), frames.outlines, frames.contacts, frames.centre_distance)
    pictures = [picture_of(frames, place, motion, zone_distance, title)
                for place in range(len(frames.times))]  # fmt: skip
    lasting = [MILLISECONDS] * (len(pictures) - 1) + [LAST]
    buffer = io.BytesIO()
    pictures[0].save(buffer, "GIF", save_all=True, append_images=pictures[1:], duration=lasting,
                     loop=0, optimize=False)  # fmt: skip
    replace_file(path, buffer.getvalue())


def picture_of(frames, place, motion, zone_distance, title):
    """One frame as a Pillow image of 64 colours."""
    from PIL import Image

    with house_style():
        figure = draw_frame(frames, place, motion, zone_distance, title)
        figure.canvas.draw()
        pixels = np.asarray(figure.canvas.buffer_rgba())[:, :, :3]
    return Image.fromarray(np.ascontiguousarray(pixels)).quantize(64)


def draw_frame(frames, place, motion, zone_distance, title):
    """The Figure of one frame."""
    unit, factor = time_unit(motion[0])
    figure = new_figure(6.4, 3.0)
    bodies, graph = figure.subplots(1, 2, width_ratios=(1.0, 1.15))
    centres, half = windows(frames.outlines)
    draw_paths(bodies, frames.paths)
    draw_bodies(bodies, frames.outlines[place])
    draw_contacts(bodies, frames.contacts[place])
    frame_axes(bodies, centres[place], half)
    draw_scale_bar(bodies, centres[place], half)
    bodies.set_title(f"{frames.times[place] * factor:.4g} {unit}", loc="center")
    graph.plot(np.asarray(motion[0]) * factor, np.asarray(motion[1]) * MICRO, color="0.7")
    now = frames.times[place] * factor, frames.centre_distance[place] * MICRO
    graph.plot(*now, "o", color=BODY_COLOURS[0])
    graph.set_xlabel(f"time [{unit}]")
    graph.set_ylabel("centre distance $d_c$ [µm]")
    draw_zone(graph, zone_distance)
    figure.suptitle(title, x=0.01, ha="left", fontsize=9) if title else None
    return figure
