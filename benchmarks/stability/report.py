"""The stability table as text."""

from collections import Counter

import numpy as np

from benchmarks.stability.cases import FAMILIES
from benchmarks.stability.ranges import RANGES
from benchmarks.stability.verdict import KINDS

BAD = ("wrong", "not finite", "crash", "hang")


def counts(found):
    """How many verdicts of each kind, zeros blank."""
    counted = Counter(verdict.kind for verdict in found)
    return [counted[kind] or "" for kind in KINDS]


def typed_words(found):
    """Which typed failures there were."""
    counted = Counter(verdict.detail for verdict in found if verdict.kind == "typed")
    return ", ".join(f"{name} {count}" for name, count in counted.most_common())


def worst(found):
    """The largest error over what was allowed, among the finished cases with a reference."""
    ratios = [v.error / v.allowed for v in found if v.judged_by == "reference" and v.allowed > 0.0]
    return f"{np.nanmax(ratios):.2g}" if ratios else ""


def family_rows(found):
    """(heads, rows) by family."""
    heads = ["family", "judged by", "cases", *KINDS, "which typed failures", "by invariants only",
             "worst error / allowed", "median steps", "slowest [s]"]  # fmt: skip
    rows = [family_row(name, [v for v in found if v.family == name]) for name in FAMILIES]
    return heads, [*filter(None, rows), family_row("all", found)]


def family_row(name, some):
    """One row."""
    if not some:
        return None
    judge = FAMILIES[name].judge if name in FAMILIES else ""
    alone = sum(v.kind in ("right", "wrong") and v.judged_by == "invariants" for v in some)
    return [
        name, judge, len(some), *counts(some), typed_words(some), alone or "", worst(some),
        f"{np.median([v.steps for v in some]):.0f}", f"{max(v.wall for v in some):.2g}",
    ]  # fmt: skip


def decile_rows(found):
    """(heads, rows) by range and its decile: right/typed/bad."""
    heads = ["range (right/typed/bad by decile)", *(f"{k}" for k in range(1, 11))]
    rows = []
    for name, (low, high) in RANGES.items():
        within = [[] for _ in range(10)]
        for verdict in found:
            if name in verdict.places:
                within[min(max(int(10 * verdict.places[name]), 0), 9)].append(verdict)
        if any(within):
            rows.append([f"{name} {low:g}…{high:g}", *map(decile_cell, within)])
    return heads, rows


def decile_cell(some):
    """right/typed/bad of one cell."""
    names = {"stated": "right", **dict.fromkeys(BAD, "bad")}
    kinds = Counter(names.get(v.kind, v.kind) for v in some)
    return f"{kinds['right']}/{kinds['typed']}/{kinds['bad']}" if some else ""


def offenders(found):
    """A line for every case that came out badly."""
    lines = [
        f"--case {v.index} ({v.family}): {v.kind}: {v.detail}; tolerance {v.tolerance:.2g} m, "
        f"allowed {v.allowed:.2g} m, its own estimate {v.estimate:.2g} m, {v.steps} steps"
        for v in found
        if v.kind in BAD
    ]
    return "\n".join([f"offenders: {len(lines)}", *lines])
