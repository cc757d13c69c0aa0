"""Bodies and the fluid: what they weigh, and what they refuse."""

import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, SpheroPolygon
from flocsim.errors import UsageError

BALL = Sphere(5e-6)
SQUARE = SpheroPolygon(np.array([[0, 0], [8, 0], [8, 8], [0, 8]]) * 1e-6, 1e-6)


@pytest.mark.parametrize("shape", [BALL, SQUARE])
def test_mass_conventions(shape):
    sheet = Body(shape, surface_density=2.0)
    plate = Body(shape, density=2650.0, depth=3e-6)
    solid = Body(shape, density=2650.0)
    assert sheet.mass == pytest.approx(2.0 * shape.area, rel=1e-15)
    assert plate.mass == pytest.approx(2650.0 * 3e-6 * shape.area, rel=1e-15)
    assert solid.mass == pytest.approx(
        2650.0 * 4 / 3 * np.pi * shape.equivalent_radius**3, rel=1e-14
    )
    for body in (sheet, plate, solid):
        ratio = shape.second_moment / shape.area
        assert body.inertia / body.mass == pytest.approx(ratio, rel=1e-14)


def test_buoyancy_takes_off_the_displaced_fluid():
    body = Body(BALL, density=2650.0)
    assert body.buoyant_mass(Fluid(density=997.0)) == body.mass
    wet = body.buoyant_mass(Fluid(density=997.0, buoyancy=True))
    assert wet == pytest.approx(body.mass * (1 - 997.0 / 2650.0), rel=1e-15)
    assert Body(BALL, density=900.0).buoyant_mass(Fluid(buoyancy=True)) < 0.0
    with pytest.raises(UsageError, match=r"buoyancy needs the density of the bodies"):
        Body(BALL, surface_density=2.0).buoyant_mass(Fluid(buoyancy=True))


WRONG_BODIES = {
    "no mass": ({}, "one of surface_density .* and density .*, found neither"),
    "two masses": ({"surface_density": 2.0, "density": 2650.0}, "found both"),
    "no surface density": ({"surface_density": 0.0}, "surface_density must be .* above 0"),
    "a density of nan": ({"density": float("nan")}, "density must be"),
    "a density of another kind": ({"density": "2650 kg/m^2"}, "density must be a density such as"),
    "a depth in words": ({"density": 2650.0, "depth": "disk"}, "depth must be"),
    "a negative depth": ({"density": 2650.0, "depth": -1e-6}, "depth must be"),
    "a place in space": ({"density": 1.0, "position": (0, 0, 0)}, "position must be 2 finite"),
    "a place of nan": ({"density": 1.0, "position": (0, float("nan"))}, "position must be 2"),
    "one number": ({"density": 1.0, "velocity": 3.0}, "velocity must be 2 finite"),
    "an infinite angle": ({"density": 1.0, "angle": float("inf")}, "angle must be a finite"),
    "a spin of nan": ({"density": 1.0, "spin": float("nan")}, "spin must be a finite"),
    "a number for a flag": ({"density": 1.0, "fixed": 1}, "fixed must be true or false"),
}


@pytest.mark.parametrize("case", WRONG_BODIES)
def test_what_is_no_body_is_refused_in_one_line(case):
    given, pattern = WRONG_BODIES[case]
    with pytest.raises((UsageError, ValueError), match=pattern) as caught:
        Body(BALL, **given)
    assert "\n" not in str(caught.value)


def test_a_shape_must_be_a_shape():
    with pytest.raises(UsageError, match=r"Sphere, a SpheroPolygon, or .*, found 'ball'"):
        Body("ball", density=1.0)


@pytest.mark.parametrize(
    "given",
    [
        {"viscosity": 0.0}, {"viscosity": float("nan")}, {"density": -1.0}, {"buoyancy": "yes"},
        {"velocity": (1.0,)}, {"gradient": (1.0, 2.0)}, {"gradient": "shear"},
    ],
)  # fmt: skip
def test_what_is_no_fluid_is_refused(given):
    with pytest.raises((UsageError, ValueError), match=f"{next(iter(given))} must be"):
        Fluid(**given)
