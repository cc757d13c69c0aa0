"""What water is at a temperature and with a salt in it, by published formulas for 0 to 40 °C and
one atmosphere.

Density: Millero and Poisson (1981), Deep-Sea Research 28A, 625 (the standard EOS-80), ± 0.004
kg/m³. Viscosity: Sharqawy, Lienhard and Zubair (2010), Desalination and Water Treatment 16, 354,
eqs. 22 and 23, ± 1.5 %. Permittivity: Malmberg and Maryott (1956), J. Res. Natl. Bur. Stand. 56, 1,
times what a salt leaves of it: Stogryn (1971), IEEE Trans. Microwave Theory Tech. 19, 733.
Ionic strength of sea water: Millero (1982), Ocean Sci. Eng. 7, 403.
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


def permittivity(temperature: float, normality: float = 0.0) -> float:
    """ε_r [-] at a temperature [K] with a salt of a normality [mol/m³], that of charges of one
    sign: of NaCl its concentration; up to 3 mol/l."""
    t, n = temperature - ZERO_CELSIUS, 1e-3 * normality
    fresh = polynomial(t, 87.740, -0.40008, 9.398e-4, -1.410e-6)
    return fresh * polynomial(n, 1.0, -0.2551, 5.151e-2, -6.889e-3)


def sea_normality(salinity: float) -> float:
    """The normality [mol/m³] of sea water of a salinity [g/kg] (Stogryn 1971)."""
    return 1e3 * salinity * polynomial(salinity, 1.707e-2, 1.205e-5, 4.058e-9)


def ionic_strength(temperature: float, salinity: float) -> float:
    """I [mol/m³] of sea water, or of sea water thinned by fresh, of a salinity [g/kg]."""
    of_water = 19.924 * salinity / (1000.0 - 1.005 * salinity)  # mol per kg of pure water
    return of_water * density(temperature, salinity) * (1.0 - 1e-3 * salinity)


def debye_length(temperature: float, ionic_strength: float, permittivity: float) -> float:
    """1/κ = √(ε0 ε_r k_B T/(2 e² N_A I)) [m] at an ionic strength I [mol/m³] above 0."""
    ions = 2.0 * ELEMENTARY_CHARGE**2 * AVOGADRO * ionic_strength
    return math.sqrt(VACUUM_PERMITTIVITY * permittivity * BOLTZMANN * temperature / ions)
