"""What a Trajectory shows: frames of it, distance and forces of a pair, an animation."""

from pathlib import Path
from typing import Any

import numpy as np

from flocsim.errors import UsageError
from flocsim.fields import is_whole
from flocsim.io.outputs import figure_rule
from flocsim.io.plots.collision import (
    draw_distance,
    draw_energies,
    draw_forces,
    draw_strip,
    write_animation,
)
from flocsim.io.plots.style import CLASS_WORDS, Figure
from flocsim.io.trajectory import centre_distance
from flocsim.trajectories.frames import Frames, frames_at, travelled
from flocsim.trajectories.replay import motion_at

FIGURES = ("strip", "distance", "forces", "energies")
MOST_FRAMES = 500


def frames_of(trajectory: Any, count: int) -> Frames:
    """So many Frames, evenly along the way of the bodies against each other."""
    if not is_whole(count) or not 2 <= count <= MOST_FRAMES:
        raise UsageError(f"frames must be a whole number from 2 to {MOST_FRAMES}, found {count!r}")
    position, shapes = trajectory.position, trajectory.shapes
    way = travelled(position, [shape.bounding_radius for shape in shapes])
    wanted = np.linspace(0.0, way[-1], count)
    # What stays where it is is seen at its start and its end.
    times = np.interp(wanted, way, trajectory.t) if way[-1] > 0.0 else trajectory.t[[0, -1]]
    return frames_at(shapes, times, places_at(trajectory, times), position)


def places_at(trajectory: Any, times: np.ndarray) -> np.ndarray:
    """The places (f, n, 3) at some times; of a motion from a file by Hermite's cubic."""
    if hasattr(trajectory, "at"):
        return trajectory.at(times).position
    states = np.concatenate([trajectory.position, trajectory.velocity], axis=2)
    return np.array([motion_at(trajectory.t, states, time)[:, :3] for time in times])


def title_of(trajectory: Any) -> str:
    """The outcome of a study's replicate; of any other run, how it ended."""
    if getattr(trajectory, "row", None) is not None:
        outcome = trajectory.row["outcome"]
        return CLASS_WORDS.get(outcome, outcome)
    return str(trajectory.status).partition(":")[0].lower()


def drawn(trajectory: Any, figure: str, frames: int) -> Figure:
    """One of FIGURES of a Trajectory."""
    if figure not in FIGURES:
        raise UsageError(f"figure must be one of {', '.join(FIGURES)}, found {figure!r}")
    title = title_of(trajectory)
    if figure == "strip":
        seen = frames_of(trajectory, frames)
        pair = len(trajectory.shapes) == 2
        return draw_strip(
            seen.outlines, seen.times.tolist(), seen.paths, title, contacts=seen.contacts,
            seen_from=0 if len(trajectory.shapes) > 1 else None,
            centre_distance=seen.centre_distance.tolist() if pair else None,
        )  # fmt: skip
    if figure == "energies":
        found = trajectory.energies()
        kinetic = found.kinetic.sum(axis=1)
        return draw_energies(found.t, found.work, kinetic.tolist(), title)
    check_pair(trajectory)
    if figure == "distance":
        return draw_distance(*distances(trajectory), title=title)
    apart = trajectory.position[:, 1, :2] - trajectory.position[:, 0, :2]
    direction = apart / np.hypot(*apart.T)[:, None]
    along = {
        name: np.sum(force[:, 1, :2] * direction, axis=1)
        for name, force in trajectory.forces().items()
    }
    return draw_forces(trajectory.t, along, title=title)


def animated(trajectory: Any, path: Path, frames: int) -> None:
    """Write the animation of a pair."""
    if path.suffix.lower() != ".gif":
        raise UsageError(f"{path}: an animation's name must end in .gif")
    check_pair(trajectory)
    seen = frames_of(trajectory, frames)
    write_animation(path, seen, distances(trajectory), rule=figure_rule())


def distances(trajectory: Any) -> tuple[list[float], list[float]]:
    """Times and centre distances of a pair."""
    return trajectory.t.tolist(), centre_distance(trajectory.position).tolist()


def check_pair(trajectory):
    if len(trajectory.shapes) != 2:
        raise UsageError(
            f'this figure is of two bodies, and the run has {len(trajectory.shapes)}: draw "strip" '
            'or "energies"'
        )
