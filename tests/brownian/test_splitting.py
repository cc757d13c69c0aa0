"""Probabilities to touch before escaping, and stability ratios, against closed forms."""

import math

import attrs
import numpy as np
import pytest
from scipy.integrate import quad

from flocsim import Sphere, SpheroPolygon
from flocsim.body import Fluid
from flocsim.brownian import repulsion, splitting_probability, stability_ratio
from flocsim.constants import VACUUM_PERMITTIVITY
from flocsim.errors import UsageError
from flocsim.fields import quantity
from flocsim.forces import (
    DoubleLayer,
    Lubrication,
    OrientedForce,
    PairResistance,
    SurfaceForce,
    VanDerWaals,
)
from flocsim.geometry.contact.attraction import attraction_energy
from flocsim.geometry.contact.charges import layer_energy
from flocsim.geometry.shapes.pieces import outline_pieces
from tests.helpers.tiers import rest_slow

KT = 1.380649e-23 * 298.15
SMALL = (1e-7, 1e-7)


def colloid(gap="equivalent_spheres"):
    return [VanDerWaals(1e-20, 1e-9, gap), DoubleLayer(14e-3, 3.04e-9, gap=gap)]


@pytest.mark.parametrize(("release", "escape"), [(2.0, 4.0), (1.0, 4.0), (1.5, 20.0), (4.0, 4.0)])
def test_without_forces_it_is_a_logarithm_or_a_reciprocal(release, escape):
    radii = (0.5, 0.5)
    flat = splitting_probability([], radii, release, escape)
    assert flat == pytest.approx(math.log(escape / release) / math.log(escape), abs=1e-9)
    round_ = splitting_probability([], radii, release, escape, dimensions=3)
    assert round_ == pytest.approx((1 / release - 1 / escape) / (1.0 - 1 / escape), abs=1e-9)


@pytest.mark.parametrize("gap", ["equivalent_spheres", "surface"])
def test_a_colloid_of_100_nm(gap):
    found = splitting_probability(colloid(gap), SMALL, "300 nm", "600 nm")
    assert found == pytest.approx(0.7021, abs=5e-5)


def potential(h):
    """V/k_B T of that colloid by hand: attraction flat below 1 nm, repulsion exponential."""
    reduced, kappa = 0.5e-7, 1.0 / 3.04e-9
    strength = 4.0 * math.pi * 8.854e-12 * 78.5 * 14e-3**2
    pulled = 1e-20 * reduced / 6.0
    attraction = -pulled / h if h > 1e-9 else -pulled * (1e9 + (1e-9 - h) * 1e18)
    return (attraction + strength * reduced * math.exp(-kappa * h)) / KT


def test_it_is_the_integral_over_the_potential():
    def integral(begin, end):
        return quad(lambda h: math.exp(potential(h)) / (2e-7 + h), begin, end,
                    points=[min(1.0001e-9, end)] if begin < 1e-9 else None, epsrel=1e-10,
                    limit=500)[0]  # fmt: skip

    inner = integral(0.0, 2e-8) + integral(2e-8, 1e-7)
    outer = integral(1e-7, 4e-7)
    found = splitting_probability(colloid(), SMALL, 3e-7, 6e-7)
    assert found == pytest.approx(outer / (inner + outer), rel=2e-4)


def test_stability_ratio():
    assert stability_ratio([], SMALL) == pytest.approx(1.0, abs=1e-9)
    assert stability_ratio([VanDerWaals(1e-20)], SMALL) < 1.0
    barrier = [VanDerWaals(1e-20), DoubleLayer(40e-3, 3.04e-9)]
    assert stability_ratio(barrier, SMALL) > 1e3
    # Fuchs: R ∫ e^V/s² ds, by hand, for repulsion alone.
    alone = [DoubleLayer(14e-3, 3.04e-9)]
    strength = 4.0 * math.pi * 8.854e-12 * 78.5 * 14e-3**2 * 0.5e-7 / KT

    def slowed(h):
        return math.expm1(strength * math.exp(-h / 3.04e-9)) / (2e-7 + h) ** 2

    inner = quad(slowed, 0.0, 1e-7, epsrel=1e-10)[0]
    assert stability_ratio(alone, SMALL) == pytest.approx(1.0 + 2e-7 * inner, rel=1e-6)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"release": 1e-7}, "release must lie between"),
        ({"release": 7e-7}, "release must lie between"),
        ({"escape": math.inf}, "escape must be a length"),
        ({"temperature": 0.0}, "temperature must be above 0 K"),
        ({"dimensions": 4}, "dimensions must be 2 or 3"),
        ({"radii": (1e-7, -1e-7)}, "radii must be a length"),
    ],
)
def test_bad_input_is_refused(changed, words):
    given = {"forces": [], "radii": SMALL, "release": 3e-7, "escape": 6e-7} | changed
    with pytest.raises(UsageError, match=words):
        splitting_probability(**given)


