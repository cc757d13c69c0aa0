"""Rates of a kernel study as square matrices for population balances.

An efficiency is that of a kernel: what it multiplies is named in every matrix. REFERENCES are the
kernels of two models:

- "spheres": settling π (r_i + r_j)² |w_i − w_j|, shear 4/3 G (r_i + r_j)³, extension
  8/3 s (r_i + r_j)³: rectilinear, of the equivalent spheres, at the speeds of the study;
- "flocmod": as FLOCMOD has them (Verney et al. 2011, Cont. Shelf Res. 31, S64; its code in MARS,
  ROMS/COAWST and fm_flocmod): in shear the same, 1/6 G (D_i + D_j)³; in settling
  π/4 (D_i + D_j)² g/µ |Δρ_i D_i² − Δρ_j D_j²|, which lacks the 1/18 of Stokes's law and so is 18
  times the rectilinear one: what it is multiplied by is 1/18 of the above.

All of these are rectilinear. On request an efficiency is handed over times the curvilinear factor
of solid spheres, and the matrix says so: what the water between two of them leaves of a kernel such
as π (r_i + r_j)² |w_i − w_j|. The factor is about ways: how many of the pairs that would meet along
undisturbed ways still do. An efficiency is about touching: how many of those that meet aggregate.
With p = r_small/r_large, 0 < p ≤ 1:

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

import csv
import io
import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from flocsim.errors import UsageError
from flocsim.io.results.kernel_group import ESTIMATES, KERNEL, Kernel

REFERENCES = {
    "settling": {
        "spheres": (1.0, "pi (r_i + r_j)^2 |w_i - w_j|, rectilinear, of the equivalent spheres"),
        "flocmod": (
            1.0 / 18.0,
            "FLOCMOD's pi/4 (D_i + D_j)^2 g/mu |drho_i D_i^2 - drho_j D_j^2|, which lacks "
            "Stokes's 1/18 (with the drho D^2 of these bodies)",
        ),
    },
    "shear": {
        "spheres": (1.0, "4/3 G (r_i + r_j)^3, rectilinear, of the equivalent spheres"),
        "flocmod": (1.0, "FLOCMOD's 1/6 G (D_i + D_j)^3"),
    },
    "extension": {
        "spheres": (1.0, "8/3 s (r_i + r_j)^3, rectilinear, of the equivalent spheres"),
    },
}
"""{mechanism: {model: (factor on the efficiency over the rectilinear kernel, words)}}."""

MODELS = ("spheres", "flocmod")
OF_MODELS = {f"efficiency{end}": f"efficiency3{end}" for end in ("", "_low", "_high")}
"""What multiplies a model's kernel in three dimensions: what of KERNEL it follows from."""
QUANTITIES = (
    *OF_MODELS, *(name + end for name in ESTIMATES for end in ("", "_low", "_high")), "undecided",
)  # fmt: skip
"""What a matrix can hold: also ends of 95 % intervals, and the share that is undecided."""

Factor = tuple[Callable[[np.ndarray], np.ndarray], str]

SOURCES = {
    "hill": "after P. S. Hill (1992) and G. A. Jackson (1995), as in the codes SLAMS-OIL and CSIRO "
    "EMS",
    "burd": "as in A. Burd's coagulation model (2009, BurdLab/MatlabCoagThorium)",
}

SPHERES = "spheres"
"""The name of what two spheres in water do, which no formula says."""

ABOUT_SPHERES = [
    "curvilinear factor 'spheres': how often equivalent spheres touch with hydrodynamic "
    "interaction, over how often they do without; resistance functions of Jeffrey and "
    "Onishi (1984) and Jeffrey (1992), the study's own forces, no inertia",
    "it is for solid spheres: how it changes for shapes and permeable flocs is not known",
]
"""Lines for whoever gets numbers with that factor in them."""


def efficiency_for(
    kernel: Kernel, mechanism: str, vertices: int, model: str, quantity: str = "efficiency"
) -> np.ndarray:
    """Return what a model's kernel of a mechanism is to be multiplied by (i, j), or an end of its
    interval; UsageError for a model that has none. 0 for bodies of one size that do not meet."""
    known = REFERENCES.get(mechanism, {})
    if model not in known:
        raise UsageError(
            f"{model} has no kernel for {mechanism}: choose one of {', '.join(known)}, or another "
            "mechanism"
        )
    m, v = kernel.mechanisms.index(mechanism), kernel.vertices.tolist().index(vertices)
    values = kernel.arrays[OF_MODELS[quantity]][m, v] * known[model][0]
    return np.where(kernel.arrays["beta3_reference"][m, v] == 0.0, 0.0, values)


