"""Scene parameters of forces between outlines besides their laws: reach, least gap and depth of
distributed forces, and the smoothing length of the gap of surface forces.

The smooth gap (integrators/rhs/surface_gap.py) lies below the smallest one by up to ℓ ln K with K
pairs of features. A force that changes over a length D then has the relative error ℓ ln K/D. D
grows with the gap for some forces (van der Waals: half the gap), and is constant for others (1/κ).
So

    ℓ(g) = LARGEST_BIAS/ln K · min(D_0 + D' g, D_1),

where that line stays below D of every force. Scene.smoothing stores ℓ(0) [m], dℓ/dg, and the gap
from which ℓ is constant [m].
"""

import math
from collections.abc import Iterable, Sequence

import attrs
import numpy as np

from flocsim.body import NO_LAYER, NO_OUTLINES, Fluid
from flocsim.constants import LARGEST_BIAS, MINIMUM_GAP
from flocsim.errors import UsageError
from flocsim.forces.base import Force, PairForce
from flocsim.forces.check import fields_read, kernel_arguments, reach_of, results, sample_pairs
from flocsim.forces.dlvo import BoundaryCorrection, DoubleLayer
from flocsim.geometry.contact.charges import LAYER_REACH, THIN_LAYER, is_thin
from flocsim.geometry.shapes.shape import Shape

LEAST_LAYER_GAP = 0.005
"""Least gap of double-layer pressures over the Debye length, if no attraction sets one."""


NEEDS_BOTH_SHAPES = {
    "outlines": ("acts along outlines", 'give gap = "surface" instead of law = "outline"'),
    "orientations": ("depends on the angles of the bodies", "leave it out"),
}
"""{what a PairForce acts on: (description, advice)} for forces that need both bodies' shapes or
angles, not only their distance."""


def needs_both_shapes(force: Force) -> bool:
    """Return True if a force depends on both outlines, or on the orientations of both bodies."""
    return force.acts_on in NEEDS_BOTH_SHAPES and not force.absent


def refuse_outlines(forces: Iterable[Force], subject: str) -> None:
    """Raise UsageError if a force depends on both bodies' outlines, which ``subject`` does not
    support."""
    for force in filter(needs_both_shapes, forces):
        words, advice = NEEDS_BOTH_SHAPES[force.acts_on]
        raise UsageError(
            f"{type(force).__name__} {words}, but {subject} can only have forces between spheres "
            f"or nearest points: {advice}"
        )


def charge_layer(forces: Iterable[PairForce], shapes: Sequence[Shape]) -> DoubleLayer | None:
    """Return the double layer that must act between outline charges; None without one.

    That is a layer with the law "outline" that is too thick, compared with the radii of curvature
    of these shapes, for an integral of plate pressures. Raises UsageError for several layers.
    """
    layers = [force for force in forces if isinstance(force, DoubleLayer)]
    if len(layers) > 1:
        raise UsageError("only one double layer can act along outlines, found several: keep one")
    if not layers or not shapes or not layers[0].first or is_thin(shapes, layers[0].kappa):
        return None
    # Tabulated fields end at LAYER_REACH Debye lengths; a cut would be ignored.
    if layers[0].cut is not None:
        raise UsageError(
            f"a double layer of {layers[0].debye_length:.3g} m between bodies rounded by less than "
            f"{THIN_LAYER:g} times as much ends {LAYER_REACH:g} Debye lengths from an outline, "
            f"found a cut of {layers[0].cut:.3g} m: leave it out"
        )
    return layers[0]


def pressures_of(forces: Sequence[PairForce], layer: DoubleLayer | None) -> list[PairForce]:
    """Return the forces between outlines that are plate pressures, or have a part that is.

    ``layer``: the double layer that acts between charges, from `charge_layer`.
    """
    found: list[PairForce] = []
    for force in forces:
        if force is not layer:
            found.append(force)
        # The part of the boundary condition beyond superposition remains a pressure.
        elif layer.boundary != "superposition":
            found.append(BoundaryCorrection(**attrs.asdict(layer, recurse=False)))
    return found


def layer_parameters(layer: DoubleLayer | None) -> tuple[float, float, float]:
    """Return ``Scene.layer``: κ [1/m], 2πε φ_a φ_b [N], and the reach of charges [m], −1 without
    any."""
    if layer is None:
        return NO_LAYER
    return layer.kappa, layer.between_charges, LAYER_REACH * layer.debye_length


