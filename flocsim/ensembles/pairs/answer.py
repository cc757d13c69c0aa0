"""What a study of pairs says in one sentence, and of which flocs and which water it says so."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.body import Fluid, FractalDensity
from flocsim.ensembles.config.loader import Reading, lay_over, value_at
from flocsim.ensembles.config.schema import PRESETS, BodiesConfig
from flocsim.ensembles.config.sources import Sources
from flocsim.ensembles.config.toml_text import parse
from flocsim.errors import ConfigError
from flocsim.fields import is_number
from flocsim.io.results.events import AGGREGATED, HOOK
from flocsim.io.results.kernel_group import Kernel
from flocsim.io.results.run_group import stored
from flocsim.io.results.schema import Results

MOST_HANGING = 0.005
"""Fraction of the aggregated pairs up to which those that hang are not mentioned."""

SURFACES = (
    ("forces.double_layer.potential", 1e3, "mV", "surface potential"),
    ("forces.double_layer.debye_length", 1e9, "nm", "Debye length"),
    ("forces.van_der_waals.hamaker", 1.0, "J", "Hamaker constant"),
)
"""Key, unit over the SI unit, unit and words of what is said of the surfaces."""

PHYSICS = ("bodies", "fluid", "forces", "zone")
"""Tables whose values a preset gives."""


def answer_sentence(results: Results) -> str:
    """Return what a study of pairs, or of rates, found in one sentence; "" where it is unknown.

    Pr[A] and its 95 % interval at the largest N, and of the equivalent spheres, are those of the
    table `pooled`: every decided collision of a type counts once, at whichever displacement. Of
    several types the lowest and the highest are given. What is left out of such a probability,
    pairs that are held apart or have no outcome, is counted behind it.

    >>> answer_sentence(flocsim.open("clay.h5"))  # doctest: +SKIP
    'Of pairs that touch, 41 % [36, 46] stick (N = 64, real outlines); spheres of the same size: 100 %.'
    """  # noqa: E501
    if results.kernel is not None:
        return rates_sentence(results.kernel)
    if "pr_a" not in results.pooled:
        return ""
    counts = [int(count) for count in results.vertices]
    most = int(np.argmax(counts))
    table = {name: values[:, most] for name, values in results.probabilities.items()}
    noun, which = "pairs", f" (N = {counts[most]}, {outlines_of(results)})"
    if counts[most] == 1:
        noun, which = "pairs of spheres", ""
    if found := range_of(results, most):
        words = f"Of {noun} that touch, {found} stick{hanging(table)}{which}"
    elif np.any(table["n_collided"]):
        words = f"None of the {noun} that touched came to an outcome{which}"
    else:
        words = f"No {noun.replace('pairs', 'pair')} touched{which}"
    spheres = range_of(results, counts.index(1), surely=True) if 1 in counts else ""
    if found and spheres and counts[most] > 1:
        words += f"; spheres of the same size: {spheres}"
    return "".join([words, *left_out(table), "."])


def rates_sentence(kernel: Kernel) -> str:
    """Return the lowest and the highest efficiency α of each mechanism at the largest N."""
    most, words = kernel.vertices.argmax(), []
    for mechanism, alpha in zip(kernel.mechanisms, kernel.arrays["alpha"], strict=True):
        if np.isfinite(alpha[most]).any():
            least, largest = 100.0 * np.nanmin(alpha[most]), 100.0 * np.nanmax(alpha[most])
            words.append(f"{least:.0f} to {largest:.0f} % by {mechanism}")
    which = f"N = {kernel.vertices[most]}, over all sizes"
    return f"Of pairs that touch, these stick ({which}): {', '.join(words) or 'unknown'}."


def outlines_of(results: Results) -> str:
    """Return what outlines the flocs of a study have, from how `ShapesConfig.described` says it."""
    flocs = str(results.run.get("shapes", ""))
    if " synthetic flocs " in flocs:
        return "grown outlines"
    return "real outlines" if " flocs of " in flocs else "outlines of one's own"


def range_of(results: Results, vertices: int, surely: bool = False) -> str:
    """Return "41 % [36, 46]", or the lowest and the highest of several types, at an index of N; ""
    where there is none. ``surely``: all or none, in all types, stand without an interval."""
    every = zip(
        *(results.pooled[f"pr_a{end}"][:, vertices] for end in ("", "_low", "_high")),
        results.types, strict=True,
    )  # fmt: skip
    found = sorted(each for each in every if not np.isnan(each[0]))
    if not found:
        return ""
    alike = found[0][0] == found[-1][0]
    if alike and surely and found[0][0] in (0.0, 1.0):
        return f"{percent(found[0][0])} %"
    # Of types that are alike the least certain; sorted, that is the one with the lowest end.
    return " to ".join(
        f"{percent(value)} % [{percent(low)}, {percent(high)}]{'' if alike else f' (type {name})'}"
        for value, low, high, name in found[:1] + found[1:][-1:] * (not alike)
    )


def percent(value: float) -> str:
    """Return a fraction in whole percent; nothing but 0 and 1 reads 0 and 100."""
    if 0.0 < value < 0.005 or 0.995 <= value < 1.0:
        return f"{min(max(100.0 * value, 0.1), 99.9):.1f}"
    return f"{100.0 * value:.0f}"


def hanging(table: Mapping[str, np.ndarray]) -> str:
    """Return which fraction of the aggregated pairs hang by their shapes; "" for next to none."""
    aggregated = table["n_class"][..., list(AGGREGATED)].sum()
    hooks = table["n_bond"][..., HOOK - 1].sum()
    if not aggregated or hooks / aggregated < MOST_HANGING:
        return ""
    return f", {percent(hooks / aggregated)} % of them by hooking"


def left_out(table: Mapping[str, np.ndarray]) -> Iterator[str]:
    """Yield what became of the pairs that a probability leaves out, but for misses."""
    total, held, undecided, failed = (
        int(table[f"n_{name}"].sum()) for name in ("total", "held", "undecided", "failed")
    )
    if held:
        yield f"; {held} of {total} pairs are held apart and never touch"
    if undecided + failed:
        yield f"; {undecided + failed} of {total} pairs have no outcome"


def setting_sentence(results: Results) -> str:
    """Return of which preset, weight, water and surfaces a study is.

    All is from the config that it was run with; "" where the results have none that can be read.

    >>> setting_sentence(flocsim.open("clay.h5"))  # doctest: +SKIP
    'Preset clay: real weight, water of 15 °C and 35 g/kg of salt, surface potential 15 mV, …'
    """
    try:
        given = lay_over(
            parse("config", str(results.run["config"])), stored(results.run, "overrides")
        )
    except (KeyError, ValueError, ConfigError, RecursionError):
        return ""
    name = str(given.get("preset", ""))
    preset, reading = PRESETS.get(name, {}), Reading(Path(), Sources())
    table = lay_over(preset, given)
    fluid = reading.made(Fluid, table.get("fluid", {}), "fluid")
    bodies = reading.made(BodiesConfig, table.get("bodies", {}), "bodies")
    words = f"Preset {name}" if name else "No preset"
    if name and (own := [each for each in PHYSICS if table.get(each) != preset.get(each)]):
        words += f" with your values for {' and '.join(own)}"
    if fluid is not None and bodies is not None:
        water = fluid.words.partition(":")[0] or f"water of {1e3 * fluid.viscosity:.3g} mPa s"
        reading.add_water(table, fluid)
        known = weight_of(bodies, fluid), water, *surfaces_of(table)
        words += f": {', '.join(known)}"
    return f"{words}."


def weight_of(bodies: BodiesConfig, fluid: Fluid) -> str:
    """Return what the flocs weigh, in words."""
    sunk = "" if fluid.buoyancy else ", no buoyancy"
    if isinstance(bodies.density, FractalDensity):
        return f"real weight{sunk}"
    if bodies.surface_density is None:
        return f"{bodies.density:g} kg/m³{sunk}"
    return f"{bodies.surface_density:g} kg/m² of projected area{sunk}"


def surfaces_of(table: Mapping[str, Any]) -> Iterator[str]:
    """Yield the potential and the Hamaker constant of the built-in forces that there are."""
    for key, factor, unit, words in SURFACES:
        if (value := value_at(table, key)) is not None:
            both = value if isinstance(value, list) else [value]  # of two unlike bodies
            given = (
                f"{factor * each:.3g} {unit}" if is_number(each) else str(each) for each in both
            )
            yield f"{words} {' and '.join(given)}"
