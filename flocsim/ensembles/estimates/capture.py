"""From the points of a kernel study to capture widths, kernels and efficiencies.

With χ_X(b) whether an encounter at an offset b comes to X (touched, inside, aggregated), ⟨⟩ the
mean over orientations and flocs, and over both signs of b, as flocs are chiral:

- settling at |Δw|: W_X = ⟨∫ χ_X db⟩, β₂ = ⟨|Δw| ∫ χ db⟩, β₃ = ⟨|Δw| π ∫ |b| χ db⟩;
- shear of rate G: β₂ = G ⟨∫ |b| χ db⟩, β₃ = 2 G ⟨∫ b² χ db⟩;
- extension of rate s: β₂ = 2 s ⟨∫ |b| χ db⟩, β₃ = 4 s ⟨∫ b² χ db⟩.

In a flow the width is that of spheres which would capture as much: β₂ = G (W/2)² or 2 s (W/2)². β₃
is a closure: it takes what the plane shows at |b| for what a ring of that radius would do, which is
exact for spheres without forces, where β₃ is π R² |Δw|, 4/3 G R³ and 8/3 s R³, and an assumption
for shapes (they lie in the plane) and for forces in a flow.

Of S scrambles each gives a mean; the interval is Student's of these (`ratio_of`). Where all
points agree, it is Wilson's at their number. What numerics change follows as for probabilities
(`estimates.numerical`): what was run again is known, and of the others so many may gain and lose as
there, each with the largest weight of a point.

A point that is undecided or has failed has no χ, or only χ_c, where it had touched. What it could
do is in the interval (Manski's bounds): its low end is that of χ = 0 at all such points, its high
end that of χ = 1. As χ, whichever it is taken for, follows from the point alone, the means of the
scrambles are independent draws of either bound, and Student's interval holds for each by itself:
from the low end of the one to the high end of the other covers whatever the points would have come
to. The estimate is that of the decided points, whose flux stands for all, and NaN where the others
are more of it than `[stop] undecided` allows: what is undecided is no sample, but what takes
longest.
"""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from flocsim.ensembles.collision.draw import as_draws, points_of
from flocsim.ensembles.config.pair_scene import SETTLING
from flocsim.ensembles.config.schema import StopConfig
from flocsim.ensembles.estimates.numerical import (
    Codes,
    further,
    gains_and_losses,
    kind_changes,
    kind_counts,
    most_exact,
    run_so,
)
from flocsim.ensembles.estimates.statistics import EXACT_RUNS, by_runs
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.study import KernelStudy
from flocsim.forces.pair_resistance import resistance_of_pairs
from flocsim.io.confidence import student_quantile, wilson
from flocsim.io.results.events import AGGREGATED, WITHOUT_OUTCOME, Events, kinds_of
from flocsim.io.results.kernel_group import ESTIMATES, KERNEL, WHAT, Kernel
from flocsim.io.results.schema import NOT_APPLICABLE

Rows = Mapping[str, np.ndarray] | np.ndarray
"""Columns of the rows of one condition."""

EDGE = 0.1
"""Outermost share of the offsets that are there for attraction alone."""

POINT = np.dtype([
    ("width", "f8"),    # capture width for which it counts where χ is 1 [m], NaN in a flow
    ("plane", "f8"),    # β₂ for which it counts [m²/s]
    ("space", "f8"),    # β₃ for which it counts [m³/s]
    ("plane_of_spheres", "f8"),
    ("space_of_spheres", "f8"),
    ("factor", "f8"),   # β₂ over the square of half the width in a flow [1/s], NaN in settling
    ("speed", "f8"),    # [m/s]
    ("edge", "?"),      # whether its offset is in the outermost share
])  # fmt: skip


def weighted(
    study: KernelStudy, place: tuple[int, int], rows: Rows, points: np.ndarray
) -> np.recarray:
    """Return what the points of a condition count for, as POINT; ``place``: collision type, N."""
    condition, vertices = place
    draws = np.array([as_draws(each) for each in points])
    flocs = np.stack([rows["floc_i"], rows["floc_j"]], axis=1).astype(int)
    for k in np.flatnonzero(flocs.min(axis=1) < 0).tolist():
        # A sphere, or a replicate that has failed before it had its flocs.
        flocs[k] = study.choose_flocs(condition, vertices, draws[k])
    found = np.zeros(len(points), POINT)
    pairs, which = np.unique(flocs, axis=0, return_inverse=True)
    for number in range(len(pairs)):
        mine = np.flatnonzero(which.reshape(-1) == number)
        encounter = study.encounter(condition, vertices, draws[mine[0]])
        low, high = encounter.bounds(*zip(*map(encounter.orientations, draws[mine]), strict=True))
        offset = encounter.offsets(low, high, draws[mine, 4])
        rim = EDGE * encounter.reach
        edge = (rim > 0.0) & ((offset < low + rim) | (offset > high - rim))
        values = *encounter.weights(low, high, offset), encounter.speed, edge
        for name, each in zip(POINT.names or (), values, strict=True):
            found[name][mine] = each
    return found.view(np.recarray)


