"""Where the pieces of a swept outline (offsets of edges, arcs around vertices) cross each other."""

import numpy as np

from flocsim.geometry.cores import cross, unit_edges


def beside(along, lengths):
    """Which distances along an edge lie on the edge, with a rounding's margin."""
    return (along > -1e-9 * lengths) & (along < lengths * (1.0 + 1e-9))


def circle_cuts(origins, directions, vertices, radius):
    """Where lines (rows) cross the circles around the vertices: row numbers and places."""
    to_centre = vertices[None] - origins[:, None]
    along = np.einsum("pkj,pj->pk", to_centre, directions)
    half = radius**2 - (np.einsum("pkj,pkj->pk", to_centre, to_centre) - along**2)
    rows, columns = np.nonzero(half > 0.0)
    root = np.sqrt(half[rows, columns])
    middle = along[rows, columns]
    return np.tile(rows, 2), np.concatenate([middle - root, middle + root])


def offset_cuts(origins, directions, vertices, radius):
    """Where lines (rows) cross the offsets of the edges, on both sides: row numbers and places."""
    starts, units, lengths = unit_edges(vertices)
    slope = cross(directions[:, None], units[None])
    rows, edges = np.nonzero(np.abs(slope) > 1e-12)
    offset = cross(starts[edges] - origins[rows], units[edges])
    found = []
    for side in (-radius, radius):
        place = (offset + side) / slope[rows, edges]
        met = origins[rows] + place[:, None] * directions[rows] - starts[edges]
        on_edge = beside(np.einsum("ij,ij->i", met, units[edges]), lengths[edges])
        found.append((rows[on_edge], place[on_edge]))
    return joined(*found)


def arc_circle_cuts(vertices, radius):
    """Where the circles around vertices (rows) cross each other: row numbers and angles."""
    to_centre = vertices[None] - vertices[:, None]
    distance = np.hypot(to_centre[..., 0], to_centre[..., 1])
    rows, columns = np.nonzero((distance > 0.0) & (distance < 2.0 * radius))
    across = to_centre[rows, columns]
    bearing = np.arctan2(across[:, 1], across[:, 0])
    half = np.arccos(distance[rows, columns] / (2.0 * radius))
    return np.tile(rows, 2), np.concatenate([bearing - half, bearing + half])


def arc_offset_cuts(vertices, radius):
    """Where the circles around vertices (rows) cross the offsets of edges: rows and angles."""
    starts, units, lengths = unit_edges(vertices)
    normals = np.column_stack([units[:, 1], -units[:, 0]])
    facing = np.arctan2(normals[:, 1], normals[:, 0])
    level = np.einsum("pej,ej->pe", starts[None] - vertices[:, None], normals)
    found = []
    for side in (-radius, radius):
        cosine = (level + side) / radius
        rows, edges = np.nonzero((np.abs(cosine) < 1.0) & (np.abs(level) >= 1e-9 * radius))
        opening = np.arccos(cosine[rows, edges])
        for angle in (facing[edges] - opening, facing[edges] + opening):
            met = vertices[rows] - starts[edges]
            met = met + radius * np.column_stack([np.cos(angle), np.sin(angle)])
            on_edge = beside(np.einsum("ij,ij->i", met, units[edges]), lengths[edges])
            found.append((rows[on_edge], angle[on_edge]))
    return joined(*found)


def joined(*parts):
    """Tuples of arrays, put together part by part."""
    return tuple(np.concatenate(same) for same in zip(*parts, strict=True))


def pieces(rows, cuts, lasts):
    """Intervals that cover [0, last] of every row, cut at the given places.

    Returns row numbers, starts and ends, in order.
    """
    count = len(lasts)
    rows = np.concatenate([rows, np.arange(count), np.arange(count)])
    cuts = np.concatenate([cuts, np.zeros(count), lasts])
    within = (cuts >= 0.0) & (cuts <= lasts[rows])
    rows, cuts = rows[within], cuts[within]
    order = np.lexsort((cuts, rows))
    rows, cuts = rows[order], cuts[order]
    whole = (rows[1:] == rows[:-1]) & (cuts[1:] > cuts[:-1])
    return rows[:-1][whole], cuts[:-1][whole], cuts[1:][whole]
