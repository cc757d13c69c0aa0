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

Of S scrambles each gives a mean; the interval is Student's of these (`half_width`). Where all
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
from collections.abc import Sequence
from itertools import pairwise

import attrs
import numpy as np

from flocsim.ensembles.collision.draw import points_of
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.offsets import as_draws, bounds_of, offsets_of
from flocsim.ensembles.config.pair_scene import SETTLING, SHEAR
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
from flocsim.io.confidence import wilson
from flocsim.io.results.events import AGGREGATED, KINDS, WITHOUT_OUTCOME, Events, kinds_of
from flocsim.io.results.kernel_group import ESTIMATES, KERNEL, WHAT, Kernel, fractal_in
from flocsim.io.results.schema import NOT_APPLICABLE

COLUMNS = (*EXACT_RUNS, "floc_i", "floc_j")
EDGE = 0.1
"""Outermost share of the offsets that are there for attraction alone."""


@attrs.frozen(eq=False)
class Weighted:
    """The points of a condition: ``width`` [m], ``plane`` [m²/s] and ``space`` [m³/s], what each
    counts for where χ is 1; ``reference`` (2, n) the same of spheres' kernels in plane and space;
    ``speed`` [m/s]; whether a point is at the ``edge``."""

    width: np.ndarray
    plane: np.ndarray
    space: np.ndarray
    reference: np.ndarray
    speed: np.ndarray
    edge: np.ndarray


def weights_of(
    encounter: Encounter, angles: np.ndarray, numbers: np.ndarray
) -> tuple[np.ndarray, ...]:
    """The fields of Weighted for points of one encounter; ``angles`` (2, n), ``numbers`` (n,)."""
    low, high = bounds_of(encounter, angles[0], angles[1])
    signed = offsets_of(encounter, angles[0], angles[1], numbers)
    offset = np.abs(signed)
    size = sum(shape.equivalent_radius for shape in encounter.shapes)
    speed = math.hypot(*encounter.drift)
    ones = np.ones(len(numbers))
    if encounter.meeting == SETTLING:
        width = high - low
        plane, space = speed * width, speed * width * math.pi * offset
        spheres = 2.0 * size * speed, math.pi * size * size * speed
    else:
        assert encounter.rate is not None
        factor = encounter.rate * (1.0 if encounter.meeting == SHEAR else 2.0)
        width = np.full(len(numbers), np.nan)
        plane = factor * high * high
        space = 2.0 * plane * offset
        spheres = factor * size * size, 4.0 / 3.0 * factor * size**3
    rim = EDGE * encounter.reach
    edge = (encounter.reach > 0.0) & ((signed < low + rim) | (signed > high - rim))
    return width, plane, space, np.outer(spheres, ones), speed * ones, edge


def weighted(
    study: KernelStudy, place: tuple[int, int], rows: dict[str, np.ndarray], points: np.ndarray
) -> Weighted:
    """The Weighted points of a condition: place of the collision type, N."""
    condition, vertices = place
    draws = np.array([as_draws(each) for each in points])
    flocs = np.stack([rows["floc_i"], rows["floc_j"]], axis=1).astype(int)
    for k in np.flatnonzero(flocs.min(axis=1) < 0).tolist():
        # A sphere, or a replicate that has failed before it had its flocs.
        flocs[k] = study.choose_flocs(condition, vertices, draws[k])
    found: list[np.ndarray] = []
    pairs, which = np.unique(flocs, axis=0, return_inverse=True)
    for number in range(len(pairs)):
        mine = np.flatnonzero(which.reshape(-1) == number)
        encounter = study.encounter(condition, vertices, draws[mine[0]])
        angles = np.array([encounter.orientations(each) for each in draws[mine]]).T
        parts = weights_of(encounter, angles, draws[mine, 4])
        if not found:
            found = [np.zeros((*np.shape(part)[:-1], len(points)), part.dtype) for part in parts]
        for all_of_them, part in zip(found, parts, strict=True):
            all_of_them[..., mine] = part
    return Weighted(*found)


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


def half_width(values: np.ndarray, point: float) -> float:
    """Of the 95 % interval of the mean of what scrambles gave (S,), to which one point of a
    scramble adds ``point``.

    Even points in a simple set are as many in every scramble, up to one: their scatter is taken for
    half a point at least.
    """
    from scipy.special import stdtrit

    scatter = max(float(values.std(ddof=1)), 0.5 * point)
    return float(stdtrit(len(values) - 1, 0.975)) * scatter / math.sqrt(len(values))


