"""Curvilinear factors of solid spheres: what the water between two of them leaves of a kernel.

A factor multiplies a rectilinear kernel, as π (r_i + r_j)² |w_i − w_j| in settling. It is about
ways: how many of the pairs that would meet along undisturbed ways still do. An efficiency (alpha)
is about touching: how many of those that meet aggregate. With p = r_small/r_large, 0 < p ≤ 1:

- settling, both names: ½ (p/(1 + p))², that is ½ π r_small² |w_i − w_j| of the kernel. As p → 0 a
  point carried by Stokes's flow is caught from 3/2 p² of the area; a sphere of the same density
  settles by itself, p² of the larger one's speed, which leaves ½ p².
- shear, "hill": 9.8/1.3 (p/(1 + 2p))², a fit; the models' rectilinear kernel is 1.3 γ (r_i + r_j)³.
- shear, "burd": 1 − (1 + 5p + 2.5p²)/(1 + p)⁵, exactly what reaches a distance r_i + r_j of a
  straining flow around a free sphere (G. K. Batchelor, *An Introduction to Fluid Dynamics* 1967,
  section 4.11), for points that follow the water.

As in public codes, read at these commits:

- "hill": SLAMS-OIL (github.com/tinnsi/SLAMS-OIL, physics4.F90, 120346f), which names P. S. Hill
  (1992); CSIRO's EMS (github.com/csiro-coasts/EMS, model/lib/ecology/ecofunct.c, ab086c5), which
  names G. A. Jackson (1995).
- "burd": A. Burd's model (github.com/BurdLab/MatlabCoagThorium, CalcBetas.m, 1d0df1e), after that
  of G. A. Jackson.
- settling: all of these, and ESCOMP/CARMA (source/base/setupckern.F90, 11868d2), as Fuchs's.

SLAMS 1.0 has 1 + 2p² for (1 + 2p)², which would be 2.5 times the rectilinear kernel at p = 1.

These know neither attraction nor how water is squeezed out of a gap; what does, for a study's own
spheres and forces, is "spheres" (flocsim.hydrodynamics, computed by whoever has the config).
"""

from collections.abc import Callable

import attrs
import numpy as np
from numpy.typing import ArrayLike

from flocsim.errors import UsageError


def settling_factor(p: np.ndarray) -> np.ndarray:
    """½ (p/(1 + p))²."""
    return 0.5 * (p / (1.0 + p)) ** 2


def fitted_shear_factor(p: np.ndarray) -> np.ndarray:
    """9.8/1.3 (p/(1 + 2p))²."""
    return 9.8 / 1.3 * (p / (1.0 + 2.0 * p)) ** 2


def strain_factor(p: np.ndarray) -> np.ndarray:
    """1 − (1 + 5p + 2.5p²)/(1 + p)⁵, as p² (7.5 + 10p + 5p² + p³)/(1 + p)⁵, which rounds less."""
    return p**2 * (7.5 + p * (10.0 + p * (5.0 + p))) / (1.0 + p) ** 5


SETTLING = (settling_factor, "1/2 (p/(1 + p))^2")


@attrs.frozen
class Correction:
    """Factors of one name: ``mechanisms`` {mechanism: (function of p, formula)}; ``source``."""

    mechanisms: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]]
    source: str


CORRECTIONS = {
    "hill": Correction(
        {"settling": SETTLING, "shear": (fitted_shear_factor, "9.8/1.3 (p/(1 + 2p))^2")},
        "after P. S. Hill (1992) and G. A. Jackson (1995), as in the codes SLAMS-OIL and CSIRO EMS",
    ),
    "burd": Correction(
        {
            "settling": SETTLING,
            "shear": (strain_factor, "1 - (1 + 5p + 2.5p^2)/(1 + p)^5"),
        },
        "as in A. Burd's coagulation model (2009, BurdLab/MatlabCoagThorium)",
    ),
}
"""{name: Correction}."""

SPHERES = "spheres"
"""The name of what two spheres in water do, which no formula says."""

ABOUT_SPHERES = [
    "curvilinear factor 'spheres': how often equivalent spheres touch with hydrodynamic "
    "interaction, over how often they do without; resistance functions of Jeffrey and "
    "Onishi (1984) and Jeffrey (1992), the study's own forces, no inertia",
    "it is for solid spheres: how it changes for shapes and permeable flocs is not known",
]
"""Lines for whoever gets numbers with that factor in them."""


def formula(name: str, mechanism: str) -> tuple[Callable[[np.ndarray], np.ndarray], str]:
    """(function of p, how it is written); UsageError for a name or a mechanism that has none."""
    if name not in CORRECTIONS:
        raise UsageError(
            f"the curvilinear factor must be one of {', '.join(CORRECTIONS)}, found {name}"
        )
    known = CORRECTIONS[name].mechanisms
    if mechanism not in known:
        raise UsageError(
            f"{name} has no curvilinear factor for {mechanism}: choose one of {', '.join(known)}, "
            "or leave it out and keep the upper bound"
        )
    return known[mechanism]


def curvilinear_factor(name: str, mechanism: str, r_i: ArrayLike, r_j: ArrayLike) -> np.ndarray:
    """What the rectilinear kernel of two solid spheres is multiplied by for the water between them.

    ``name``: "hill" or "burd"; ``mechanism``: "settling" or "shear"; ``r_i``, ``r_j``: radii [m],
    numbers or arrays that broadcast. With p = r_small/r_large the factor, from 0 to 1, is

    - settling: ½ (p/(1 + p))²;
    - shear: 9.8/1.3 (p/(1 + 2p))² (hill), 1 − (1 + 5p + 2.5p²)/(1 + p)⁵ (burd);

    symmetric in i and j; it rises with p. Sources: SLAMS-OIL and CSIRO EMS (hill), BurdLab's
    MatlabCoagThorium (burd); the head of this file has paths and commits. No forces, no inertia, no
    porosity: of flocs, through which water passes, it is not known. It is no efficiency: kernel ×
    factor × alpha is common practice, and approximate. UsageError for other names, mechanisms
    without a formula, and radii that are not above 0.

    >>> float(curvilinear_factor("hill", "settling", 5e-6, 5e-6))
    0.125
    """
    factor, _ = formula(name, mechanism)
    first, second = np.asarray(r_i, dtype=float), np.asarray(r_j, dtype=float)
    for radii in (first, second):
        if not np.all((radii > 0.0) & np.isfinite(radii)):
            raise UsageError("radii of a curvilinear factor must be above 0 and finite, in metres")
    return factor(np.minimum(first, second) / np.maximum(first, second))


def about_factor(name: str, mechanism: str) -> list[str]:
    """Lines for whoever gets numbers with the factor in them."""
    _, written = formula(name, mechanism)
    return [
        f"curvilinear factor '{name}' in {mechanism}: {written}, p = r_small/r_large; "
        f"{CORRECTIONS[name].source}",
        "it is for solid spheres and multiplies the rectilinear kernel; for flocs, which are "
        "permeable, it is not known",
        "multiplying efficiency and factor is common practice but approximate: neither was "
        "computed with the other",
    ]
