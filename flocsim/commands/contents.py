"""What files hold that are of no study, for the commands: shape libraries and trajectories."""

import os
from collections.abc import Callable
from functools import wraps
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.contents import Contents, Figures, Summary
from flocsim.errors import visible
from flocsim.hydrodynamics import prism_drag
from flocsim.io.plots.shapes import POPULATION_FIGURES
from flocsim.io.plots.style import Figure
from flocsim.io.shapes.fit_report import format_errors
from flocsim.io.shapes.library import ShapeEntry, read_library, read_settings
from flocsim.io.terminal import aligned
from flocsim.io.trajectory import StoredTrajectory, centre_distance, read_trajectory

STRIP_FRAMES = 7


@attrs.frozen(eq=False)
class Library:
    """The flocs of a library, and what their fits were made with."""

    entries: list[ShapeEntry]
    settings: dict[str, Any]


def read(path: str | os.PathLike) -> Library:
    """All that a library holds."""
    return Library(read_library(path), read_settings(path))


def summary(found: Library) -> Summary:
    """How many flocs of how many pictures, their sizes, and how they were fitted."""
    images = sorted({entry.image for entry in found.entries})
    sizes = [1e6 * entry.measured_radius for entry in found.entries]
    facts = [
        ("shapes", f"{len(found.entries)} of {len(images)} pictures"),
        ("r_eq", f"{min(sizes):.3g} to {max(sizes):.3g} µm"),
        *(
            [("outlines", "as cut, and at both ends of their bands (--band)")]
            if all(entry.is_banded for entry in found.entries)
            else []
        ),
        *((name.replace("_", " "), str(value)) for name, value in found.settings.items()),
    ]
    return Summary(facts)


def water(path: str | os.PathLike) -> list[str]:
    """What slow flow makes of the flocs of a library."""
    entries = read_library(path)
    rows: list[tuple[str, ...]] = [("floc", "sinks", "at least", "turns", "B", "+- %")]
    for entry in entries:
        count = max(entry.fits)
        drag = prism_drag(entry.fits[count].shape.outline())
        rows.append((
            visible(entry.floc_id, ""), *(f"{each:.3f}" for each in drag.mobility),
            f"{drag.turning:.3f}", f"{drag.elongation:.3f}", f"{100.0 * drag.error:.1f}",
        ))  # fmt: skip
    heading = (
        f"prisms of {len(entries)} outlines, 4/3 r_eq deep: largest and least settling speed, and "
        "rate of turning, over those of the equivalent spheres; B, the response to strain, over "
        "that of a line"
    )
    return [heading, *aligned(rows)]


def of_entries(draw: Callable[[Any], Figure]) -> Callable[[Library], Figure]:
    """A figure of flocs as one of a Library."""
    return wraps(draw)(lambda found: draw(found.entries))


FIGURES = {name: of_entries(draw) for name, draw in POPULATION_FIGURES.items()}

LIBRARY = Contents(
    title="a shape library",
    read=read,
    summary=summary,
    table=lambda found: format_errors(found.entries),
    figures=lambda found: FIGURES,
    drawn={"a shape library written by flocsim fit": FIGURES},
    water=water,
)


def summary_of_motion(found: StoredTrajectory) -> Summary:
    """What a trajectory file holds."""
    moved = np.hypot(*np.moveaxis(np.diff(found.position[:, :, :2], axis=0), 2, 0)).sum(axis=0)
    facts = [
        ("time", f"{found.t[0]:.6g} to {found.t[-1]:.6g} s, {len(found.t)} states"),
        *((f"body {number}", f"N = {len(shape.vertices)}, r_eq {1e6 * shape.equivalent_radius:.4g} "
           f"µm, moved {1e6 * way:.4g} µm")
          for number, (shape, way) in enumerate(zip(found.shapes, moved, strict=True))),
    ]  # fmt: skip
    if len(found.shapes) == 2:
        apart = 1e6 * centre_distance(found.position)
        facts.append(
            ("centre distance", f"{apart[0]:.4g} µm at first, {apart.min():.4g} at least, "
             f"{apart[-1]:.4g} at last")
        )  # fmt: skip
    for name, value in found.facts.items():
        if name != "config":
            told = f"{value:.6g}" if isinstance(value, float) else str(value)
            facts.append((name.replace("_", " "), told))
    return Summary(facts)


def strip(trajectory: Any, figure: str = "strip") -> Any:
    """Frames of the motion, evenly along the way of the bodies against each other."""
    from flocsim.trajectories.figures import drawn

    return drawn(trajectory, figure, STRIP_FRAMES)


def distance(trajectory: Any) -> Any:
    """Distance of the two centres against time."""
    return strip(trajectory, "distance")


MOTION_FIGURES: Figures = {"strip": strip, "distance": distance}

TRAJECTORY = Contents(
    title="a trajectory",
    read=read_trajectory,
    summary=summary_of_motion,
    table=lambda found: "",
    figures=lambda found: MOTION_FIGURES if len(found.shapes) == 2 else {"strip": strip},
    drawn={"a trajectory file (flocsim trajectory --save, Trajectory.save)": MOTION_FIGURES},
    motion=lambda found: (found.t, found.position, found.velocity, found.shapes),
)
