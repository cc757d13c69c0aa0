"""Shapes with holes and of several parts, and what shapely says of them."""

import numpy as np
import shapely

from flocsim import Composite, Sphere, SpheroPolygon

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
BAR = np.array([[-3.0, 0.0], [3.0, 0.0]])


def wavy(count, depth, lobes, scale=1.0):
    """A ring of so many points about the origin, in and out by a share of its radius."""
    angle = 2.0 * np.pi * np.arange(count) / count
    reach = scale * (1.0 + depth * np.cos(lobes * angle + 0.3))
    return reach[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])


def framed(unit=1.0):
    """A square frame: a hole of side 4 in a square of side 10, swept by 1 (of ``unit``)."""
    return SpheroPolygon(5.0 * unit * SQUARE, unit, holes=[3.0 * unit * SQUARE])


def lace(unit=1.0):
    """A wavy outline with two holes, one of which the disk nearly closes."""
    holes = [wavy(7, 0.2, 2, 2.0) + (2.5, 0.3), wavy(5, 0.1, 2, 0.8) - (3.0, 1.0)]
    return SpheroPolygon(unit * wavy(24, 0.15, 5, 7.0), 0.4 * unit, holes=[unit * h for h in holes])


def beads(unit=1.0):
    """Disks of several radii that overlap or touch, and a bar."""
    return Composite([
        (Sphere(1.0 * unit), (0.0, 0.0)), (Sphere(2.0 * unit), (2.5 * unit, 0.0)),
        (Sphere(0.7 * unit), (-1.7 * unit, 0.0)),
        (SpheroPolygon(BAR * unit, 0.3 * unit), (2.0 * unit, 2.2 * unit), 0.4),
        (Sphere(0.9 * unit), (4.0 * unit, 2.0 * unit)),
    ])  # fmt: skip


def cross(unit=1.0):
    """Two polygons that lie across each other, and a frame on one's end."""
    star = SpheroPolygon(wavy(18, 0.4, 6, 3.0) * unit, 0.25 * unit)
    plank = SpheroPolygon(np.array([[-6, -1], [6, -1], [6, 1], [-6, 1.0]]) * unit, 0.5 * unit)
    return Composite([
        (star, (0.0, 0.0), 0.2), (plank, (0.0, 0.3 * unit), 0.5),
        (framed(0.4 * unit), (6.5 * unit, 3.6 * unit), 0.1),
    ])  # fmt: skip


MAKERS = [framed, lace, beads, cross]


def drawn(shape, points=400):
    """The shape as shapely has it, its disks drawn by so many points to the quadrant."""
    cores = []
    for part in shape.parts:
        outer, *holes = part.rings
        makers = {1: shapely.Point, 2: shapely.LineString}
        core = makers[len(outer)](outer) if len(outer) < 3 else shapely.Polygon(outer, holes)
        cores.append(core.buffer(part.radius, quad_segs=points))
    return shapely.union_all(cores)


def covers(shape, points):
    """Which of the points (k, 2) the shape covers, by the definition of each part."""
    found = np.zeros(len(points), bool)
    for part in shape.parts:
        near = np.full(len(points), np.inf)
        odd = np.zeros(len(points), bool)
        for ring in part.rings:
            ends = np.roll(ring, -1, axis=0)
            for (ax, ay), (bx, by) in zip(ring, ends, strict=True):
                along = np.array([bx - ax, by - ay])
                share = (points - (ax, ay)) @ along / max(along @ along, 1e-300)
                foot = (ax, ay) + np.clip(share, 0.0, 1.0)[:, None] * along
                near = np.minimum(near, np.hypot(*(points - foot).T))
                across = (ay > points[:, 1]) != (by > points[:, 1])
                rise = by - ay if by != ay else 1.0
                left = points[:, 0] < ax + (points[:, 1] - ay) / rise * (bx - ax)
                odd ^= across & left & (len(ring) > 2)
        found |= odd | (near < part.radius)
    return found