def outline_parameters(
    forces: Sequence[PairForce], pressures: Sequence[PairForce], fluid: Fluid
) -> tuple[float, float, float, float]:
    """Return ``Scene.outlines`` of the forces between outlines: four lengths [m].

    The gap up to which any pressure acts (−1: none); the least gap at which attraction is evaluated
    (closer outlines count as that far apart); the depth of the bodies, 0 if it follows from their
    sizes; and the gap up to which all points count, however near the outlines are. Raises
    UsageError for forces of different depths.
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
    # The least gap: d_min of attraction, else that of double layers, else MINIMUM_GAP.
    floor = max((getattr(f, "d_min", 0.0) for f, r in known if "plate_gap" in r), default=0.0)
    layers = [force for force in pressures if isinstance(force, DoubleLayer)]
    floor = floor or max((f.d_min or LEAST_LAYER_GAP * f.debye_length for f in layers), default=0.0)
    # Pressures of gap or parted_gap count at all points, attraction (plate_gap) only within a lens.
    steady = [reach_of(force) for force, fields in known if fields & {"gap", "parted_gap"}]
    return (
        max(map(reach_of, pressures), default=-1.0), floor or MINIMUM_GAP,
        0.0 if isinstance(depth, str) else depth, max(steady, default=0.0),
    )  # fmt: skip


GAPS = np.geomspace(1e-11, 1e-3, 160)
"""Gaps [m] at which forces are sampled."""

LONGEST_DECAY = 1e-6
"""Largest decay length D [m], for forces that do not depend on the gap."""

WEAKEST_FORCE = 1e-4
"""Forces weaker than this share of their maximum do not count: a force that ends at a cut-off
changes by all that is left of it there."""

CONSTANT_DECAY = 0.9
"""D above this share of its largest value counts as constant."""


def decay_lengths(force: PairForce, fluid: Fluid) -> np.ndarray:
    """Return D = max |F(≥ g)|/|dF/dg| [m] at all GAPS but the last; inf where F is constant."""
    kernel, gaps = force.kernel_in(fluid), GAPS
    arguments = kernel_arguments(force, fluid, kernel)
    shortest = np.full(len(gaps) - 1, math.inf)
    # Both signs of the gap rate, for forces that depend on it.
    for rate in (-1e-4, 1e-4):
        pair = sample_pairs(math.inf)[0]._replace(gap_rate=rate)
        views = [pair._replace(gap=gap, centre_distance=gap + 3e-6) for gap in gaps.tolist()]
        values = [next(results(force, kernel, [each], arguments), 0.0) for each in views]
        strength = np.nan_to_num(np.abs(values), posinf=0.0)
        remaining = np.maximum.accumulate(strength[::-1])[::-1]
        strong = remaining[1:] > WEAKEST_FORCE * remaining[0]
        falls = (remaining[1:] < remaining[:-1]) & strong
        # Falling: fit an exponential between neighbouring gaps, which does not overestimate D.
        decay = np.diff(gaps)[falls] / np.log(remaining[:-1][falls] / remaining[1:][falls])
        shortest[falls] = np.minimum(shortest[falls], decay)
        # Rising: the slope over the largest force still to come.
        rises = (strength[1:] > strength[:-1]) & strong
        slope = np.abs(np.diff(strength)) / np.diff(gaps)
        shortest[rises] = np.minimum(shortest[rises], remaining[1:][rises] / slope[rises])
    return shortest


def smoothness(forces: Sequence[PairForce], fluid: Fluid) -> tuple[float, float, float]:
    """Return (D_0, D', D_1) [m, 1, m] of a line below D of all these forces."""
    gaps, lengths = GAPS, np.full(len(GAPS) - 1, LONGEST_DECAY)
    for force in forces:
        within = gaps[:-1] < reach_of(force)
        lengths[within] = np.minimum(lengths[within], decay_lengths(force, fluid)[within])
    # D must not shrink with the gap: take the smallest D at larger gaps.
    lengths = np.minimum.accumulate(lengths[::-1])[::-1]
    rises = lengths < CONSTANT_DECAY * lengths[-1]
    if not rises.any():
        return lengths[0], 0.0, lengths[0]
    # Through half of the first D, with the steepest slope that stays below all others.
    intercept = 0.5 * lengths[0]
    slope = float(np.min((lengths[rises] - intercept) / gaps[:-1][rises]))
    return float(intercept), slope, float(CONSTANT_DECAY * lengths[-1])


def smoothing_of(
    line: tuple[float, float, float], shapes: Sequence[Shape]
) -> tuple[float, float, float]:
    """Return Scene.smoothing for these shapes from the result of `smoothness`."""
    intercept, slope, most = line
    largest = sorted(len(shape.vertices) for shape in shapes)[-2:]
    # K: vertex–edge pairs of the two largest shapes, in both roles.
    share = LARGEST_BIAS / math.log(max(2 * largest[0] * largest[-1], 2))
    end = (most - intercept) / slope if slope > 0.0 else 0.0
    return share * intercept, share * slope, end
