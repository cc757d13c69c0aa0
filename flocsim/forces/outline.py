"""What forces between outlines make of a scene beside their laws: how far to look, and how deep,
for those all along them; how smooth the gap may be, for those at nearest points.

The smooth gap (integrators/rhs/surface_gap.py) lies below the least one by up to ℓ ln K with K
pairs of features, and a force that changes over a length D is off by ℓ ln K/D. D grows with the gap
for some forces (van der Waals: half the gap), and is the same everywhere for others (1/κ). ℓ may be

    ℓ(g) = LARGEST_BIAS/ln K · min(D_0 + D' g, D_1),

where that line stays below the D of every force. Scene.smoothing holds ℓ(0) [m], dℓ/dg, and the gap
from which on ℓ stays the same [m].
"""

import functools
import math
from collections.abc import Iterable, Sequence

import attrs
import numpy as np

from flocsim.body import NO_LAYER, NO_OUTLINES, Fluid
from flocsim.constants import LARGEST_BIAS, MINIMUM_GAP
from flocsim.errors import UsageError
from flocsim.forces.base import Force, PairForce
from flocsim.forces.check import fields_read, kernel_arguments, reach_of, results, sample_pairs
from flocsim.forces.dlvo import BesideCharges, DoubleLayer
from flocsim.geometry.contact.charges import FADED, THIN, is_thin
from flocsim.geometry.shapes.shape import Shape

TOUCHING = 0.005
"""Of a Debye length: where outlines are nearer, and no attraction says how near they count, the
pressure of double layers grows no more."""


ASK_FOR_BOTH = {
    "outlines": ("acts along outlines", 'give gap = "surface" in the place of law = "outline"'),
    "orientations": ("asks how bodies are turned", "leave it out"),
}
"""{what a PairForce acts on: what to say of it, what to do}, where that takes both bodies as they
are and not their distance alone."""


def asks_for_both(force: Force) -> bool:
    """Whether a force goes by both outlines, or by how both bodies are turned."""
    return isinstance(force, PairForce) and force.acts_on in ASK_FOR_BOTH and not force.absent


def refuse_outlines(forces: Iterable[Force], what: str) -> None:
    """UsageError where a force asks for both bodies as they are, of ``what`` cannot have such."""
    for force in filter(asks_for_both, forces):
        assert isinstance(force, PairForce)
        words, advice = ASK_FOR_BOTH[force.acts_on]
        raise UsageError(
            f"{type(force).__name__} {words}, and {what} has forces between spheres or nearest "
            f"points alone: {advice}"
        )


def layer_along(forces: Iterable[PairForce], shapes: Sequence[Shape]) -> DoubleLayer | None:
    """The double layer among forces between outlines that acts between charges, as it is too thick
    beside what is round in these shapes for a sum of plates; None without.

    UsageError for several.
    """
    layers = [force for force in forces if isinstance(force, DoubleLayer)]
    if len(layers) > 1:
        raise UsageError("one double layer acts along outlines, found several: leave all but one")
    if not layers or not shapes or not layers[0].first or is_thin(shapes, layers[0].kappa):
        return None
    if layers[0].cut is not None:
        raise UsageError(
            f"a double layer of {layers[0].debye_length:.3g} m between bodies rounded by less than "
            f"{THIN:g} times as much ends {FADED:g} Debye lengths from an outline, found a cut of "
            f"{layers[0].cut:.3g} m: leave it out"
        )
    return layers[0]


def pressures_of(forces: Sequence[PairForce], layer: DoubleLayer | None) -> list[PairForce]:
    """The forces between outlines that are pressures of plates, or have a part that is; ``layer``:
    of `layer_along`."""
    found: list[PairForce] = []
    for force in forces:
        if force is not layer:
            found.append(force)
        elif layer.boundary != "superposition":
            found.append(BesideCharges(**attrs.asdict(layer, recurse=False)))
    return found


def layer_numbers(layer: DoubleLayer | None) -> tuple[float, float, float]:
    """``Scene.layer`` of what `layer_along` found: κ [1/m]; 2πε φ_a φ_b [N]; and the gap up to
    which charges act [m], −1 without any."""
    if layer is None:
        return NO_LAYER
    return layer.kappa, layer.between_charges, FADED * layer.debye_length


