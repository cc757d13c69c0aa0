"""What water is at a temperature and with a salt in it, by published formulas for 0 to 40 °C and
one atmosphere.

Density: Millero and Poisson (1981), Deep-Sea Research 28A, 625 (the standard EOS-80), ± 0.004
kg/m³. Viscosity: Sharqawy, Lienhard and Zubair (2010), Desalination and Water Treatment 16, 354,
eqs. 22 and 23, ± 1.5 %. Permittivity of pure water: Malmberg and Maryott (1956), J. Res. Natl. Bur.
Stand. 56, 1; reduced by salt as in sea water: Meissner and Wentz (2004), IEEE Trans. Geosci. Remote
Sens. 42, 1836, ± 1 % up to 40 g/kg. Ionic strength of sea water: Millero (1982), Ocean Sci. Eng. 7,
403.
"""

import math

from numpy.polynomial.polynomial import polyval

from flocsim.constants import AVOGADRO, BOLTZMANN, ELEMENTARY_CHARGE, VACUUM_PERMITTIVITY

ZERO_CELSIUS = 273.15
"""0 °C [K]."""


def polynomial(t: float, *coefficients: float) -> float:
    """c₀ + c₁ t + c₂ t² + …"""
    return float(polyval(t, coefficients))


def density(temperature: float, salinity: float = 0.0) -> float:
    """ρ [kg/m³] at a temperature [K] and a salinity [g/kg]: 1023.343 at 25 °C and 35 g/kg."""
    t, s = temperature - ZERO_CELSIUS, salinity
    fresh = polynomial(
        t, 999.842594, 6.793952e-2, -9.095290e-3, 1.001685e-4, -1.120083e-6, 6.536332e-9
    )
    linear = polynomial(t, 8.24493e-1, -4.0899e-3, 7.6438e-5, -8.2467e-7, 5.3875e-9)
    root = polynomial(t, -5.72466e-3, 1.0227e-4, -1.6546e-6)
    return fresh + linear * s + root * s**1.5 + 4.8314e-4 * s * s


def viscosity(temperature: float, salinity: float = 0.0) -> float:
    """γ [Pa s] at a temperature [K] and a salinity [g/kg]."""
    t, s = temperature - ZERO_CELSIUS, 1e-3 * salinity
    fresh = 4.2844e-5 + 1.0 / (0.157 * (t + 64.993) ** 2 - 91.296)
    linear = polynomial(t, 1.541, 1.998e-2, -9.52e-5)
    square = polynomial(t, 7.974, -7.561e-2, 4.724e-4)
    return fresh * (1.0 + linear * s + square * s * s)


def permittivity(temperature: float, salinity: float = 0.0) -> float:
    """Return ε_r [-] at a temperature [K] and a salinity [g/kg]: 71.8 at 20 °C and 35 g/kg.

    Klein and Swift (1977), IEEE Trans. Antennas Propag. 25, 104, give 72.5 there; NaCl of the same
    ionic strength has 71 to 72 (Nörtemann et al. 1997, J. Phys. Chem. A 101, 6864; Buchner et al.
    1999, J. Phys. Chem. A 103, 1).
    """
    t, s = temperature - ZERO_CELSIUS, salinity
    fresh = polynomial(t, 87.740, -0.40008, 9.398e-4, -1.410e-6)
    return fresh * math.exp(s * (-3.56417e-3 + 4.74868e-6 * s + 1.15574e-5 * t))


def sea_salinity(temperature: float, ionic_strength: float) -> float:
    """Return the salinity [g/kg] of the sea water of an ionic strength [mol/m³]; ± 3 %."""
    return ionic_strength / (19.924e-3 * density(temperature))


def ionic_strength(temperature: float, salinity: float) -> float:
    """I [mol/m³] of sea water, or of sea water thinned by fresh, of a salinity [g/kg]."""
    of_water = 19.924 * salinity / (1000.0 - 1.005 * salinity)  # mol per kg of pure water
    return of_water * density(temperature, salinity) * (1.0 - 1e-3 * salinity)


def debye_length(temperature: float, ionic_strength: float, permittivity: float) -> float:
    """1/κ = √(ε0 ε_r k_B T/(2 e² N_A I)) [m] at an ionic strength I [mol/m³] above 0."""
    ions = 2.0 * ELEMENTARY_CHARGE**2 * AVOGADRO * ionic_strength
    return math.sqrt(VACUUM_PERMITTIVITY * permittivity * BOLTZMANN * temperature / ions)