def energies(shape, gaps, depth, potential=14e-3, debye_length=3.04e-9):
    """V [J] of two equal bodies of an outline, by the sums over outlines."""
    pieces = outline_pieces(shape.parts)
    strength = 2.0 * math.pi * 78.5 * VACUUM_PERMITTIVITY * potential**2
    kappa = 1.0 / debye_length
    reach = 2.0 * shape.bounding_radius
    return np.array([
        attraction_energy(pieces, pieces, (reach + h, 0.0, 0.0), 1e-20, depth)
        + strength * depth * layer_energy(shape, shape, (reach + h, 0.0, 0.0), kappa)
        for h in gaps
    ])  # fmt: skip


def regular(count, radius):
    """A polygon with so many rounded corners about a circle, one of them at either side."""
    angles = 2.0 * np.pi * np.arange(count) / count
    core = np.column_stack([np.cos(angles), np.sin(angles)])
    return SpheroPolygon(0.7 * radius * core, 0.3 * radius)


@pytest.mark.parametrize(
    ("radius", "layer", "least"),
    rest_slow(
        [
            (1e-7, (14e-3, 3.04e-9), 140.0),
            (1e-7, (10e-3, 9.6e-9), 17.0),
            (5e-8, (16e-3, 3.04e-9), 39.0),
            (3e-7, (7e-3, 9.6e-9), 1.4),
        ],
        lambda radius, layer, least: least == 140.0,
    ),
)
def test_w_of_forces_along_outlines_is_the_integral_over_their_energy(radius, layer, least):
    """Within a hundredth, though the bodies are no deeper than the gaps that count."""
    forces = [VanDerWaals(1e-20, 1e-9, law="outline"), DoubleLayer(*layer, law="outline")]
    found = stability_ratio(forces, (radius, radius))
    gaps, touch = np.geomspace(1e-9, 3.0 * radius, 120), 2.0 * radius
    potential = energies(Sphere(radius), gaps, 4.0 / 3.0 * radius, *layer) / KT
    inner = np.trapezoid(np.exp(potential) * gaps / (touch + gaps) ** 2, np.log(gaps))
    # Nearer than d_min the attraction grows no more; the barrier is at some nanometres.
    assert found == pytest.approx(touch * (inner + 1.0 / (5.0 * radius)), rel=0.01)
    assert found > least


@pytest.mark.parametrize("count", [1, pytest.param(512, marks=pytest.mark.slow)])
def test_forces_of_circles_are_the_slopes_of_their_energy(count):
    radius, gaps = SMALL[0], np.array([1e-9, 2e-9, 4e-9])
    forces = [VanDerWaals(1e-20, 1e-9, law="outline"), DoubleLayer(14e-3, 3.04e-9, law="outline")]
    found = repulsion(forces, SMALL, Fluid())(gaps)
    shape = Sphere(radius) if count == 1 else regular(count, radius)
    step = 1e-4 * gaps
    rise = energies(shape, gaps + step, 4.0 / 3.0 * radius) - energies(
        shape, gaps - step, 4.0 / 3.0 * radius
    )
    assert found == pytest.approx(-rise / (2.0 * step), rel=5e-3 if count == 1 else 0.02)


def test_what_asks_for_angles_has_no_stability_ratio():
    class Dipoles(OrientedForce):
        def kernel(view):
            return 0.0

    with pytest.raises(UsageError, match="depends on the angles of the bodies"):
        stability_ratio([Dipoles()], SMALL)


@attrs.frozen
class Hamaker(SurfaceForce):
    """The attraction of two spheres at any gap: Hamaker (1937), Physica 4, 1058."""

    hamaker: float = quantity("J", above=0.0)

    @property
    def reach(self):
        return math.inf

    @staticmethod
    def kernel(pair, hamaker):
        a, b, gap = pair.radius_i, pair.radius_j, max(pair.gap, 1e-13)
        s = gap + a + b
        p, q = gap * (s + a + b), (s - a + b) * (s + a - b)
        return -hamaker * s / 3.0 * (2.0 * a * b * (1.0 / p**2 + 1.0 / q**2) - 1.0 / p + 1.0 / q)


@pytest.mark.parametrize(
    ("energy", "alone", "in_water"),
    [(0.1, 1.013, 0.4058), (1.0, 1.059, 0.5250), (10, 1.199, 0.7251)],
)
def test_water_slows_down_coagulation(energy, alone, in_water):
    """By exact resistance functions of two equal spheres."""
    force = Hamaker(energy * KT)
    assert 1.0 / stability_ratio([force], (1e-6, 1e-6)) == pytest.approx(alone, abs=1e-3)
    found = stability_ratio([force, PairResistance(h_min=1e-13)], (1e-6, 1e-6))
    assert 1.0 / found == pytest.approx(in_water, abs=2e-4)


def test_lubrication_alone_is_refused():
    with pytest.raises(UsageError, match="give PairResistance in the place of Lubrication"):
        stability_ratio([Lubrication()], (1e-6, 1e-6))


@pytest.mark.parametrize("radius", [1e-7, 1e-6, 1e-5])
@pytest.mark.parametrize("d_min", [1e-9, 1e-12])
def test_attraction_counts_as_far_as_it_is_felt_at_room_temperature(radius, d_min):
    """Eq. 5 scales with the radius, whatever d_min; by direct quadrature."""
    force = VanDerWaals(hamaker=4.7e-20, d_min=d_min, gap="surface")
    assert stability_ratio([force], (radius, radius)) == pytest.approx(0.54808, abs=2e-5)
