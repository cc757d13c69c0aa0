"""The stability table: cases over the whole range of the model, each right or clearly failed.

    python -m benchmarks.stability.run [--quick] [--cases 2000] [--case 1234] [--markdown]

draws the cases with a fixed seed, runs each in a process that is killed after --limit seconds, and
holds it against a reference (see benchmarks/stability/families.py) and against invariants. --case
reruns one case and prints everything about it.
"""

import json
import sys
import time
from collections import Counter
from pathlib import Path

import attrs
import numpy as np

from benchmarks.reporting import Table, parse_arguments, print_heading
from benchmarks.stability.case import RANGES
from benchmarks.stability.families import FAMILIES, case_of, family_of
from benchmarks.stability.verdict import KINDS, judge
from benchmarks.stability.workers import judge_all

BAD = ("wrong", "not finite", "crash", "hang")


def arguments():
    """The command line."""
    return parse_arguments(
        __doc__,
        cases={"type": int, "default": 2000, "help": "with --quick: 200"},
        first={"type": int, "default": 0, "help": "index of the first case"},
        case={"type": int, "help": "rerun this one and print everything"},
        limit={"type": float, "default": 30.0, "help": "seconds for a case"},
        workers={"type": int, "default": 2},
        family={"choices": list(FAMILIES), "help": "cases of this family only"},
        save={"help": "also write every verdict to this file, one JSON a line"},
        again={"help": "rerun the offenders of such a file only"},
    )


def show_case(index):
    """Run one case here and print all that is known of it."""
    case, places = case_of(index)
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
    print("places in the ranges:", {name: round(place, 3) for name, place in places.items()})
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
    if options.again:
        lines = Path(options.again).read_text("utf-8").splitlines()
        verdicts = [json.loads(line) for line in lines]
        return [verdict["index"] for verdict in verdicts if verdict["kind"] in BAD]
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


def decile_table(found):
    """How the cases came out by the ranges that their numbers were drawn from."""
    table = Table("right/typed/bad by decile of each range", ("range", *map(str, range(1, 11))))
    for name, (low, high) in RANGES.items():
        within = [[] for _ in range(10)]
        for verdict in found:
            if name in verdict.places:
                within[min(max(int(10 * verdict.places[name]), 0), 9)].append(verdict)
        if any(within):
            table.rows.append([f"{name} {low:g}…{high:g}", *map(decile_cell, within)])
    return table


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


def main():
    """Print the table, or one case."""
    options = arguments()
    if options.case is not None:
        show_case(options.case)
        return
    print_heading(used=f"{options.workers} used")
    began, indices = time.monotonic(), indices_of(options)
    found = judge_all(indices, options.workers, options.limit, progress(len(indices)))
    found.sort(key=lambda verdict: verdict.index)
    print(f"{len(found)} cases in {time.monotonic() - began:.0f} s.\n")
    family_table(found).print(options.markdown)
    decile_table(found).print(options.markdown)
    print(offenders(found))
    if options.save:
        lines = [json.dumps(attrs.asdict(verdict), default=float) for verdict in found]
        Path(options.save).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
