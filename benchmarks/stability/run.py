"""The stability table: cases over the whole range of the model, each right or clearly failed.

    python -m benchmarks.stability.run [--quick] [--cases 2000] [--case 1234] [--markdown]

draws the cases with a fixed seed, runs each in a process that is killed after --limit seconds, and
holds it against a reference (see stability_cases.py) and against invariants. --case reruns one case
and prints everything about it.
"""

import argparse
import json
import os
import sys
import time
from collections import Counter
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(variable, "1")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "tests"), str(HERE.parent)]

import attrs  # noqa: E402

from benchmarks.reporting import commit  # noqa: E402
from benchmarks.stability.cases import FAMILIES, case_of, family_of  # noqa: E402
from benchmarks.stability.report import BAD, decile_rows, family_rows, offenders  # noqa: E402
from benchmarks.stability.verdict import judge  # noqa: E402
from benchmarks.stability.workers import judge_all  # noqa: E402
from flocsim.io.markdown import markdown_table  # noqa: E402


def arguments():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0, help="index of the first case")
    parser.add_argument("--quick", action="store_true", help="200 cases")
    parser.add_argument("--case", type=int, help="rerun this one and print everything")
    parser.add_argument("--limit", type=float, default=30.0, help="seconds for a case")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--family", choices=list(FAMILIES), help="cases of this family only")
    parser.add_argument("--markdown", action="store_true", help="the tables are so anyway")
    parser.add_argument("--save", help="also write every verdict to this file, one JSON a line")
    parser.add_argument("--again", help="rerun the offenders of such a file only")
    return parser.parse_args()


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


def main():
    """Print the table, or one case."""
    options = arguments()
    if options.case is not None:
        show_case(options.case)
        return
    began, indices = time.monotonic(), indices_of(options)
    found = judge_all(indices, options.workers, options.limit, progress(len(indices)))
    found.sort(key=lambda verdict: verdict.index)
    text = "\n\n".join(
        [
            f"commit {commit()}: {' '.join(['python', *sys.argv])}: {len(found)} cases in "
            f"{time.monotonic() - began:.0f} s",
            markdown_table(*family_rows(found)),
            markdown_table(*decile_rows(found)),
            offenders(found),
        ]
    )
    print(text)
    if options.save:
        lines = [json.dumps(attrs.asdict(verdict), default=float) for verdict in found]
        Path(options.save).write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
