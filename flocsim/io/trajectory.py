"""Trajectory files: one replicate's motion in HDF5."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.geometry.shapes.shape import Shape
from flocsim.io.files import Rule, keep, seal, write_file

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
    their spheroradii in the attribute ``radius``; ``rule`` says what becomes of a file that is
    there. Raises FileError if it cannot be written.
    """
    import h5py

    arrays = {"position": position, "velocity": velocity}
    if len(shapes) == 2:
        arrays["centre_distance"] = centre_distance(position)
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file.attrs["kind"] = "flocsim trajectory"
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
    write_file(path, seal(buffer.getvalue()), rule)
