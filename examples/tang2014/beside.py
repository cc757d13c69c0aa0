"""Statistics beside the claims, chosen after the results were seen: where trends are and end."""

import attrs
import numpy as np
from claims.resampling import counts_of
from claims.table import markdown
from claims.trends import mean_of, with_delta
from claims.verdicts import interval_of

NAMES = {"pr_inside": "Pr[C inside]", "pr_a_inside": "Pr[A|inside]",
         "pr_a_outside": "Pr[A|outside]"}  # fmt: skip


def below_largest(counts):
    """The Counts without δ = δ_max, where few collide."""
    kept = counts.delta < 1.0
    arrays = {
        name: getattr(counts, name)[..., kept, :] for name in ("collided", "inside", "classes")
    }
    return attrs.evolve(counts, delta=counts.delta[kept], **arrays)


def change_with_vertices(counts, values):
    """Values (vertices, delta, sample) at the largest N less those at the smallest N > 1."""
    first, last = counts.polygons[0], counts.polygons[-1]
    return mean_of(values[last] - values[first], axis=0)


def beside_table(study):
    """The statistics of every type as a table."""
    whole = counts_of(study)
    part = below_largest(whole)
    low, high = (whole.vertices[whole.polygons[place]] for place in (0, -1))
    rows = []
    for name, shown in NAMES.items():
        cells = [cell(with_delta(part, getattr(part, name)[k])) for k in range(len(part.types))]
        rows.append((f"τ({shown}, δ) below δ_max", *cells))
        cells = [cell(change_with_vertices(whole, getattr(whole, name)[k]))
                 for k in range(len(whole.types))]  # fmt: skip
        rows.append((f"{shown} at N = {high} less N = {low}, mean over δ", *cells))
    return markdown(("statistic", *(f"Type {name}" for name in whole.types)), rows)


def cell(samples):
    """ "-0.69 [-1.00, -0.21]"; "-" for what is not there."""
    value, low, high = interval_of(samples)
    return "-" if not np.isfinite(low) else f"{value:.3f} [{low:.3f}, {high:.3f}]"
