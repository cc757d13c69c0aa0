"""What a Trajectory shows: frames of it, distance and forces of a pair, an animation."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.errors import UsageError
from flocsim.fields import is_whole
from flocsim.geometry.contact.points import placed_contacts
from flocsim.geometry.shapes.shape import Shape
from flocsim.io.files import Rule
from flocsim.io.outputs import check_ending
from flocsim.io.plots import collision
from flocsim.io.plots.style import BODY_COLOURS, CLASS_WORDS, MICRO, MOST_OF_TITLE, Figure, plain
from flocsim.io.trajectory import centre_distance
from flocsim.trajectories.replay import motion_at


def seen_from_first(position: np.ndarray) -> np.ndarray:
    """Places (k, n, 3) against the first body's centroid; those of a lone body as they are."""
    relative = position.copy()
    if position.shape[1] > 1:
        relative[:, :, :2] -= position[:, :1, :2]
    return relative


def travelled(position: np.ndarray, sizes: Sequence[float]) -> np.ndarray:
    """Length (k,) [m] of the way of the bodies against the first, turning by angle · size included.

    ``position`` (k, n, 3); ``sizes`` (n,) [m].
    """
    relative = seen_from_first(position)
    steps = np.hypot(*np.moveaxis(np.diff(relative[:, :, :2], axis=0), 2, 0)).sum(axis=1)
    turns = np.abs(np.diff(position[:, :, 2], axis=0)) @ np.asarray(sizes)
    return np.concatenate([[0.0], np.cumsum(steps + turns)])


def instants_along(
    times: np.ndarray, position: np.ndarray, sizes: Sequence[float], count: int,
    touch: float = math.nan,
) -> np.ndarray:  # fmt: skip
    """``count`` times [s] of a motion evenly along its way: its start and its end among them, and
    the instant of a ``touch``, where there is one. Others as in `travelled`."""
    way = travelled(position, sizes)
    if not way[-1] > 0.0:
        return times[[0, -1]]
    wanted = np.linspace(0.0, way[-1], count)
    found = np.interp(wanted, way, times)
    if math.isfinite(touch) and count > 2:
        nearest = np.abs(wanted[1:-1] - np.interp(touch, times, way)).argmin()
        found[1 + nearest] = touch
    return np.unique(found)


def frames_at(
    shapes: Sequence[Shape], times: np.ndarray, places: np.ndarray, position: np.ndarray
) -> collision.Frames:
    """The Frames at some times (f,) [s], where the bodies are at ``places`` (f, n, 3); their paths
    are those of all of the motion, ``position`` (k, n, 3)."""
    seen, whole = seen_from_first(places), seen_from_first(position)
    apart = len(shapes) > 1
    return collision.Frames(
        times,
        [[shape.outline(*each[n]) for n, shape in enumerate(shapes)] for each in seen],
        [placed_contacts(shapes, each) for each in seen],
        [whole[:, n, :2] for n in range(len(shapes))],
        centre_distance(places) if apart else np.zeros(len(times)),
    )


APPROACH_FRAMES, CONTACT_FRAMES = 30, 60
"""Frames of a motion on a page before the first touch and from then on: it shows the contact."""

FIGURES = ("strip", "distance", "forces", "energies")
MOST_FRAMES = 500


def frames_of(trajectory: Any, count: int) -> collision.Frames:
    """So many Frames, evenly along the way of the bodies against each other."""
    if not is_whole(count) or not 2 <= count <= MOST_FRAMES:
        raise UsageError(f"frames must be a whole number from 2 to {MOST_FRAMES}, found {count!r}")
    position, shapes = trajectory.position, trajectory.shapes
    sizes = [shape.bounding_radius for shape in shapes]
    touch, _ = touch_and_zone(trajectory)
    times = instants_along(trajectory.t, position, sizes, count, touch)
    if hasattr(trajectory, "at"):
        places = trajectory.at(times).position
    else:  # a motion from a file
        states = np.concatenate([position, trajectory.velocity], axis=2)
        places = np.array([motion_at(trajectory.t, states, time)[:, :3] for time in times])
    return frames_at(shapes, times, places, position)


def touch_and_zone(trajectory: Any) -> tuple[float, float]:
    """(instant [s] at which the outlines of a study's replicate touched, its D_0 [m]); NaN of any
    other run."""
    row = getattr(trajectory, "row", None)
    return (math.nan, math.nan) if row is None else (row["t_collision"], row["D_0"])