def became(codes: Codes) -> dict[str, Events]:
    """Return {c, inside, a, alpha: Events} of points that touched, did so inside, aggregated, and
    aggregated of those that touched: χ is 1 where an event is a success, 0 or 1 where unknown."""
    outcome, inside = codes[:2]
    without, touched = np.isin(outcome, WITHOUT_OUTCOME), inside != NOT_APPLICABLE
    stays, apart = np.isin(outcome, AGGREGATED), without & ~touched
    return {
        "c": Events(~apart, touched, apart),
        "inside": Events(~apart, inside == 1, apart),
        "a": Events(~without, stays, without),
        "alpha": Events(touched & ~without, stays, without),
    }


def of_what(name: str) -> str:
    """Return which event of `became` an estimate follows from."""
    end = name.rpartition("_")[2]
    return end if end in WHAT else "alpha" if name == "alpha" else "a"


def ratio_of(above: np.ndarray, below: np.ndarray, point: float) -> tuple[float, float, float]:
    """Return (ratio, low, high) of the means of two numbers that each scramble gave (S,).

    Student's 95 % interval of the scrambles' means of ``above`` − ratio · ``below``. Even points in
    a simple set are as many in every scramble, up to one: the scatter is taken for half a
    ``point`` at least, what one point adds to the mean of its scramble.
    """
    mean, count = float(below.mean()), len(above)
    if not mean > 0.0:
        return math.nan, math.nan, math.nan
    ratio = float(above.mean()) / mean
    scatter = max(float((above - ratio * below).std(ddof=1)), 0.5 * point)
    half = student_quantile(count) * scatter / math.sqrt(count) / mean
    return ratio, max(ratio - half, 0.0), ratio + half


def estimate(
    points: np.recarray, rows: Rows, scrambles: int,
    most_unknown: float = StopConfig().undecided,
) -> dict[str, Any]:  # fmt: skip
    """Return the numbers of one condition, and what their numerical error follows from.

    That is, of an estimate: "… shift", by how much what was run again changes it, and "… largest",
    by how much a further point that flips does at most; "kinds", see kind_counts; and of an event
    "… changes", see kind_changes.

    ``most_unknown``: share of the flux that may be unknown where there is an estimate.
    """
    first, *runs = by_runs([rows[name] for name in EXACT_RUNS])
    exact, kinds = most_exact(*runs), kinds_of(first[0], first[2])
    # The shift counts a point by its most exact run if that came to an outcome, else by its first.
    known = run_so(exact) & ~np.isin(exact[0], WITHOUT_OUTCOME) & kinds.any(axis=0)
    moved = [np.where(known, *pair) for pair in zip(exact, first, strict=True)]
    values = values_of(points, first, scrambles, most_unknown)
    shifted = values_of(points, moved, scrambles, most_unknown)
    values |= {f"{name} shift": shifted[name] - values[name] for name in ESTIMATES}
    values |= {"kinds": kind_counts(kinds, *runs), "checked": float(run_so(exact).sum())}
    counts = [became(each) for each in (first, *runs)]
    for name in counts[0]:
        sides = [gains_and_losses(before[name], after[name]) for before, after in pairwise(counts)]
        values[f"{name} changes"] = kind_changes(kinds, runs, sides)
    # A flip needs an outcome in both runs: otherwise it is not known whether there was one.
    now = became(exact)
    for name in WHAT:
        both = run_so(exact) & counts[0][name].trials & now[name].trials
        flips = both & (counts[0][name].successes != now[name].successes)
        values[f"flips_{name}"] = float(flips.sum()) / both.sum() if both.any() else math.nan
    return values