def outlines_of_forces(
    forces: Sequence[PairForce], pressures: Sequence[PairForce], fluid: Fluid
) -> tuple[float, float, float, float]:
    """``Scene.outlines`` of some forces between outlines, of which some are ``pressures`` [m]: the
    gap up to which any of these acts, −1 without; the least gap at which attraction is asked for,
    outlines that are nearer counting as so far apart; the depth of the bodies, 0 where it follows
    from their sizes; and the gap up to which all points count, however near the outlines are.

    UsageError for forces of several depths.
    """
    if not forces:
        return NO_OUTLINES
    depths = {getattr(force, "depth", "sphere") for force in forces}
    if len(depths) > 1:
        found = ", ".join(str(each) for each in sorted(depths, key=str))
        raise UsageError(
            f"forces between outlines act along one depth, found {found}: give them the same depth"
        )
    [depth] = depths
    known = [(force, fields_read(force, fluid, force.kernel_in(fluid))) for force in pressures]
    floor = max((getattr(f, "d_min", 0.0) for f, r in known if "plate_gap" in r), default=0.0)
    layers = [force for force in pressures if isinstance(force, DoubleLayer)]
    floor = floor or max((f.d_min or TOUCHING * f.debye_length for f in layers), default=0.0)
    steady = [reach_of(force) for force, fields in known if fields & {"gap", "parted_gap"}]
    return (
        max(map(reach_of, pressures), default=-1.0), floor or MINIMUM_GAP,
        0.0 if isinstance(depth, str) else depth, max(steady, default=0.0),
    )  # fmt: skip


GAPS = np.geomspace(1e-11, 1e-3, 160)
"""Gaps [m] at which forces are looked at."""

LONGEST = 1e-6
"""[m] The length over which a force changes that is the same at every gap."""

WEAKEST = 1e-4
"""Share of a force's greatest strength below which its bias does not count: one that ends at some
gap changes by all that is left of it there."""

NEARLY = 0.9
"""Share of the longest D from which on it counts as that."""


def change_lengths(force: PairForce, fluid: Fluid) -> np.ndarray:
    """D behind every one of GAPS but the last: max |F(≥ g)|/|dF/dg|, over what length the force
    changes by as much as it still has to lose [m]; inf where it does not."""
    try:
        return lengths_known(force, fluid)
    except TypeError:  # a force that holds a list or the like
        return lengths_known.__wrapped__(force, fluid)


@functools.lru_cache(maxsize=64)
def lengths_known(force, fluid):
    kernel, gaps = force.kernel_in(fluid), GAPS
    arguments = kernel_arguments(force, fluid, kernel)
    shortest = np.full(len(gaps) - 1, math.inf)
    for rate in (-1e-4, 1e-4):
        pair = sample_pairs(math.inf)[0]._replace(gap_rate=rate)
        views = [pair._replace(gap=gap, centre_distance=gap + 3e-6) for gap in gaps.tolist()]
        values = [next(results(force, kernel, [each], arguments), 0.0) for each in views]
        found = np.nan_to_num(np.abs(values), posinf=0.0)
        left = np.maximum.accumulate(found[::-1])[::-1]
        strong = left[1:] > WEAKEST * left[0]
        falls = (left[1:] < left[:-1]) & strong
        # Of an exponential between two gaps, so that what is wide apart is not found too long.
        decay = np.diff(gaps)[falls] / np.log(left[:-1][falls] / left[1:][falls])
        shortest[falls] = np.minimum(shortest[falls], decay)
        rises = (found[1:] > found[:-1]) & strong
        slope = np.abs(np.diff(found)) / np.diff(gaps)
        shortest[rises] = np.minimum(shortest[rises], left[1:][rises] / slope[rises])
    return shortest


def smoothness(forces: Sequence[PairForce], fluid: Fluid) -> tuple[float, float, float]:
    """(D_0, D', D_1) of the line that stays below the D of all these forces [m, 1, m]."""
    gaps, lengths = GAPS, np.full(len(GAPS) - 1, LONGEST)
    for force in forces:
        within = gaps[:-1] < reach_of(force)
        lengths[within] = np.minimum(lengths[within], change_lengths(force, fluid)[within])
    lengths = np.minimum.accumulate(lengths[::-1])[::-1]
    rises = lengths < NEARLY * lengths[-1]
    if not rises.any():
        return lengths[0], 0.0, lengths[0]
    least = 0.5 * lengths[0]
    slope = float(np.min((lengths[rises] - least) / gaps[:-1][rises]))
    return float(least), slope, float(NEARLY * lengths[-1])


def smoothing_of(
    line: tuple[float, float, float], shapes: Sequence[Shape]
) -> tuple[float, float, float]:
    """Scene.smoothing of these shapes, of what `smoothness` gives."""
    least, slope, most = line
    largest = sorted(len(shape.vertices) for shape in shapes)[-2:]
    share = LARGEST_BIAS / math.log(max(2 * largest[0] * largest[-1], 2))
    end = (most - least) / slope if slope > 0.0 else 0.0
    return share * least, share * slope, end
