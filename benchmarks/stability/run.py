"""The stability table: cases over the whole range of the model, each right or clearly failed.

    python -m benchmarks.stability.run [--quick] [--cases 2000] [--case 1234] [--markdown]

draws the cases with a fixed seed, runs each in a process that is killed after --limit seconds, and
holds it against a reference (see benchmarks/stability/families.py) and against invariants. --case
reruns one case and prints everything about it; --family runs the cases of one family only.
"""

import sys
import time
from collections import Counter

import numpy as np

from benchmarks.reporting import Table, begin
from benchmarks.stability.families import FAMILIES, case_of, family_of
from benchmarks.stability.verdict import KINDS, judge
from benchmarks.stability.workers import judge_all

BAD = ("wrong", "not finite", "crash", "hang")


def show_case(index):
    """Run one case here and print all that is known of it."""
    case, _ = case_of(index)
    for body in case.bodies:
        shape = body.shape
        print(
            f"body: {len(shape.vertices)} core points, radius {shape.radius:.4g} m, r_eq "
            f"{shape.equivalent_radius:.4g} m, at {body.position}, angle {body.angle:.6g}, "
            f"velocity {body.velocity}, spin {body.spin:.6g}, mass {body.mass:.4g} kg, "
            f"fixed {body.fixed}"
        )
    print(f"forces: {case.forces}\n{case.fluid}\nuntil {case.until!r} s, tolerance "
          f"{case.tolerance!r} m")  # fmt: skip
    print(case.system().explain())
    print(judge(index))


def progress(total):
    """A function that says how far the table has come."""
    began = time.monotonic()

    def tell(found):
        if len(found) % 50 == 0 or len(found) == total:
            counts = Counter(verdict.kind for verdict in found)
            spent = time.monotonic() - began
            print(f"{len(found)}/{total} in {spent:.0f} s: {dict(counts)}", file=sys.stderr)

    return tell


def indices_of(options):
    """Indices of the cases to run."""
    count = 200 if options.quick else options.cases
    wanted = range(options.first, options.first + count)
    return [k for k in wanted if options.family in (None, family_of(k))]


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


def family_table(found):
    """How the cases of each family came out."""
    columns = ("family", "judged by", "cases", *KINDS, "which typed failures", "by invariants only",
               "worst error / allowed", "median steps", "slowest [s]")  # fmt: skip
    rows = [family_row(name, [v for v in found if v.family == name]) for name in FAMILIES]
    return Table("By family", columns, [*filter(None, rows), family_row("all", found)])


def family_row(name, some):
    """One row."""
    if not some:
        return None
    judge = FAMILIES[name].judge if name in FAMILIES else ""
    alone = sum(v.kind in ("right", "wrong") and v.judged_by == "invariants" for v in some)
    cells = [
        name, judge, len(some), *counts(some), typed_words(some), alone or "", worst(some),
        f"{np.median([v.steps for v in some]):.0f}", f"{max(v.wall for v in some):.2g}",
    ]  # fmt: skip
    return list(map(str, cells))


def offenders(found):
    """A line for every case that came out badly."""
    lines = [
        f"--case {v.index} ({v.family}): {v.kind}: {v.detail}; tolerance {v.tolerance:.2g} m, "
        f"allowed {v.allowed:.2g} m, its own estimate {v.estimate:.2g} m, {v.steps} steps"
        for v in found
        if v.kind in BAD
    ]
    return "\n".join([f"offenders: {len(lines)}", *lines])


def main():
    """Print the table, or one case."""
    options = begin(
        __doc__, cases=2000, first=0, case={"type": int}, limit=30.0, workers=2,
        family={"choices": list(FAMILIES)}, used="two used",
    )  # fmt: skip
    if options.case is not None:
        show_case(options.case)
        return
    began, indices = time.monotonic(), indices_of(options)
    found = judge_all(indices, options.workers, options.limit, progress(len(indices)))
    found.sort(key=lambda verdict: verdict.index)
    print(f"{len(found)} cases in {time.monotonic() - began:.0f} s.\n")
    family_table(found).print()
    print(offenders(found))


if __name__ == "__main__":
    main()
