"""The forces between two bodies against time."""

import numpy as np

from flocsim.errors import UsageError
from flocsim.io.plots.style import BODY_COLOURS, CONTACT_COLOUR, house_style, new_figure
from flocsim.io.plots.trajectory import time_unit

NANO = 1e9
DECADES = 8
"""Decades below the largest force that are shown."""
COLOURS = (*BODY_COLOURS, "0.5", CONTACT_COLOUR)


def draw_forces(times, forces, collision=None, title=""):
    """Magnitudes of forces [N] against time [s], solid where they push apart; returns the Figure.

    ``forces``: {name: (k,)}, above 0 where a force pushes the bodies apart; ``collision``: the
    time of the first touch. Raises UsageError if the lengths disagree.
    """
    if any(len(force) != len(times) for force in forces.values()):
        raise UsageError("a figure of forces needs one force per time")
    unit, factor = time_unit(times)
    with house_style():
        figure = new_figure(5.4, 2.6)
        axes = figure.subplots()
        for colour, (name, force) in zip(COLOURS, forces.items(), strict=False):
            draw_signed(axes, np.asarray(times) * factor, np.asarray(force) * NANO, colour, name)
        if collision is not None and np.isfinite(collision):
            axes.axvline(collision * factor, color="0.6", linewidth=0.7, linestyle=":")
        set_force_axis(axes, forces)
        axes.set_xlabel(f"time [{unit}]")
        axes.set_title(title)
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), title="pushes —   pulls - -",
                    alignment="left")  # fmt: skip
        return figure


def draw_signed(axes, times, force, colour, name):
    """One force: solid where it pushes apart, dashed where it pulls together."""
    push, pull = np.where(force > 0.0, force, np.nan), np.where(force < 0.0, -force, np.nan)
    axes.plot(times, push, color=colour, linewidth=1.1, label=name)
    axes.plot(times, pull, color=colour, linewidth=1.1, linestyle=(0, (3, 1.5)))


def set_force_axis(axes, forces):
    """Powers of ten down to what can still matter."""
    sizes = np.abs(np.concatenate([np.asarray(force) for force in forces.values()])) * NANO
    largest = np.nanmax(sizes[np.isfinite(sizes)], initial=0.0)
    if largest > 0.0:
        axes.set_yscale("log")
        axes.set_ylim(largest * 10.0**-DECADES, 3.0 * largest)
    axes.set_ylabel("force on the line of centres [nN]")
