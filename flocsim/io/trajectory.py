"""Trajectory files: one replicate's motion in HDF5."""

import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.geometry.shapes.parts import PointTable, parts_in, table_of
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.sphere import Sphere
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon, shape_of_parts
from flocsim.io.exchange.vtkhdf import write_vtkhdf
from flocsim.io.files import Rule, keep, seal, write_file
from flocsim.io.opening import opened_file

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

    arrays = {"position": position, "velocity": velocity}
    if len(shapes) == 2:
        arrays["centre_distance"] = centre_distance(position)
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs["kind"] = KIND
        file.attrs["schema_version"] = SCHEMA_VERSION
        for name, value in facts.items():
            file.attrs[name] = value
        scales: dict[str, Any] = {
            "time": times, "body": np.arange(len(shapes)), "component": list(COMPONENTS),
            "axis": list(COMPONENTS[:2]),
        }  # fmt: skip
        for body, shape in enumerate(shapes):
            scales[f"vertex_{body}"] = np.arange(len(shape.vertices))
        for name, values in scales.items():
            kind = h5py.string_dtype() if isinstance(values, list) else None
            scale = file.create_dataset(name, data=values, dtype=kind)
            scale.make_scale(name)
            units, text = DATASETS.get(name, ("1", name.replace("_", " of body ")))
            scale.attrs["units"], scale.attrs["long_name"] = units, text

        def write(name: str, array: np.ndarray, axes: Sequence[str]) -> Any:
            dataset = file.create_dataset(name, data=array)
            for place, axis in enumerate(axes):
                dataset.dims[place].attach_scale(file[axis])
            return dataset

        for name, array in arrays.items():
            dataset = write(name, array, ("time", "body", "component")[: array.ndim])
            dataset.attrs["units"], dataset.attrs["long_name"] = DATASETS[name]
        for body, shape in enumerate(shapes):
            axes = (f"vertex_{body}", "axis")
            dataset = write(f"vertices_{body}", np.array(shape.vertices), axes)
            dataset.attrs["units"] = "m"
            dataset.attrs["radius"] = shape.radius
            if shape.is_compound:
                table = table_of(shape.parts)
                for name, column in (("part", table.part), ("ring", table.ring)):
                    dataset = write(f"{name}_{body}", column, axes[:1])
                    dataset.attrs["units"] = "1"
                dataset = write(f"point_radius_{body}", table.radius, axes[:1])
                dataset.attrs["units"] = "m"
        write_vtkhdf(file, times, position, shapes)
    write_file(path, seal(buffer.getvalue()), rule)


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
        path, lambda reason: f"{path} holds no readable trajectory: {reason}; write it again"
    ) as (file, _):
        return stored_trajectory(file)


def stored_trajectory(file):
    """The StoredTrajectory of an open file; ValueError where it is none."""
    facts = {name: plain_fact(value) for name, value in file.attrs.items()}
    if facts.pop("kind", "") != KIND or facts.pop("schema_version", 0) != SCHEMA_VERSION:
        raise ValueError(f"it is no {KIND} of version {SCHEMA_VERSION}")
    time, *arrays = (file[name][()] for name in ("time", "position", "velocity"))
    bodies = len(file["body"])
    if time.ndim != 1 or not len(time) or not bodies:
        raise ValueError("it has no times or no bodies")
    for array in (time, *arrays):
        shape = (len(time), bodies, 3) if array.ndim > 1 else (len(time),)
        if array.shape != shape or not np.isfinite(array).all():
            raise ValueError("its arrays are not as long as its times and bodies, or no numbers")
    shapes = []
    for body in range(bodies):
        vertices = file[f"vertices_{body}"]
        radius, points = float(vertices.attrs["radius"]), vertices[()]
        if f"part_{body}" in file:
            columns = [file[f"{name}_{body}"][()] for name in ("part", "ring", "point_radius")]
            if any(column.shape != (len(points),) for column in columns):
                raise ValueError("the columns of its core points are not as long as these")
            shapes.append(shape_of_parts(parts_in(PointTable(points, *columns))))
        else:
            shapes.append(SpheroPolygon(points, radius) if len(points) > 1 else Sphere(radius))
    return StoredTrajectory(time, *arrays, tuple(shapes), facts)


def plain_fact(value):
    """An attribute as a Python number or text."""
    return value.item() if hasattr(value, "item") else value
