"""Motions in files: one replicate's in HDF5, which is read back; GSD, for OVITO and HOOMD's tools;
VTKHDF, for ParaView. Outlines are found once and then moved.
"""

import io
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.errors import UsageError
from flocsim.geometry.shapes.cores import Part, PointTable, parts_in, table_of
from flocsim.geometry.shapes.outline import swept_geometry
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.spheropolygon import shape_of_parts
from flocsim.io.files import Rule, write_file
from flocsim.io.groups import FileFormat, Group, declared, facts_of
from flocsim.io.hdf5 import File
from flocsim.io.labelled import Labelled, Tables

TRAJECTORY = FileFormat(
    "flocsim trajectory", 3, "trajectory", {}, oldest=2, attribute="kind", remedy="write it again"
)
"""Its arrays are those of `motion_group`, without a group."""

COMPONENTS = ("x", "y", "angle")
"""Of a place and of its rate."""

SCALES = {
    "time": ("f8", "s", "time since the start"),
    "body": ("i8", "1", "number of the body"),
    "component": ("text", "1", "component of the position or velocity"),
    "axis": ("text", "1", "coordinate of a point"),
}
DATASETS = {
    "position": ("f8", "m, m, rad", "x, y and angle of each body (time, body, 3)"),
    "velocity": ("f8", "m/s, m/s, rad/s", "velocity and spin of each body (time, body, 3)"),
}
POINTS = {
    "part": ("i8", "1", "part of the body that a core point belongs to"),
    "ring": ("i8", "1", "ring of the part: 0 its outline, from 1 its holes"),
    "point_radius": ("f8", "m", "radius of the disk that sweeps the part"),
}
"""Columns of the core points of a body."""

MOTION = Group.of(declared(DATASETS, ("time", "body", "component")), SCALES)


def motion_group(bodies: int) -> Group:
    """Return the table of a motion of so many bodies and of their core points."""
    columns, scales = dict(MOTION.columns), dict(SCALES)
    for body in range(bodies):
        vertex = f"vertex_{body}"
        scales[vertex] = ("i8", "1", f"core point of body {body}")
        points = {f"vertices_{body}": ("f8", "m", f"core points of body {body}")}
        columns |= declared(points, (vertex, "axis"))
        columns |= declared({f"{n}_{body}": about for n, about in POINTS.items()}, (vertex,))
    return Group.of(columns, scales)


def centre_distance(position: np.ndarray) -> np.ndarray:
    """Distance of the centroids of two bodies (k,) [m] from their places (k, 2, 3)."""
    return np.hypot(*(position[:, 1, :2] - position[:, 0, :2]).T)


Motion = tuple[np.ndarray, np.ndarray, np.ndarray, Sequence[Shape]]
"""Times (k,) [s], positions and velocities (k, n, 3), and the shapes of the n bodies."""


def write_trajectory(
    path: str | Path, motion: Motion, facts: Mapping[str, str | float], rule: Rule = False
) -> None:
    """Write one replicate's motion; ``facts`` {name: number or text} become attributes.

    Arrays as in DATASETS; the bodies' core points lie in ``vertices_0``, ``vertices_1``, … [m], and
    the part, ring and spheroradius of each in ``part_0``, ``ring_0``, ``point_radius_0``, …;
    ``rule`` says what becomes of a file that is there. Raises FileError if it cannot be written.
    """
    times, position, velocity, shapes = motion
    values: dict[str, Any] = {
        "time": times, "body": np.arange(len(shapes)), "component": COMPONENTS,
        "axis": COMPONENTS[:2], "position": position, "velocity": velocity,
    }  # fmt: skip
    for body, shape in enumerate(shapes):
        points = table_of(shape.parts)
        values |= {f"vertex_{body}": np.arange(len(points.place)), f"vertices_{body}": points.place,
                   f"part_{body}": points.part, f"ring_{body}": points.ring,
                   f"point_radius_{body}": points.radius}  # fmt: skip
    table = motion_group(len(shapes)).labelled(values)
    TRAJECTORY.write(path, {"": table}, attributes=facts, rule=rule)


QUADRANT = 16
"""Points of an outline in a quarter of a circle."""

MOST_FRAMES = 400
"""Instants that are drawn, spread evenly; a file of motion has all of them."""


def ring_points(ring: Any, hole: bool) -> np.ndarray:
    """Return the points (k, 2) of a closed ring of shapely, the last left out: counter-clockwise,
    or clockwise around a hole."""
    points = np.asarray(ring.coords)[:-1]
    return points if ring.is_ccw != hole else points[::-1]


