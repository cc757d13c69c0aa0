"""Trajectory files: one replicate's motion in HDF5."""

import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.geometry.shapes.parts import PointTable, parts_in, table_of
from flocsim.geometry.shapes.shape import Shape, Sphere
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon, shape_of_parts
from flocsim.io.exchange import add_vtkhdf, write_gsd
from flocsim.io.files import Rule, keep, write_file
from flocsim.io.groups import opened_file, write_labelled
from flocsim.io.labelled import Column, Labelled, about_of
from flocsim.io.seals import seal

KIND = "flocsim trajectory"
SCHEMA_VERSION = 2

COMPONENTS = ("x", "y", "angle")
"""Of a place and of its rate."""

DATASETS = {
    "time": ("s", "time since the start"),
    "position": ("m, m, rad", "x, y and angle of each body (time, body, 3)"),
    "velocity": ("m/s, m/s, rad/s", "velocity and spin of each body (time, body, 3)"),
    "centre_distance": ("m", "distance of the two centroids"),
}
"""Units and meaning of the arrays of a trajectory file."""


def centre_distance(position: np.ndarray) -> np.ndarray:
    """Distance of the centroids of two bodies (k,) [m] from their places (k, 2, 3)."""
    return np.hypot(*(position[:, 1, :2] - position[:, 0, :2]).T)


def write_trajectory(
    path: str | Path,
    times: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    shapes: Sequence[Shape],
    facts: Mapping[str, str | float],
    rule: Rule = keep,
) -> None:
    """Write one replicate's motion; ``facts`` {name: number or text} become attributes.

    Arrays as in DATASETS; the bodies' core points lie in ``vertices_0``, ``vertices_1``, … [m],
    their spheroradii in the attribute ``radius``, of bodies with holes or parts also what part,
    ring and radius belongs to a point (``part_0``, ``ring_0``, ``point_radius_0``), and moving
    outlines for ParaView in the group ``VTKHDF``; ``rule`` says what becomes of a file that is
    there. Raises FileError if it cannot be written.
    """
    import h5py

    count = len(shapes)
    scales: dict[str, Any] = {
        "time": times,
        "body": np.arange(count),
        "component": np.array(COMPONENTS, object),
        "axis": np.array(COMPONENTS[:2], object),
    } | {f"vertex_{body}": np.arange(len(each.vertices)) for body, each in enumerate(shapes)}
    arrays = {"position": position, "velocity": velocity}
    if count == 2:
        arrays["centre_distance"] = centre_distance(position)
    axes = ("time", "body", "component")
    columns = {
        name: Column(axes[: array.ndim], array, about_of(DATASETS[name]))
        for name, array in arrays.items()
    }
    for body, shape in enumerate(shapes):
        of_points, about = (f"vertex_{body}", "axis"), {"units": "m", "radius": shape.radius}
        columns[f"vertices_{body}"] = Column(of_points, np.array(shape.vertices), about)
        if shape.is_compound:
            table = table_of(shape.parts)
            for name, values, unit in (
                ("part", table.part, "1"), ("ring", table.ring, "1"),
                ("point_radius", table.radius, "m"),
            ):  # fmt: skip
                columns[f"{name}_{body}"] = Column(of_points[:1], values, {"units": unit})
    said = {name: DATASETS.get(name, ("1", name.replace("_", " of body "))) for name in scales}
    coordinates = {
        name: Column((name,), each, about_of(said[name])) for name, each in scales.items()
    }
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs.update({"kind": KIND, "schema_version": SCHEMA_VERSION, **facts})
        write_labelled(file, Labelled(coordinates, columns))
        add_vtkhdf(file, times, position, shapes)
    write_file(path, seal(buffer.getvalue()), rule)


def write_vtkhdf(
    path: str | Path, times: np.ndarray, position: np.ndarray, velocity: np.ndarray,
    shapes: Sequence[Shape], rule: Rule = keep,
) -> None:  # fmt: skip
    """Write a motion as `write_gsd` does, but as a file of moving outlines for ParaView, without
    velocities; FileError where the file cannot be written."""
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        add_vtkhdf(file, times, position, shapes)
    write_file(path, buffer.getvalue(), rule)


WRITERS = {".gsd": write_gsd, ".vtkhdf": write_vtkhdf}
"""What writes a motion, by the ending of the file's name."""


@attrs.frozen(eq=False)
class StoredTrajectory:
    """A trajectory file as it is read back: arrays as in DATASETS, shapes, and ``facts`` {name:
    number or text}."""

    t: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    shapes: tuple[Shape, ...]
    facts: dict[str, Any]

    @property
    def status(self) -> str:
        """How the run ended, or which replicate it is, in words."""
        if "status" in self.facts:
            return str(self.facts["status"])
        return f"replicate {self.facts['replicate']}" if "replicate" in self.facts else "motion"


def read_trajectory(path: str | os.PathLike) -> StoredTrajectory:
    """The motion in a trajectory file; FileError where it is damaged, or of another kind."""
    with opened_file(
        path, lambda reason: f"{path} has no readable trajectory: {reason}; write it again"
    ) as (file, _):
        return stored_trajectory(file)


def stored_trajectory(file):
    """The StoredTrajectory of an open file; ValueError where it is none."""
    facts = {
        name: value.item() if hasattr(value, "item") else value
        for name, value in file.attrs.items()
    }
    if facts.pop("kind", "") != KIND or facts.pop("schema_version", 0) != SCHEMA_VERSION:
        raise ValueError(f"it is not a {KIND} of version {SCHEMA_VERSION}")
    time, *arrays = (file[name][()] for name in ("time", "position", "velocity"))
    bodies = len(file["body"])
    if time.ndim != 1 or not len(time) or not bodies:
        raise ValueError("it has no times or no bodies")
    for array in (time, *arrays):
        shape = (len(time), bodies, 3) if array.ndim > 1 else (len(time),)
        if array.shape != shape or not np.isfinite(array).all():
            raise ValueError("its arrays do not match its times and bodies, or are not numbers")
    shapes = []
    for body in range(bodies):
        vertices = file[f"vertices_{body}"]
        radius, points = float(vertices.attrs["radius"]), vertices[()]
        if f"part_{body}" in file:
            columns = [file[f"{name}_{body}"][()] for name in ("part", "ring", "point_radius")]
            if any(column.shape != (len(points),) for column in columns):
                raise ValueError("the columns of its core points do not match the points")
            shapes.append(shape_of_parts(parts_in(PointTable(points, *columns))))
        else:
            shapes.append(SpheroPolygon(points, radius) if len(points) > 1 else Sphere(radius))
    return StoredTrajectory(time, *arrays, tuple(shapes), facts)