def values_of(
    points: np.recarray, codes: Codes, scrambles: int, most_unknown: float
) -> dict[str, Any]:
    """Return the estimates by these outcomes of a condition's points, their intervals, and
    "… largest", see estimate.

    Each estimate is the mean of a weight times χ, over the mean of another weight for efficiencies.
    """
    chi, n = became(codes), len(points)
    touched, stays = chi["c"].successes, chi["a"].successes
    may_touch, factor = touched | chi["c"].unknown, float(points.factor[0])
    # The unknown lower α most where all touch and none stays, and raise it where all of them do.
    divisors = {"efficiency2": points.plane_of_spheres, "efficiency3": points.space_of_spheres,
                "alpha": points.plane * may_touch}  # fmt: skip
    # Wilson's bound of the points that may do otherwise where all agree.
    rare = float(wilson(0, n)[1])

    def parts(values: np.ndarray) -> np.ndarray:
        """Return the means of the scrambles, to which replicates belong in turn."""
        return values.reshape(-1, scrambles).mean(axis=0)

    values: dict[str, Any] = {}
    for name in ESTIMATES:
        alpha, in_flow = name == "alpha", name.startswith("width") and factor > 0.0
        event = chi["a" if alpha else of_what(name)]
        weight = points.space if "3" in name else points.plane
        if name.startswith("width") and not in_flow:
            weight = points.width
        below, most = divisors.get(name, np.ones(n)), float(weight.max())
        ends = []
        for flags in (event.successes, event.successes | event.unknown):
            alike = name not in divisors and (flags.all() or not flags.any())
            sure = alike or (alpha and np.array_equal(stays, touched))
            point = 0.0 if sure else most * scrambles / n
            ratio, low, high = ratio_of(parts(weight * flags), parts(below), point)
            if alike and flags.any():
                low = min(low, ratio * (1.0 - rare))
            elif alike:
                high = rare * float(weight.mean())
            elif alpha and may_touch.any() and flags.sum() in (0, may_touch.sum()):
                least, largest = map(float, wilson(flags.sum(), may_touch.sum()))
                low, high = min(low, least), max(high, largest)
            ends.append((ratio, low, min(high, 1.0) if alpha else high))
        (value, low, _), (_, _, high) = ends
        # What is decided stands for all, unless too much is not.
        with np.errstate(divide="ignore", invalid="ignore"):
            unknown = np.sum(weight * event.unknown) / np.sum(
                weight * (may_touch if alpha else 1.0)
            )
            if alpha:
                decided = np.sum(weight * stays) / np.sum(weight * chi["alpha"].trials)
            else:
                decided = value / (1.0 - unknown)
        estimated = [float(decided) if unknown <= most_unknown else math.nan, low, high]
        if alpha:
            most /= float(parts(points.plane * touched).mean()) or math.nan
        elif name in divisors:
            most /= float(parts(below).mean())
        if in_flow:
            # β₂ = factor (W/2)²: as W grows with its root, it changes by dβ₂/(factor W/2).
            estimated = [2.0 * math.sqrt(max(each, 0.0) / factor) for each in estimated]
            most /= factor * math.sqrt(max(value, float(weight.mean()) / n) / factor)
        values |= zip((name, f"{name}_low", f"{name}_high"), estimated, strict=True)
        values[f"{name} largest"] = most / n
    caught = points.plane * stays
    return values | {
        "beta2_reference": float(points.plane_of_spheres.mean()),
        "beta3_reference": float(points.space_of_spheres.mean()),
        "speed": float(points.speed.mean()),
        "undecided": float(np.sum(points.plane * chi["a"].unknown) / np.sum(points.plane)),
        "edge": float(np.sum(caught * points.edge) / np.sum(caught)) if caught.any() else 0.0,
    }


def numerics_of(table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return {name_change_low, name_change_high, name_numerical} of all conditions (type, N), from
    what `estimate` gave of each."""
    found: dict[str, np.ndarray] = {}
    for name in ESTIMATES:
        value, shift, largest = (table[f"{name}{end}"] for end in ("", " shift", " largest"))
        gained, lost = further(table[f"{of_what(name)} changes"], table["kinds"])
        # What was run again may leave nothing to divide by.
        shift = np.where(np.isnan(shift) & ~np.isnan(value), 0.0, shift)
        low = np.maximum(shift - lost * largest, -value)
        high = shift + gained * largest
        if name == "alpha":
            high = np.minimum(high, 1.0 - value)
        found |= {f"{name}_change_low": low, f"{name}_change_high": high,
                  f"{name}_numerical": np.maximum(np.abs(low), high)}  # fmt: skip
    return found


def kernel_of(study: KernelStudy, store: RowStore, count: int) -> Kernel:
    """Return the Kernel of the first ``count`` replicates of each condition of a finished study."""
    scene, vertices = study.scene, study.config.shapes.vertices
    labels = scene.labels
    points = points_of(study.config.seed, scene.scrambles, 0, count)
    found = []
    for place, (name, n, _) in enumerate(study.conditions):
        rows = store.rows(place, 0, count)
        points_here = weighted(study, (scene.names.index(name), n), rows, points)
        found.append(estimate(points_here, rows, scene.scrambles, study.config.stop.undecided))
    types = len(scene.names), len(vertices)
    table = {key: np.reshape([each[key] for each in found], (*types, *np.shape(value)))
             for key, value in found[0].items()}  # fmt: skip
    table |= numerics_of(table)
    radii = np.full(len(labels), np.nan) if scene.sizes is None else np.array(scene.sizes)
    shape = (len(scene.meeting), len(vertices), len(labels), len(labels))
    arrays = {name: np.full(shape, np.nan) for name in KERNEL}
    if scene.sizes is not None and SETTLING in scene.meeting:
        # Bodies of one given size do not meet by settling.
        m, alike = scene.meeting.index(SETTLING), np.arange(len(labels))
        for name in KERNEL:
            if name.startswith(("width", "beta")) or name in ("speed", "checked"):
                arrays[name][m, :, alike, alike] = 0.0
    for place, (m, i, j) in enumerate(scene.conditions):
        for name, values in arrays.items():
            values[m, :, i, j] = values[m, :, j, i] = table[name][place]
        if scene.sizes is None and i == j:
            radii[i] = float(np.mean(study.pairings[place].radii))
    water = resistance_of_pairs(study.config.forces) is not None
    return Kernel(scene.meeting, np.array(vertices), labels, radii, arrays, water)