def mean_of(
    values: np.ndarray, unseen: float | None, point: float = 0.0
) -> tuple[float, float, float]:
    """Return (mean, low, high) of what scrambles gave (S,).

    ``unseen``: where all points agree, how much of the sampled mean that bounds; ``point``: see
    half_width.
    """
    mean = float(values.mean())
    half = half_width(values, point if unseen is None else 0.0)
    low, high = max(mean - half, 0.0), mean + half
    if unseen is None:
        return mean, low, high
    if mean == 0.0:
        return mean, 0.0, unseen
    return mean, min(low, mean * (1.0 - unseen)), high


def ratio_of(
    above: np.ndarray, below: np.ndarray, point: float = 0.0
) -> tuple[float, float, float]:
    """(ratio, low, high) of the means of two numbers that each scramble gave; ``point``: see
    half_width, of the first."""
    mean = float(below.mean())
    if not mean > 0.0:
        return math.nan, math.nan, math.nan
    ratio = float(above.mean()) / mean
    half = half_width(above - ratio * below, point) / mean
    return ratio, max(ratio - half, 0.0), ratio + half


def widened(ends: Sequence[float], bound: int, touched: int) -> tuple[float, float]:
    """(low, high) of an efficiency (value, low, high), at least Wilson's where all encounters that
    touched, or none of them, aggregated; never above 1."""
    _, low, high = ends
    if touched and bound in (0, touched):
        least, most = (float(end) for end in wilson(bound, touched))
        low, high = min(low, least), max(high, most)
    return low, min(high, 1.0)


@attrs.define(eq=False)
class Estimated:
    """The numbers of one condition, but for what numerics do: ``values`` {name: number}; ``shifts``
    {name: by how much what was run again changes it}, ``largest`` {name: by how much a further
    point that flips does at most}; ``kinds`` as in kind_counts (kind, 4) and ``changes`` {name of
    `counted`: as in kind_changes (kind, 4)}."""

    values: dict[str, float]
    largest: dict[str, float]
    shifts: dict[str, float]
    kinds: np.ndarray
    changes: dict[str, np.ndarray]


def flow_width(plane: float, factor: float) -> float:
    """2 √(β₂/factor) [m]: the width of spheres that capture as much."""
    return 2.0 * math.sqrt(max(plane, 0.0) / factor)


def known_part(value: float, weight: np.ndarray, known: np.ndarray, most_unknown: float) -> float:
    """What a sum over the ``known`` points is with all of them, in proportion to the weights; NaN
    where they lack more than ``most_unknown`` of these."""
    unknown = float(np.sum(weight * ~known) / np.sum(weight))
    return value / (1.0 - unknown) if unknown <= most_unknown and unknown < 1.0 else math.nan


def estimate(
    points: Weighted, rows: dict[str, np.ndarray], meeting: str, rate: float | None,
    scrambles: int, most_unknown: float = StopConfig().undecided,
) -> Estimated:  # fmt: skip
    """What the points of a condition come to; ``most_unknown``: share of the flux that may be
    unknown where there is an estimate."""
    first, *runs = by_runs([rows[name] for name in EXACT_RUNS])
    exact, kinds = most_exact(*runs), kinds_of(first[0], first[2])
    known = run_so(exact) & ~np.isin(exact[0], WITHOUT_OUTCOME) & kinds.any(axis=0)
    moved = [np.where(known, *pair) for pair in zip(exact, first, strict=True)]
    values, largest = values_of(points, first, meeting, rate, scrambles, most_unknown)
    shifted, _ = values_of(points, moved, meeting, rate, scrambles, most_unknown)
    shifts = {name: shifted[name] - values[name] for name in ESTIMATES}
    counts = [became(each) for each in (first, *runs)]
    changes = {
        name: kind_changes(kinds, runs, [
            gains_and_losses(before[name], after[name]) for before, after in pairwise(counts)
        ]) for name in counts[0]
    }  # fmt: skip
    now = became(exact)
    values["checked"] = float(run_so(exact).sum())
    for name in WHAT:
        both = run_so(exact) & counts[0][name].trials & now[name].trials
        flips = both & (counts[0][name].successes != now[name].successes)
        values[f"flips_{name}"] = float(flips.sum()) / both.sum() if both.any() else math.nan
    return Estimated(values, largest, shifts, kind_counts(kinds, *runs), changes)


