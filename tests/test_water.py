"""What water is at a temperature and with a salt in it, against published values."""

import math

import pytest

from flocsim import Fluid, water
from flocsim.errors import RangeError, UsageError

ZERO = 273.15


@pytest.mark.parametrize(
    ("celsius", "salinity", "value"),
    # UNESCO technical papers in marine science 44 (1983), p. 19.
    [(5, 0, 999.96675), (5, 35, 1027.67547), (25, 0, 997.04796), (25, 35, 1023.34306)],
)
def test_density_of_the_standard(celsius, salinity, value):
    assert water.density(ZERO + celsius, salinity) == pytest.approx(value, abs=1e-5)


@pytest.mark.parametrize(
    # Huber et al. (2009), J. Phys. Chem. Ref. Data 38, 101.
    ("celsius", "value"), [(0.01, 1.7917e-3), (10, 1.3059e-3), (25, 8.900e-4), (40, 6.527e-4)]
)  # fmt: skip
def test_viscosity_of_fresh_water(celsius, value):
    assert water.viscosity(ZERO + celsius) == pytest.approx(value, rel=2e-3)


def test_viscosity_of_sea_water():
    """1.08 of that of fresh water at 20 °C and 35 g/kg: Millero (1974), The Sea 5, 3."""
    assert water.viscosity(ZERO + 20, 35) / water.viscosity(ZERO + 20) == pytest.approx(
        1.08, rel=5e-3
    )


def test_permittivity_of_fresh_and_salt_water():
    assert water.permittivity(ZERO + 25) == pytest.approx(78.30, abs=0.01)
    assert water.permittivity(ZERO) == pytest.approx(87.74, abs=0.01)
    # Klein and Swift (1977): 72.47; Meissner and Wentz (2004): 71.80.
    assert water.permittivity(ZERO + 20, 35) == pytest.approx(71.8, abs=0.15)


@pytest.mark.parametrize("molar", [0.1, 0.3, 0.617, 1.0])
def test_permittivity_of_sodium_chloride(molar):
    """78.36 − 15.45 c + 3.76 c^1.5 at 25 °C: Buchner et al. (1999), J. Phys. Chem. A 103, 1."""
    found = Fluid(ionic_strength=1e3 * molar).permittivity
    assert found == pytest.approx(78.36 - 15.45 * molar + 3.76 * molar**1.5, rel=0.015)


def test_ions_of_the_ocean():
    """.7226 mol per kg of water at 35 g/kg: Millero (1982)."""
    per_litre = water.ionic_strength(ZERO + 25, 35)
    assert per_litre / water.density(ZERO + 25, 35) / 0.965 == pytest.approx(0.7226, rel=1e-3)
    assert water.sea_salinity(ZERO + 25, per_litre) == pytest.approx(35, rel=0.03)


def test_debye_length_of_a_thin_salt():
    """.304 nm/√(mol/l) at 25 °C: Israelachvili (2011), ch. 14."""
    assert Fluid(ionic_strength="1 mmol/l").debye_length == pytest.approx(9.61e-9, rel=2e-3)
    thin = [Fluid(ionic_strength=c).debye_length for c in (1e-3, 4e-3)]
    assert thin[0] / thin[1] == pytest.approx(2.0, rel=1e-4)


def test_a_fluid_of_which_nothing_is_said_is_as_before():
    fluid = Fluid()
    assert (fluid.viscosity, fluid.density, fluid.permittivity) == (8.9e-4, 997.0, 78.5)
    assert fluid.debye_length is None
    assert fluid.words == ""


def test_salt_alone_is_at_room_temperature():
    assert Fluid(salinity=35.0).density == pytest.approx(1023.343, abs=1e-3)
    assert Fluid(salinity=0.0).debye_length is None


def test_words_of_water():
    words = Fluid(temperature="15 °C", salinity=35.0).words
    assert words.startswith("water of 15 °C and 35 g/kg of salt: viscosity 1.22 mPa s")
    assert words.endswith("Debye length 0.341 nm")
    assert "ionic strength of 0.001 mol/l" in Fluid(ionic_strength="1 mmol/l").words


@pytest.mark.parametrize(
    ("given", "pattern"),
    [
        ({"temperature": 15.0}, "temperature must be .* at least 273.15"),
        ({"temperature": "59 degF"}, "give kelvins, or degC"),
        ({"salinity": "300 g/kg"}, "salinity must be .* at most 42"),
        ({"salinity": math.nan}, "salinity must be a finite number"),
        ({"ionic_strength": 0.0}, "ionic_strength must be .* above 0"),
        ({"salinity": 35.0, "ionic_strength": 1.0}, "remove one of them"),
    ],
)
def test_what_is_no_water_is_refused_in_one_line(given, pattern):
    with pytest.raises((UsageError, RangeError), match=pattern) as caught:
        Fluid(**given)
    assert "\n" not in str(caught.value)
