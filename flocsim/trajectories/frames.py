"""Frames of a motion, for drawing: what is seen at some of its instants."""

from collections.abc import Sequence

import attrs
import numpy as np

from flocsim.geometry.contact.overlap import placed_contacts
from flocsim.geometry.shapes.shape import Shape
from flocsim.io.trajectory import centre_distance


@attrs.frozen(eq=False)
class Frames:
    """Instants of a motion, seen from the first body's centroid; of a lone body, from where it is.

    ``times`` (f,) [s]; ``outlines`` per frame and body a list of rings (k, 2) [m]; ``contacts``
    per frame (c, 2) [m]; ``paths`` per body (m, 2) [m]; ``centre_distance`` (f,) [m] of the first
    two, 0 of one.
    """

    times: np.ndarray
    outlines: list[list[list[np.ndarray]]]
    contacts: list[np.ndarray]
    paths: list[np.ndarray]
    centre_distance: np.ndarray


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


def rows_along(way: np.ndarray, count: int) -> np.ndarray:
    """``count`` rows evenly along a way, the first and the last among them; some may be alike."""
    return np.searchsorted(way, np.linspace(0.0, way[-1], count)).clip(0, len(way) - 1)


def frames_at(
    shapes: Sequence[Shape], times: np.ndarray, places: np.ndarray, position: np.ndarray
) -> Frames:
    """The Frames at some times (f,) [s], where the bodies are at ``places`` (f, n, 3); their paths
    are those of all of the motion, ``position`` (k, n, 3)."""
    seen, whole = seen_from_first(places), seen_from_first(position)
    apart = len(shapes) > 1
    return Frames(
        times,
        [[shape.outline(*each[n]) for n, shape in enumerate(shapes)] for each in seen],
        [placed_contacts(shapes, each) for each in seen],
        [whole[:, n, :2] for n in range(len(shapes))],
        centre_distance(places) if apart else np.zeros(len(times)),
    )


def choose_instants(
    times: np.ndarray, position: np.ndarray, size: float, count: int, collision: float
) -> np.ndarray:
    """Rows of ``count`` instants: start, collision, end, and the rest evenly along the way.

    ``position`` (k, 2, 3); ``size`` [m], by which turning counts; ``collision`` time [s] or nan.
    """
    way = travelled(position, [size, size])
    rows = rows_along(way, count)
    if np.isfinite(collision) and count > 2:
        touch = int(np.abs(times - collision).argmin())
        inner = 1 + int(np.abs(way[rows[1:-1]] - way[touch]).argmin())
        rows[inner] = touch
    return np.unique(rows)


def frames_of(
    shapes: Sequence[Shape], times: np.ndarray, position: np.ndarray, collision: float, count: int
) -> Frames:
    """The Frames of a replicate's motion: ``position`` (k, 2, 3), ``collision`` time [s] or nan."""
    size = 0.5 * sum(shape.bounding_radius for shape in shapes)
    rows = choose_instants(times, position, size, count, collision)
    return frames_at(shapes, times[rows], position[rows], position)