def values_of(
    points: Weighted, codes: Codes, meeting: str, rate: float | None, scrambles: int,
    most_unknown: float,
) -> tuple[dict[str, float], dict[str, float]]:  # fmt: skip
    """({name: number}, {estimate: by how much a point that flips changes it at most}) by these
    outcomes of a condition's points."""
    chi = became(codes)
    n = len(points.plane)

    def parts(values: np.ndarray) -> np.ndarray:
        """The means of the scrambles, which replicates belong to in turn."""
        return values.reshape(-1, scrambles).mean(axis=0)

    values: dict[str, float] = {}
    largest: dict[str, float] = {}
    high_share = float(wilson(0, n)[1])
    columns = {
        "beta2_c": (points.plane, "c"), "beta2": (points.plane, "a"),
        "beta3_c": (points.space, "c"), "beta3": (points.space, "a"),
    } | {f"width_{name}": (points.width, name) for name in WHAT}  # fmt: skip
    for name, (weight, what) in columns.items():
        flow = name.startswith("width") and meeting != SETTLING
        weight = points.plane if flow else weight
        most = float(weight.max())

        def bounds(
            flags: np.ndarray, weight: np.ndarray = weight, most: float = most
        ) -> tuple[float, float, float]:
            unseen = None
            if flags.all() or not flags.any():
                unseen = high_share * (1.0 if flags.any() else float(weight.mean()))
            return mean_of(parts(weight * flags), unseen, most * scrambles / n)

        each = chi[what]
        least, low, _ = bounds(each.successes)
        high = bounds(each.successes | each.unknown)[2]
        ends = [known_part(least, weight, ~each.unknown, most_unknown), low, high]
        if flow:
            assert rate is not None
            factor = rate * (1.0 if meeting == SHEAR else 2.0)
            # As the width grows with the root of the rate, it changes by dK/(G W/2).
            width = max(flow_width(least, factor), flow_width(float(weight.mean()) / n, factor))
            most *= 2.0 / (factor * width)
            ends = [flow_width(each, factor) for each in ends]
        values |= zip((name, f"{name}_low", f"{name}_high"), ends, strict=True)
        largest[name] = most
    touched, stays = chi["c"], chi["a"]
    may_touch, may_stay = (each.successes | each.unknown for each in (touched, stays))
    for name, weight, (under, over) in (
        # The unknown lower α most where all touch and none stays, and raise it where all stay.
        ("alpha", points.plane, (points.plane * touched.successes, points.plane * may_touch)),
        ("efficiency2", points.plane, (points.reference[0],) * 2),
        ("efficiency3", points.space, (points.reference[1],) * 2),
    ):
        sure = name == "alpha" and np.array_equal(stays.successes, touched.successes)
        point = 0.0 if sure else float(weight.max()) * scrambles / n
        fewest, all_of_them = (
            ratio_of(parts(weight * each), parts(over), point)
            for each in (stays.successes, may_stay)
        )
        value = known_part(fewest[0], weight, ~stays.unknown, most_unknown)
        ends = [value, fewest[1], all_of_them[2]]
        if name == "alpha":
            many = int(may_touch.sum())
            low, _ = widened(fewest, int(stays.successes.sum()), many)
            _, high = widened(all_of_them, int(may_stay.sum()), many)
            ends = [alpha_of(points.plane, chi, most_unknown), low, high]
        values |= zip((name, f"{name}_low", f"{name}_high"), ends, strict=True)
        below = float(parts(under).mean())
        largest[name] = float(weight.max()) / below if below > 0.0 else math.nan
    unknown = np.isin(codes[0], WITHOUT_OUTCOME)
    caught = float(np.sum(points.plane * stays.successes))
    edge = float(np.sum(points.plane * stays.successes * points.edge))
    values |= {
        "beta2_reference": float(points.reference[0].mean()),
        "beta3_reference": float(points.reference[1].mean()),
        "speed": float(points.speed.mean()),
        "undecided": float(np.sum(points.plane * unknown) / np.sum(points.plane)),
        "edge": edge / caught if caught else 0.0,
    }
    return values, {name: each / n for name, each in largest.items()}