def title_of(trajectory: Any) -> str:
    """The outcome of a study's replicate; of any other run, how it ended."""
    if getattr(trajectory, "row", None) is not None:
        outcome = trajectory.row["outcome"]
        return CLASS_WORDS.get(outcome, outcome)
    return str(trajectory.status).partition(":")[0].lower()


def drawn(trajectory: Any, figure: str, frames: int, title: str | None = None) -> Figure:
    """One of FIGURES of a Trajectory; ``title``: another one than `title_of` gives."""
    if figure not in FIGURES:
        raise UsageError(f"figure must be one of {', '.join(FIGURES)}, found {figure!r}")
    title = plain(title_of(trajectory) if title is None else title, MOST_OF_TITLE)
    touch, zone = touch_and_zone(trajectory)
    if figure == "strip":
        return collision.draw_strip(frames_of(trajectory, frames), title, zone)
    if figure == "energies":
        found = trajectory.energies()
        kinetic = found.kinetic.sum(axis=1)
        return collision.draw_energies(found.t, found.work, kinetic.tolist(), title)
    check_pair(trajectory)
    if figure == "distance":
        return collision.draw_distance(*distances(trajectory), zone, title)
    apart = trajectory.position[:, 1, :2] - trajectory.position[:, 0, :2]
    direction = apart / np.hypot(*apart.T)[:, None]
    along = {
        name: np.sum(force[:, 1, :2] * direction, axis=1)
        for name, force in trajectory.forces().items()
    }
    return collision.draw_forces(trajectory.t, along, touch, title)


def animated(trajectory: Any, path: Path, frames: int, title: str = "", rule: Rule = False) -> None:
    """Write the animation of a pair; ``rule`` says what becomes of a file that is there."""
    check_ending(path, (".gif",))
    check_pair(trajectory)
    seen = frames_of(trajectory, frames)
    _, zone = touch_and_zone(trajectory)
    told = plain(title, MOST_OF_TITLE)
    collision.write_animation(path, seen, distances(trajectory), zone, told, rule)


def motion_data(run: Any) -> dict[str, Any]:
    """Return what the script of a page needs to show a study's replicate.

    Lengths in µm, to a picometre; bodies are seen from the first. Frames are evenly spaced along
    the way of the bodies, apart for the approach and for the contact.
    """
    touch, zone = touch_and_zone(run)
    sizes = [shape.bounding_radius for shape in run.shapes]
    after = run.t > touch
    found = [
        instants_along(run.t[part], run.position[part], sizes, count)
        for part, count in ((~after, APPROACH_FRAMES), (after, CONTACT_FRAMES)) if part.sum() > 1
    ]  # fmt: skip
    times = np.unique(np.concatenate([run.t[[0, -1]], [touch], *found]))
    places = run.at(times).position
    frames = frames_at(run.shapes, times, places, run.position)
    # The middle of both bodies in every frame, and one half width that fits them all.
    eyes, half = collision.windows(frames.outlines)
    unit, factor = collision.time_unit(run.t)
    pose = seen_from_first(places) * [MICRO, MICRO, math.degrees(1.0)]
    distances = (MICRO * frames.centre_distance).tolist()
    return {
        "paths": [collision.svg_path(shape.outline(0.0, 0.0, 0.0)) for shape in run.shapes],
        "colour": [BODY_COLOURS[: len(run.shapes)]], "pose": pose.round(6).tolist(),
        "eye": (MICRO * eyes).round(6).tolist(), "half": MICRO * half,
        "contacts": [(MICRO * each).round(6).tolist() for each in frames.contacts],
        "t": times.tolist(), "unit": [unit, factor], "distance": distances,
        "zone": MICRO * zone if math.isfinite(zone) else None,
        "shown": int(np.abs(times - touch).argmin()), "between": 1,
        "words": [f"t = {factor * time:.4g} {unit}, d_c = {distance:.4g} µm"
                  for time, distance in zip(times, distances, strict=True)],
    }  # fmt: skip


def distances(trajectory: Any) -> tuple[list[float], list[float]]:
    """Times and centre distances of a pair."""
    return trajectory.t.tolist(), centre_distance(trajectory.position).tolist()


def check_pair(trajectory):
    if len(trajectory.shapes) != 2:
        raise UsageError(
            f"this figure is for two bodies, but the run has {len(trajectory.shapes)}: draw "
            '"strip" or "energies"'
        )
