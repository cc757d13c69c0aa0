"""Which instants of one collision to draw."""

from collections.abc import Sequence

import numpy as np

from flocsim.geometry.shapes.shape import Shape
from flocsim.trajectories.frames import Frames, frames_at, rows_along, travelled


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