def rings_of(shape: Shape) -> list[tuple[np.ndarray, bool]]:
    """Return the rings (k, 2) [m] of an outline about its centroid, and whether they are holes.

    Most outlines have one outer ring; parts that touch in a point have several.
    """
    whole = swept_geometry(shape.parts, QUADRANT)
    return [
        (ring_points(ring, number > 0), number > 0)
        for polygon in getattr(whole, "geoms", [whole])
        for number, ring in enumerate((polygon.exterior, *polygon.interiors))
    ]


def placed(points: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Points (p, 2) of a body about its centroid at its places (f, 3): (f, p, 2)."""
    cos, sin = np.cos(places[:, 2, None]), np.sin(places[:, 2, None])
    x, y = points.T
    turned = np.stack([cos * x - sin * y, sin * x + cos * y], axis=2)
    return turned + places[:, None, :2]


MICRO = 1e6
ROOM = 1.05


def write_gsd(path: str | Path, motion: Motion, rule: Rule = False) -> None:
    """Write a motion as GSD.

    A frame for each instant, its time in ``log/time`` [s], spins in ``log/particles/spin`` [rad/s];
    a type for each body. UsageError where gsd is not installed, FileError where the file cannot be
    written.
    """
    try:
        import gsd.hoomd
    except ImportError:
        raise UsageError("gsd is not installed: pip install 'flocsim[formats]'") from None

    times, position, velocity, shapes = motion
    # A box about the origin that all bodies stay inside of.
    reach = np.array([shape.bounding_radius for shape in shapes])[:, np.newaxis]
    width = 2.0 * ROOM * MICRO * float((np.abs(position[:, :, :2]) + reach).max())
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "motion.gsd"
        with gsd.hoomd.open(made, "w") as file:
            for step, time in enumerate(times):
                frame = gsd.hoomd.Frame()
                frame.configuration.step, frame.configuration.dimensions = step, 2
                frame.configuration.box = [width, width, 0, 0, 0, 0]
                bodies = frame.particles
                bodies.N = len(shapes)
                bodies.types = [f"body {n}" for n in range(len(shapes))]
                bodies.typeid = list(range(len(shapes)))
                bodies.type_shapes = [shape_of(shape) for shape in shapes]
                flat = (each[step, :, :2] for each in (position, velocity))
                in_space = (np.pad(MICRO * each, ((0, 0), (0, 1))) for each in flat)
                bodies.position, bodies.velocity = in_space
                half = 0.5 * position[step, :, 2]
                turn = np.zeros((len(shapes), 4))
                turn[:, 0], turn[:, 3] = np.cos(half), np.sin(half)
                bodies.orientation = turn
                bodies.diameter = [2.0 * MICRO * shape.equivalent_radius for shape in shapes]
                frame.log["time"] = np.array([time])
                frame.log["particles/spin"] = np.array(velocity[step, :, 2])
                file.append(frame)
        data = made.read_bytes()
    write_file(path, data, rule)


def outer_ring(shape: Shape) -> np.ndarray:
    """Return the outer ring (k, 2) [m] of an outline.

    GSD has one for each body: parts that touch in a point only are drawn a little wider.
    """
    whole = swept = swept_geometry(shape.parts, QUADRANT)
    wider = 0.01 * shape.radius
    while whole.geom_type != "Polygon":
        whole, wider = swept.buffer(wider), 3.0 * wider
    return ring_points(whole.exterior, False)


def shape_of(shape: Shape) -> dict:
    """Return a shape as GSD has it: a sphere, or the outer ring of the outline as a polygon."""
    if len(shape.vertices) == 1:
        return {"type": "Sphere", "diameter": 2.0 * MICRO * shape.radius}
    ring = (MICRO * outer_ring(shape)).tolist()
    return {"type": "Polygon", "rounding_radius": 0, "vertices": ring}


KINDS = ("Vertices", "Lines", "Polygons", "Strips")
"""Of cells, in the order of the columns of the offsets; all but Polygons are empty."""


def write_vtkhdf(path: str | Path, motion: Motion, rule: Rule = False) -> None:
    """Write a motion as `write_gsd` does, but as moving outlines for ParaView, without velocities.

    A polygon for every ring: its cell data are ``body``, the number, and ``hole``, 1 for the rings
    of holes. Points are in m. FileError where the file cannot be written.
    """
    import h5py

    times, position, _, shapes = motion
    rows = np.linspace(0, len(times) - 1, min(len(times), MOST_FRAMES)).round().astype(int)
    rings = [rings_of(shape) for shape in shapes]
    points = np.concatenate(
        [placed(np.concatenate([ring for ring, _ in own]), position[rows, body])
         for body, own in enumerate(rings)], axis=1,
    )  # fmt: skip
    frames, count = points.shape[:2]
    lengths = [len(ring) for own in rings for ring, _ in own]
    flat = np.zeros((frames * count, 3), "f8")
    flat[:, :2] = points.reshape(-1, 2)

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        group = file.create_group("VTKHDF")
        group.attrs["Version"] = np.array([2, 0], "i8")
        group.attrs["Type"] = np.bytes_("PolyData")
        group["NumberOfPoints"] = np.array([count], "i8")
        group["Points"] = flat
        for kind in KINDS:
            own = lengths if kind == "Polygons" else []
            group[f"{kind}/NumberOfCells"] = np.array([len(own)], "i8")
            group[f"{kind}/NumberOfConnectivityIds"] = np.array([sum(own)], "i8")
            group[f"{kind}/Offsets"] = np.concatenate([[0], np.cumsum(own)]).astype("i8")
            group[f"{kind}/Connectivity"] = np.arange(sum(own), dtype="i8")
        owners = [body for body, own in enumerate(rings) for _ in own]
        group["CellData/body"] = np.array(owners, "i4")
        group["CellData/hole"] = np.array([hole for own in rings for _, hole in own], "i4")

        # All instants have the same cells: only the points move.
        steps = group.create_group("Steps")
        steps.attrs["NSteps"] = np.int64(frames)
        steps["Values"] = np.asarray(times, "f8")[rows]
        steps["PointOffsets"] = count * np.arange(frames, dtype="i8")
        steps["NumberOfParts"] = np.ones(frames, "i8")
        for name in ("PartOffsets", "CellDataOffsets/body", "CellDataOffsets/hole"):
            steps[name] = np.zeros(frames, "i8")
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            steps[name] = np.zeros((frames, len(KINDS)), "i8")
    write_file(path, buffer.getvalue(), rule)


WRITERS = {".gsd": write_gsd, ".vtkhdf": write_vtkhdf}
"""What writes a motion, by the ending of the file's name."""


INDICES = {"motion": ("time", "body")}


@attrs.frozen(eq=False)
class StoredTrajectory(Tables):
    """A trajectory file as it is read back: arrays as in DATASETS, shapes, and ``facts`` {name:
    number or text}."""

    t: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    shapes: tuple[Shape, ...]
    facts: dict[str, Any]
    indices = INDICES

    def labelled(self, group: str = "motion") -> Labelled:
        """Return the motion with its axes; UsageError for another group."""
        self.known(group)
        return MOTION.labelled({
            "time": self.t, "body": np.arange(len(self.shapes)), "component": COMPONENTS,
            "position": self.position, "velocity": self.velocity,
        })  # fmt: skip

    @property
    def status(self) -> str:
        """How the run ended, or which replicate it is, in words."""
        if "status" in self.facts:
            return str(self.facts["status"])
        return f"replicate {self.facts['replicate']}" if "replicate" in self.facts else "motion"


def read_trajectory(path: str | os.PathLike) -> StoredTrajectory:
    """Return the motion in a trajectory file; FileError where it is damaged, or of another kind."""
    with TRAJECTORY.opened(path) as file:
        time, position, velocity = (file.read(name) for name in ("time", "position", "velocity"))
        bodies = len(file.read("body"))
        for array in (position, velocity):
            if array.shape != (len(time), bodies, 3) or not np.isfinite(array).all():
                raise ValueError("its arrays do not match its times and bodies, or have no numbers")
        shapes = tuple(stored_shape(file, body) for body in range(bodies))
        return StoredTrajectory(time, position, velocity, shapes, facts_of(file))


def stored_shape(file: File, body: int) -> Shape:
    """Return the shape of one body of an open file; ValueError where it is none."""
    points = f"vertices_{body}"
    if f"part_{body}" not in file:  # version 2, of a body without holes or parts
        radius = float(file.node(points).attributes["radius"])
        return shape_of_parts((Part((file.read(points),), radius),))
    columns = (file.read(f"{name}_{body}") for name in ("vertices", *POINTS))
    return shape_of_parts(parts_in(PointTable(*columns)))
