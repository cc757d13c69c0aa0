"""Claims 12 to 19, 23 and 24: trends with N and δ, and orders, of Figs 4, 5, 6 and 8."""

import numpy as np

from .trends import kendall, mean_of, mean_polygons, with_delta, with_vertices
from .verdicts import MissingData, above, always, below, everywhere, occurs, within

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
    departed, trials = counts.classes[1, ..., 0], counts.classes[:2].sum(axis=0)[..., 0]
    cells = {name: occurs(name, int(departed[at]), int(trials[at]))
             for name, at in cells_of(counts) if trials[at]}  # fmt: skip
    yield everywhere("some depart from inside, in each condition of N > 1", cells)


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
    differences = counts.pr_a_outside - counts.pr_a_inside
    cells = {name: below(name, differences[at]) for name, at in cells_of(counts, ("I", "II"))
             if np.isfinite(differences[at][0])}  # fmt: skip
    yield everywhere("Pr[A|outside] < Pr[A|inside], in each condition of N > 1", cells)


def cells_of(counts, kinds=None):
    """(name, place) of every condition of N > 1 of some types."""
    for t, kind in enumerate(counts.types):
        if kinds is None or kind in kinds:
            for v in counts.polygons:
                for d, share in enumerate(counts.delta):
                    yield f"{kind} N={counts.vertices[v]} δ={share:g}", (t, v, d)


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


def asymptotic(results, counts):
    """(19) Pr[A] falls with N from that of spheres, ever less at δ = 0, and more at δ > 0."""
    if 0.0 not in counts.delta or 1 not in counts.vertices:
        raise MissingData("there is no δ = 0, or there are no spheres")
    frontal = list(counts.delta).index(0.0)
    order = np.argsort(counts.vertices)
    for kind in ("I", "II", "III"):
        p = counts.pr_a[counts.type(kind)]
        ortho = p[order][:, frontal]
        yield below(f"τ(Pr[A], N ≥ 1), δ = 0, Type {kind}", kendall(ortho))
        middle = ortho[len(order) // 2]
        early, late = ortho[0] - middle, middle - ortho[-1]
        yield above(f"Pr[A] lost in the first half of N less in the second, Type {kind}",
                    early - late)  # fmt: skip
        others = [d for d in range(len(counts.delta)) if d != frontal]
        further = p[counts.polygons][:, others] - p[counts.polygons][:, [frontal]]
        yield below(f"Pr[A] at δ > 0 less δ = 0, mean over N > 1, Type {kind}",
                    mean_of(further.reshape(-1, further.shape[-1]), axis=0))  # fmt: skip


def most_sensitive(results, counts):
    """(23) Pr[C inside] falls most with δ in Type I."""
    order = np.argsort(counts.delta)
    p = counts.pr_inside[:, counts.polygons]
    fall = p[:, :, order[0]] - p[:, :, order[-1]]
    for other in ("II", "III"):
        differences = mean_of(fall[counts.type("I")] - fall[counts.type(other)], axis=0)
        yield above(f"fall of Pr[C inside] from the least to the largest δ, I less {other}, "
                    "mean over N > 1", differences)  # fmt: skip


ALIKE = 0.1
"""Difference of probabilities up to which they count as relatively similar."""


def alike_outside(results, counts):
    """(24) Pr[A | outside] of Types I and II is alike."""
    p = counts.pr_a_outside
    differences = mean_polygons(counts, p[counts.type("I")] - p[counts.type("II")])
    yield within("Pr[A|outside], I less II, mean over N > 1 and δ", differences, -ALIKE, ALIKE)
