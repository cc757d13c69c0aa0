"""The group /VTKHDF of a trajectory file: outlines as polygons, moving, for ParaView and VTK.

Poly data of version 2 of the format (docs.vtk.org, "VTKHDF format specification"). The polygons
are the same at all instants, so that only points are written for each.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from flocsim.geometry.shapes.shape import Shape
from flocsim.io.exchange.outlines import frames_of, is_hole, placed, rings_of

KINDS = ("Vertices", "Lines", "Polygons", "Strips")
"""Of cells, in the order of the columns of the offsets; all but Polygons are empty."""


def write_vtkhdf(
    file: Any, times: np.ndarray, position: np.ndarray, shapes: Sequence[Shape]
) -> None:
    """Write the group into an open h5py file: ``times`` (k,) [s], ``position`` (k, n, 3).

    A polygon for every ring: its cell data are ``body``, the number, and ``hole``, 1 for the rings
    of holes. Points are in m.
    """
    rows = frames_of(len(times))
    rings = [rings_of(shape) for shape in shapes]
    points = np.concatenate(
        [placed(np.concatenate(each), position[rows, n]) for n, each in enumerate(rings)], axis=1
    )
    frames, count = points.shape[:2]
    lengths = [len(ring) for each in rings for ring in each]
    owners = [n for n, each in enumerate(rings) for _ in each]
    holes = [int(place > 0 and is_hole(ring)) for each in rings for place, ring in enumerate(each)]

    group = file.create_group("VTKHDF")
    group.attrs["Version"] = np.array([2, 0], "i8")
    group.attrs["Type"] = np.bytes_("PolyData")
    group["NumberOfPoints"] = np.array([count], "i8")
    flat = np.zeros((frames * count, 3), "f8")
    flat[:, :2] = points.reshape(-1, 2)
    group["Points"] = flat
    for kind in KINDS:
        own = lengths if kind == "Polygons" else []
        cells = group.create_group(kind)
        cells["NumberOfCells"] = np.array([len(own)], "i8")
        cells["NumberOfConnectivityIds"] = np.array([sum(own)], "i8")
        cells["Offsets"] = np.concatenate([[0], np.cumsum(own)]).astype("i8")
        cells["Connectivity"] = np.arange(sum(own), dtype="i8")
    data = group.create_group("CellData")
    data["body"], data["hole"] = np.array(owners, "i4"), np.array(holes, "i4")

    steps = group.create_group("Steps")
    steps.attrs["NSteps"] = np.int64(frames)
    steps["Values"] = np.asarray(times, "f8")[rows]
    steps["PointOffsets"] = count * np.arange(frames, dtype="i8")
    steps["NumberOfParts"] = np.ones(frames, "i8")
    for name in ("PartOffsets", "CellDataOffsets/body", "CellDataOffsets/hole"):
        steps[name] = np.zeros(frames, "i8")
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        steps[name] = np.zeros((frames, len(KINDS)), "i8")