def alpha_of(weight: np.ndarray, chi: dict[str, Events], most_unknown: float) -> float:
    """Return of the flux that touches, and of which it is known what becomes of it, what
    aggregates; NaN where there is none, or the rest is too much of all that touches or may have."""
    flux = float(np.sum(weight * chi["alpha"].trials))
    lost = float(np.sum(weight * chi["a"].unknown))
    may_touch = chi["c"].successes | chi["c"].unknown
    if not flux > 0.0 or lost > most_unknown * float(np.sum(weight * may_touch)):
        return math.nan
    return float(np.sum(weight * chi["a"].successes)) / flux


def of_what(name: str) -> str:
    """Which of `counted` an estimate follows from."""
    if name == "alpha":
        return name
    return name.removeprefix("width_") if name.startswith("width_") else (
        "c" if name.endswith("_c") else "a"
    )  # fmt: skip


def numerical_parts(found: dict[tuple, Estimated], shape: tuple[int, ...]) -> dict[tuple, dict]:
    """{place: {name_change_low, name_change_high, name_numerical}} of all conditions, by mechanism:
    axis 0 of the shape."""
    kinds = np.zeros((*shape, len(KINDS), 4))
    for place, each in found.items():
        kinds[place] = each.kinds
    most = {}
    for what in (*WHAT, "alpha"):
        changes = np.zeros_like(kinds)
        for place, each in found.items():
            changes[place] = each.changes[what]
        most[what] = further(changes, kinds)
    told: dict[tuple, dict] = {}
    for place, each in found.items():
        told[place] = {}
        for name in ESTIMATES:
            gained, lost = (float(side[place]) for side in most[of_what(name)])
            value, largest = each.values[name], each.largest[name]
            shift = each.shifts[name]
            if math.isnan(shift) and not math.isnan(value):
                # What was run again leaves nothing to divide by.
                shift = 0.0
            low, high = max(shift - lost * largest, -value), shift + gained * largest
            if name == "alpha":
                high = min(high, 1.0 - value)
            ends = {"_change_low": low, "_change_high": high, "_numerical": max(abs(low), high)}
            told[place] |= {f"{name}{end}": bound for end, bound in ends.items()}
    return told


def kernel_of(study: KernelStudy, store: RowStore, count: int) -> Kernel:
    """The Kernel of the first ``count`` replicates of each condition of a finished study."""
    scene, vertices = study.scene, study.config.shapes.vertices
    labels = scene.labels
    shape = (len(scene.meeting), len(vertices), len(labels), len(labels))
    points = points_of(study.config.seed, scene.scrambles, 0, count)
    found: dict[tuple, Estimated] = {}
    radii = np.full(len(labels), np.nan)
    for place, (name, n, _) in enumerate(study.conditions):
        condition = scene.names.index(name)
        m, i, j = scene.conditions[condition]
        table = store.rows(place, 0, count)
        rows = {name: table[name] for name in COLUMNS}
        points_here = weighted(study, (condition, n), rows, points)
        meeting = scene.meeting[m]
        found[m, vertices.index(n), i, j] = estimate(
            points_here,
            rows,
            meeting,
            scene.rate,
            scene.scrambles,
            study.config.stop.undecided,
        )
        if scene.sizes is None and i == j:
            radii[i] = float(np.mean(study.pairings[condition].radii))
    if scene.sizes is not None:
        radii = np.array(scene.sizes)
    numerical = numerical_parts(found, shape)
    arrays = {name: np.full(shape, np.nan) for name in KERNEL}
    if scene.sizes is not None and SETTLING in scene.meeting:
        # Bodies of one given size do not meet by settling.
        m, alike = scene.meeting.index(SETTLING), np.arange(len(labels))
        for name in KERNEL:
            if name.startswith(("width", "beta")) or name in ("speed", "checked"):
                arrays[name][m, :, alike, alike] = 0.0
    for cell, each in found.items():
        m, v, i, j = cell
        for name, value in (each.values | numerical[cell]).items():
            arrays[name][m, v, i, j] = arrays[name][m, v, j, i] = value
    water = resistance_of_pairs(study.config.forces) is not None
    fractal = fractal_in(repr(study.config.bodies.density))
    return Kernel(scene.meeting, np.array(vertices), labels, radii, arrays, water, fractal)
