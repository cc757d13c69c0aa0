"""What an outline comes to at a point, against its integral by panels."""

import math

import numpy as np
import pytest

import flocsim.arrays as at
from flocsim.geometry.contact.attraction import NO_ATTRACTION, add_arc, add_segment, find_plates
from flocsim.geometry.shapes.pieces import (
    arc_rows,
    at_parameter,
    distance_to,
    piece_at,
    segment_rows,
)

NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)
RADIUS, LENS = 1e-6, 8e-7


def segment():
    rows = segment_rows(np.zeros((1, 2)), np.array([[0.6, 0.8]]), np.zeros(1), np.ones(1), RADIUS)
    rows[:, [at.SIZE, at.EXTENT]] *= RADIUS
    rows[:, [at.PLACE_X, at.PLACE_Y, at.MIDDLE_X, at.MIDDLE_Y]] *= RADIUS
    return piece_at(rows, 0)


def arc(turn=1.2):
    return piece_at(
        arc_rows(np.zeros((1, 2)), np.array([RADIUS]), np.zeros(1), np.full(1, turn)), 0
    )


def summed(x, y, piece, inset, lens):
    """S by panels, of what lies within the lens."""
    bend = max(piece.bend - inset, 0.5 * piece.bend)
    moved = piece._replace(bend=bend)
    if piece.bend == 0.0:
        moved = piece._replace(x=piece.x - inset * piece.way_y, y=piece.y + inset * piece.way_x)
    ends = np.linspace(-piece.size, piece.size, 4001)
    half = 0.5 * np.diff(ends)[:, None]
    px, py, nx, ny, metres = at_parameter(moved, ends[:-1, None] + half * (1.0 + NODES))
    dx, dy = px - x, py - y
    squared = dx * dx + dy * dy
    share = np.where(squared < lens * lens, (nx * dx + ny * dy) / squared**2.5, 0.0)
    return float(np.sum(half * WEIGHTS * metres * share))


def seen(add, piece, places, inset, lens):
    """(gaps, S) from some places."""
    nodes = np.zeros((at.NODE_ROWS, at.MOST_NODES))
    nodes[at.NODE_GAP] = math.inf
    nodes[[at.NODE_X, at.NODE_Y], : len(places)] = places.T
    add(nodes, len(places), piece, inset, lens)
    return nodes[at.NODE_GAP, : len(places)], nodes[at.NODE_SUM, : len(places)]


PLACES = [(away, beside) for away in (3e-9, 4e-8, 3e-7, 1.5e-6) for beside in (0.0, 0.4, 0.97, 1.3)]
"""How far from the outline [m], and how far beside the middle of a piece, over half of it."""


@pytest.mark.parametrize("lens", [1.0, LENS])
@pytest.mark.parametrize("inset", [0.0, 2e-8])
@pytest.mark.parametrize("add", [add_segment, add_arc])
def test_what_a_piece_comes_to_is_its_integral(add, inset, lens):
    """To 1e-5 of what a plane as near would come to: that much eight nodes leave of an arc that
    turns away; an edge of the lens is seen to a panel."""
    piece = segment() if add is add_segment else arc()
    places = []
    for away, beside in PLACES:
        x, y, nx, ny, _ = at_parameter(piece, min(beside, 1.0) * piece.size)
        past = max(beside - 1.0, 0.0) * RADIUS
        places.append((x + away * nx - past * ny, y + away * ny + past * nx))
    gaps, found = seen(add, piece, np.array(places), inset, lens)
    for (x, y), gap, each in zip(places, gaps, found, strict=True):
        assert gap == pytest.approx(distance_to(x, y, piece), abs=1e-16)
        plane = 4.0 / (3.0 * (gap + inset) ** 3)
        allowed = 1e-5 if lens == 1.0 else 2e-3
        assert each == pytest.approx(summed(x, y, piece, inset, lens), abs=allowed * plane)


def test_a_line_that_leads_to_a_point_comes_to_nothing():
    piece = segment()
    ahead = np.array([[piece.x + way * piece.way_x, piece.y + way * piece.way_y]
                      for way in (0.6e-6, 1e-6, 3e-6)])  # fmt: skip
    _, found = seen(add_segment, piece, ahead, 0.0, 1.0)
    assert np.all(abs(found) < 1e-6 / 1e-21)


def test_plates_that_attract_as_strongly():
    """Also where next to nothing does, or it pushes."""
    gaps = np.array([1e-9, 1e-9, 3e-8, 1e-7, 1e-9, 1e-9])
    shares = np.array([1.0, 0.3, 0.05, 1e-6, 0.0, -0.5])
    nodes = np.zeros((at.NODE_ROWS, at.MOST_NODES))
    nodes[at.NODE_GAP, :6], nodes[at.NODE_SUM, :6] = gaps, -4.0 * shares / (3.0 * gaps**3)
    find_plates(nodes, 6, 0.0, 1.0)
    wanted = np.append(gaps[:4] * shares[:4] ** (-1.0 / 3.0), [NO_ATTRACTION] * 2)
    np.testing.assert_allclose(nodes[at.NODE_PLATES, :6], wanted, rtol=1e-12)
