"""Frames of one collision, for drawing: which instants, and what is seen in them."""

from collections.abc import Sequence

import attrs
import numpy as np

from flocsim.geometry.contact.overlap import touching_points
from flocsim.geometry.shapes.shape import Shape


@attrs.frozen(eq=False)
class Frames:
    """Instants of a collision, seen from the receiving body's centroid.

    ``times`` (f,) [s]; ``outlines`` per frame and body a list of rings (k, 2) [m]; ``contacts``
    per frame (c, 2) [m]; ``centre_distance`` (f,) [m]; ``paths`` per body (m, 2) [m].
    """

    times: np.ndarray
    outlines: list[list[list[np.ndarray]]]
    contacts: list[np.ndarray]
    centre_distance: np.ndarray
    paths: tuple[np.ndarray, np.ndarray]


def travelled(position, size):
    """Length (k,) [m] of the way of body j against i, turning by angle · size included."""
    relative = position[:, 1] - position[:, 0]
    steps = np.hypot(*np.diff(relative[:, :2], axis=0).T)
    turns = np.abs(np.diff(position[:, :, 2], axis=0)).sum(axis=1) * size
    return np.concatenate([[0.0], np.cumsum(steps + turns)])


def choose_instants(times, position, size, count, collision):
    """Rows of ``count`` instants: start, collision, end, and the rest evenly along the way."""
    way = travelled(position, size)
    wanted = np.linspace(0.0, way[-1], count)
    rows = np.searchsorted(way, wanted).clip(0, len(times) - 1)
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
    relative = position.copy()
    relative[:, :, :2] -= position[:, :1, :2]
    outlines = [
        [shape.outline(*relative[row, body]) for body, shape in enumerate(shapes)] for row in rows
    ]
    contacts = [
        touching_points(
            shapes[0].placed_vertices(*relative[row, 0]), shapes[0].radius,
            shapes[1].placed_vertices(*relative[row, 1]), shapes[1].radius,
        )
        for row in rows
    ]  # fmt: skip
    distance = np.hypot(*(position[rows, 1, :2] - position[rows, 0, :2]).T)
    paths = (relative[:, 0, :2], relative[:, 1, :2])
    return Frames(times[rows], outlines, contacts, distance, paths)