def kernel_matrix(
    kernel: Kernel, mechanism: str, vertices: int, quantity: str = "efficiency",
    model: str = "spheres", curvilinear: str | None = None, factors: np.ndarray | None = None,
) -> str:  # fmt: skip
    """Return a square matrix as CSV, radii [m] in its first row and column.

    Lines that start with # come first and say what it holds and what it multiplies.
    ``curvilinear``: the name of a factor that efficiencies are multiplied by, element by element;
    ``factors`` (i, j): those of "spheres".
    """
    m, v = kernel.mechanisms.index(mechanism), kernel.vertices.tolist().index(vertices)
    if curvilinear is not None and kernel.water:
        raise UsageError(
            "the study already includes the water between the bodies ([forces.hydrodynamics]): a "
            "curvilinear factor would count it twice; leave it out"
        )
    if curvilinear is not None and quantity not in OF_MODELS:
        raise UsageError(
            f"a curvilinear factor multiplies the kernels of spheres, not {quantity}: use "
            "efficiency, or leave it out"
        )
    bound = ["without hydrodynamic interaction: an upper bound"]
    if kernel.water:
        bound = ["with hydrodynamic interaction, of the outlines in the plane"]
    if quantity in OF_MODELS:
        values = efficiency_for(kernel, mechanism, vertices, model, quantity)
        title = quantity.replace("_low", ", lower 95 % bound,")
        title = title.replace("_high", ", upper 95 % bound,")
        if curvilinear is not None:
            title += " times curvilinear factor"
            if factors is None:
                rows = kernel.radii[:, np.newaxis]
                factors = curvilinear_factor(curvilinear, mechanism, rows, kernel.radii)
            values, bound = values * factors, about_factor(curvilinear, mechanism)
        lines = [
            f"{title} in {mechanism}: multiplies the kernel {REFERENCES[mechanism][model][1]}",
            "(the product is the kernel of encounters that aggregate, closed for three dimensions)",
        ]
    else:
        values = kernel.arrays[quantity][m, v]
        lines = [f"{quantity} [{KERNEL[quantity][1]}] in {mechanism}: {KERNEL[quantity][2]}"]
    if np.isnan(values).any():
        lines.append("an empty cell is unknown, for example because points are undecided")
    if unknown := np.nanmax(kernel.arrays["undecided"][m, v], initial=0.0):
        lines.append(
            f"up to {100.0 * unknown:.2g} % of a pair's encounters are undecided or failed: the "
            "bounds (_low, _high) include every outcome that they could have had"
        )
    lines.append(f"shapes of N = {vertices} vertices; rows i, columns j: equivalent radii [m]")
    text = io.StringIO()
    text.writelines(f"# {line}\n" for line in lines + bound)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["r_eq [m]", *kernel.radii.tolist()])
    for radius, row in zip(kernel.radii.tolist(), values.tolist(), strict=True):
        writer.writerow([radius, *("" if math.isnan(each) else each for each in row)])
    return text.getvalue()


SETTLING: Factor = lambda p: 0.5 * (p / (1.0 + p)) ** 2, "1/2 (p/(1 + p))^2"
CORRECTIONS: dict[str, dict[str, Factor]] = {
    "hill": {
        "settling": SETTLING,
        "shear": (lambda p: 9.8 / 1.3 * (p / (1.0 + 2.0 * p)) ** 2, "9.8/1.3 (p/(1 + 2p))^2"),
    },
    "burd": {
        "settling": SETTLING,
        # As p² (7.5 + 10p + 5p² + p³)/(1 + p)⁵, which rounds less.
        "shear": (
            lambda p: p**2 * (7.5 + p * (10.0 + p * (5.0 + p))) / (1.0 + p) ** 5,
            "1 - (1 + 5p + 2.5p^2)/(1 + p)^5",
        ),
    },
}
"""{name: {mechanism: (function of p, formula)}}."""


def curvilinear_factor(name: str, mechanism: str, r_i: ArrayLike, r_j: ArrayLike) -> np.ndarray:
    """Return the factor by which water between two spheres reduces their rectilinear kernel.

    Parameters
    ----------
    name : "hill" or "burd"
        Source of the formula.
    mechanism : "settling" or "shear"
        What brings the spheres together.
    r_i, r_j : float or float arrays
        Radii [m]; arrays broadcast.

    Returns
    -------
    float array
        Factor from 0 to 1, symmetric in i and j.

    Raises
    ------
    UsageError
        If the name is unknown, the mechanism has no formula, or a radius is not above 0.

    Notes
    -----
    With p = r_small/r_large:

    - settling: ½ (p/(1 + p))²;
    - shear: 9.8/1.3 (p/(1 + 2p))² (hill), 1 − (1 + 5p + 2.5p²)/(1 + p)⁵ (burd).

    The formulas neglect forces, inertia and porosity; for permeable flocs the factor is not known.
    It is not an efficiency: kernel × factor × alpha is common practice, but approximate.

    Sources: SLAMS-OIL and CSIRO EMS (hill), BurdLab's MatlabCoagThorium (burd); the head of this
    file has paths and commits.

    Examples
    --------
    >>> float(curvilinear_factor("hill", "settling", 5e-6, 5e-6))
    0.125
    """
    known = CORRECTIONS.get(name, {})
    if mechanism not in known:
        raise UsageError(
            f"{name} has no curvilinear factor for {mechanism}: known are "
            + "; ".join(f"{each} for {', '.join(CORRECTIONS[each])}" for each in CORRECTIONS)
        )
    factor, _ = known[mechanism]
    first, second = np.asarray(r_i, dtype=float), np.asarray(r_j, dtype=float)
    for radii in (first, second):
        if not np.all((radii > 0.0) & np.isfinite(radii)):
            raise UsageError("radii of a curvilinear factor must be above 0 and finite, in metres")
    return factor(np.minimum(first, second) / np.maximum(first, second))


def about_factor(name: str, mechanism: str) -> list[str]:
    """Return lines for whoever gets numbers with the factor in them."""
    if name == SPHERES:
        return ABOUT_SPHERES
    _, written = CORRECTIONS[name][mechanism]
    return [
        f"curvilinear factor '{name}' in {mechanism}: {written}, p = r_small/r_large; "
        f"{SOURCES[name]}",
        "it is for solid spheres and multiplies the rectilinear kernel; for flocs, which are "
        "permeable, it is not known",
        "multiplying efficiency and factor is common practice but approximate: neither was "
        "computed with the other",
    ]
