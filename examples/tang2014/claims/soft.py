"""Claims 12 to 18: trends with N and δ, and orders, of the paper's Figs 4, 5, 6 and 8."""

import numpy as np

from .trends import mean_polygons, with_delta, with_vertices
from .verdicts import MissingData, above, always, below, occurs, within

ABOUT_HALF = (0.4, 0.6)
""" "Approximately 50 %", as it is read here."""


def falls(counts, values, name, kind):
    """Parts: a probability falls with N, and with δ."""
    yield below(f"τ({name}, N), Type {kind}", with_vertices(counts, values))
    yield below(f"τ({name}, δ), Type {kind}", with_delta(counts, values))


def inside_falls(results, counts):
    """(12) Pr[C inside] of I and II falls with N and with δ."""
    for kind in ("I", "II"):
        yield from falls(counts, counts.pr_inside[counts.type(kind)], "Pr[C inside]", kind)


def aggregation_inside(results, counts):
    """(13) Pr[A | inside] is below 1, and falls with N and δ."""
    for kind in ("I", "II", "III"):
        place = counts.type(kind)
        sides = counts.classes[:2, place][:, counts.polygons][..., 0]
        departed, trials = int(sides[1].sum()), int(sides.sum())
        yield occurs(f"departed from inside, Type {kind}, N > 1", departed, trials)
        yield from falls(counts, counts.pr_a_inside[place], "Pr[A|inside]", kind)


def middle_highest(results, counts):
    """(14) Type II has the highest Pr[A | inside]."""
    p = counts.pr_a_inside
    for other in ("I", "III"):
        differences = mean_polygons(counts, p[counts.type("II")] - p[counts.type(other)])
        yield above(f"Pr[A|inside], II less {other}, mean over N > 1 and δ", differences)


def aggregation_outside(results, counts):
    """(15) Pr[A | outside] > 0 in I and II, falls with N and δ; 0 for Type I at δ_max."""
    for kind in ("I", "II"):
        place = counts.type(kind)
        sides = counts.classes[2:, place][:, counts.polygons][..., 0]
        bound, trials = int(sides[0].sum()), int(sides.sum())
        yield occurs(f"aggregated from outside, Type {kind}, N > 1", bound, trials)
        yield from falls(counts, counts.pr_a_outside[place], "Pr[A|outside]", kind)
    yield from none_at_largest(counts)


def none_at_largest(counts):
    """Part: no aggregation from outside, Type I, δ = δ_max."""
    if 1.0 not in counts.delta:
        raise MissingData("there is no δ = δ_max")
    largest = list(counts.delta).index(1.0)
    sides = counts.classes[2:, counts.type("I"), :, largest][:, counts.polygons][..., 0]
    departed, trials = int(sides[1].sum()), int(sides.sum())
    yield always("departed from outside, Type I, δ_max", departed, trials)


def outside_below_inside(results, counts):
    """(16) Pr[A | outside] < Pr[A | inside]."""
    for kind in ("I", "II"):
        place = counts.type(kind)
        differences = counts.pr_a_outside[place] - counts.pr_a_inside[place]
        what = f"Pr[A|outside] - Pr[A|inside], Type {kind}, mean over N > 1 and δ"
        yield below(what, mean_polygons(counts, differences))


def pooled_classes(counts, kind):
    """Pr[class] (class, vertices > 1, 1, sample), all displacements pooled as in Fig. 8."""
    classes = counts.classes[:, counts.type(kind)].sum(axis=2, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        return classes / classes.sum(axis=0)


def half_depart(results, counts):
    """(17) Type I: D is about 50 %, and rises with N."""
    d = pooled_classes(counts, "I")[3]
    yield within("Pr[D], Type I, mean over N > 1", mean_polygons(counts, d), *ABOUT_HALF)
    yield above("τ(Pr[D], N), Type I", with_vertices(counts, d))


def most_frequent(results, counts):
    """(18) Type II: A is the most frequent class, and falls with N."""
    classes = pooled_classes(counts, "II")
    lead = classes[0] - classes[1:].max(axis=0)
    yield above("Pr[A] less the next class, Type II, mean over N > 1", mean_polygons(counts, lead))
    yield below("τ(Pr[A], N), Type II", with_vertices(counts, classes[0]))
