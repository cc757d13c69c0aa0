"""Frames of a motion, for drawing: what is seen at some of its instants."""

import math
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
