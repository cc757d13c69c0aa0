"""Double layers as charges behind outlines, against published forms and the K₀ equation itself."""

import math

import numpy as np
import pytest
from scipy.special import iti0k0, k0, k1

from flocsim import Sphere, SpheroPolygon
from flocsim.errors import ShapeError
from flocsim.geometry.contact import charges
from flocsim.geometry.contact.charges import (
    bessel_pair,
    bessel_table,
    charges_of_shape,
    check_length,
    layer_energy,
)

SQUARE = np.array([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]])


def test_bessel_functions():
    table = bessel_table()
    for z in (0.01, 0.3, 1.0, 1.999, 2.001, 5.0, 12.999):
        assert bessel_pair(table, z * z) == pytest.approx((k0(z), k1(z) / z), rel=1e-9)


@pytest.mark.parametrize("radius", [0.2, 1.0, 5.0, 30.0])
@pytest.mark.parametrize("gap", [1e-3, 1.0, 5.0])
def test_cylinders(radius, gap):
    """E = 2πε φ² K₀(κD)/K₀(κR)², by the addition theorem."""
    found = layer_energy(Sphere(radius), Sphere(radius), (0.0, 2.0 * radius + gap, 1.0), 1.0)
    exact = k0(2.0 * radius + gap) / k0(radius) ** 2
    assert found == pytest.approx(exact, rel=2e-3)


def single_layer(shape, elements):
    """(middles (n, 2), lengths, σ/ε) of an outline at potential 1 and κ = 1: σ constant along each
    element, potentials in their middles."""
    points, _ = charges.points_of(charges.pieces_of_shape(shape), elements, 1)
    places, lengths = [], []
    ends = np.roll(points, -1, axis=0)
    # Pieces do not follow each other: an element joins two neighbours of a piece only.
    for a, b in zip(points, ends, strict=True):
        if math.hypot(*(b - a)) < 1.5 * charges.CHARGE_DEPTH / elements:
            places.append(0.5 * (a + b))
            lengths.append(math.hypot(*(b - a)))
    places, lengths = np.array(places), np.array(lengths)
    apart = charges.distances(places, places)
    np.fill_diagonal(apart, 1.0)
    matrix = k0(apart) * lengths / (2.0 * math.pi)
    np.fill_diagonal(matrix, iti0k0(0.5 * lengths)[1] / math.pi)
    return places, lengths, np.linalg.solve(matrix, np.ones(len(places)))


@pytest.mark.parametrize("radius", [0.5, 1.0, 3.0])
def test_the_single_layer_of_the_outline_has_the_same_energy(radius):
    """E = (1/2πε) ∮∮ σ₁ σ₂ K₀(κρ) ds ds, a rounded square before a cylinder."""
    square, disc = SpheroPolygon(SQUARE, radius), Sphere(1.5)
    pose = 2.0 + radius + 2.5, 1.0, 0.3
    total = 0.0
    one, other = single_layer(disc, 30.0), single_layer(square, 30.0)
    moved = one[0] + pose[:2]
    weights = (one[1] * one[2])[:, None] * (other[1] * other[2])[None]
    total = float(np.sum(weights * k0(charges.distances(moved, other[0])))) / (2.0 * math.pi)
    # In units of 2πε.
    assert layer_energy(disc, square, pose, 1.0) == pytest.approx(total / (2.0 * math.pi), rel=5e-3)


def test_what_is_inside_of_a_hole_is_not_seen():
    hole = 0.5 * SQUARE[::-1]
    ring, full = SpheroPolygon(2.0 * SQUARE, 0.5, holes=[hole]), SpheroPolygon(2.0 * SQUARE, 0.5)
    pose = 8.0, 1.0, 0.3
    found = [layer_energy(Sphere(2.0), each, pose, 1.0) for each in (ring, full)]
    assert found[0] == pytest.approx(found[1], rel=1e-4)


def test_potential_is_one_all_along_the_outline():
    shape = SpheroPolygon(SQUARE, 1.0)
    points, _ = charges.points_of(charges.pieces_of_shape(shape), 1.0, 7)
    found = charges_of_shape(shape, 1.0)
    potential = k0(charges.distances(points, found)) @ found[:, 2]
    np.testing.assert_allclose(potential, 1.0, atol=0.02)


def test_charges_behind_reflex_corners_do_not_grow_against_each_other():
    turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    away = 6.0 + 3.0 * np.cos(12.0 * turn)
    star = away[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    assert abs(charges_of_shape(SpheroPolygon(star, 1.0), 1.0)[:, 2]).max() < 2.0


def test_too_long_an_outline_is_refused():
    with pytest.raises(ShapeError, match=r"too long for a double layer of 1/κ = 0.0001 m"):
        check_length(SpheroPolygon(3e3 * SQUARE, 1e-4), 1e4)
