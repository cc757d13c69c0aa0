"""Motion as a GSD file, for OVITO and all that reads HOOMD's files: bodies with polygon shapes.

GSD has no units: lengths are µm here and times s, since OVITO's camera does not come as near as m
would want. Holes of outlines cannot be said in it.
"""

import json
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from flocsim.errors import UsageError
from flocsim.geometry.shapes.parts import Part
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.spheropolygon import shape_of_parts
from flocsim.io.exchange.outlines import is_hole, rings_of, spread
from flocsim.io.files import Rule, keep, write_file

MICRO = 1e6
ROOM = 1.05


def write_gsd(
    path: str | Path, times: np.ndarray, position: np.ndarray, velocity: np.ndarray,
    shapes: Sequence[Shape], rule: Rule = keep,
) -> None:  # fmt: skip
    """Write a motion, ``times`` (k,) [s], ``position`` and ``velocity`` (k, n, 3), as GSD.

    A frame for each instant, its time in ``log/time`` [s], spins in ``log/particles/spin`` [rad/s];
    a type for each body. UsageError where gsd is not installed, FileError where the file cannot be
    written.
    """
    try:
        import gsd.hoomd
    except ImportError:
        raise UsageError("gsd is not installed: pip install 'flocsim[formats]'") from None

    width = 2.0 * ROOM * MICRO * spread(shapes, position)
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
                bodies.position = in_space(MICRO * position[step, :, :2])
                bodies.velocity = in_space(MICRO * velocity[step, :, :2])
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


def in_space(flat: np.ndarray) -> np.ndarray:
    """Vectors (n, 2) with z = 0."""
    return np.concatenate([flat, np.zeros((len(flat), 1))], axis=1)


def outer_ring(shape: Shape) -> np.ndarray:
    """The outer ring of an outline (k, 2) [m]. GSD has one for each body: disks of parts that touch
    in a point only are drawn a little wider."""
    for wider in WIDER:
        parts = [Part(part.rings, part.radius * wider) for part in shape.parts]
        known = shape if wider == 1.0 else shape_of_parts(parts)
        rings = rings_of(known)
        if len(rings) == 1 or is_hole(rings[1]):
            break
    return rings[0] + known.centroid * (known is not shape)


WIDER = (1.0, 1.01, 1.03, 1.1, 1.3)
"""Factors of radii that are tried until there is one outer ring."""


def shape_of(shape: Shape) -> dict:
    """What GSD says of a shape: a sphere, or the outer ring of the outline as a polygon."""
    if len(shape.vertices) == 1:
        return {"type": "Sphere", "diameter": 2.0 * MICRO * shape.radius}
    ring = (MICRO * outer_ring(shape)).tolist()
    # As numbers of JSON, which is how the file holds them.
    return json.loads(json.dumps({"type": "Polygon", "rounding_radius": 0, "vertices": ring}))
