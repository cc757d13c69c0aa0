"""Outcomes and steps by the stiffness of contacts, against those of another commit resolved.

    python -m benchmarks.accuracy.contact_scale --truth FILE --compute [--exact 1e-12] [--commit C]
    python -m benchmarks.accuracy.contact_scale --truth FILE [--tolerance 1e-9] [--tree FOLDER]
        [--types III I II] [--vertices 64 16 4] [--delta …] [--k-n 2000 20 …] [--count 300]
        [--worst 20]

What decides an encounter is decided at the scale of its contacts, the overlap load/k_n, which may
be far below a tolerance. The truth is what another commit finds at a tolerance below it. It takes
thousands of steps a replicate, so it is computed once: ``--compute`` runs what FILE lacks of the
conditions asked for, or with more ``--max-steps`` what ended for want of them, and does nothing
else. It may be stopped at any time and goes on where it was; one process at a time. Without, this
tree, or that of ``--tree``, runs the same draws and is held against as many replicates of each
condition as FILE has by then.
"""

import json
import math
import os
import subprocess
import sys
import tempfile
import time
from itertools import product
from pathlib import Path

import attrs
import numpy as np

from benchmarks.reporting import ROOT, Table, parser_of, print_heading
from benchmarks.speed.against_commit import Child, other_tree
from flocsim.ensembles.collision.draw import FAILURES
from flocsim.io.results.schema import AGGREGATED, BONDS, CLASSES, OUTCOMES

TYPES = ("III", "I", "II")
VERTICES = (64, 16, 4)
DELTA = (0.0, 0.5, 1.0, 0.25, 0.75)
STIFFNESS = (2000.0, 20.0, 2e5, 200.0)
"""Conditions in the order of what they tell: a truth that is not complete has the first."""

TRUTH_COMMIT, EXACT = "1114ba2", 1e-12
"""Commit and tolerance [m] of the truth: each contact resolved."""

MOST_STEPS = 200_000
"""Of a replicate, unless asked for otherwise."""

SAVED_EVERY = 30.0
"""Seconds between two versions of the file of the truth."""

STUDY = """\
preset = "tang2014"
seed = {seed}
replicates = 1000
[scene]
types = [{types}]
delta = [0.0, 0.25, 0.5, 0.75, 1.0]
[shapes]
source = "library"
file = "synthetic"
vertices = [{vertices}]
[forces.contact]
k_n = {k_n!r}
k_t = {k_t!r}
[integrator]
tolerance = {tolerance!r}
max_steps = {steps}
check_share = 0.0
"""

CHILD = """
import json, sys, time
from pathlib import Path
from flocsim.ensembles import load_config
from flocsim.ensembles import study as room

COLUMNS = sys.argv[1].split(",")
studies, started = {}, set()
flocs = None


def study_of(path):
    global flocs
    if path not in studies:
        config = load_config(Path(path))
        flocs = room.flocs_of(config) if flocs is None else flocs
        studies[path] = room.Study(config, flocs=flocs)
    return studies[path]


def timed(study, place):
    began = time.process_time()
    row = study.run(*place)
    return row, time.process_time() - began


for line in sys.stdin:
    path, condition, vertices, share, replicate = line.split()
    study = study_of(path)
    place = (int(condition), int(vertices), float(share), int(replicate))
    try:
        row, seconds = timed(study, place)
        if seconds < 0.1 or path not in started:  # shapes, and code, have been made by now
            row, seconds = timed(study, place)
        started.add(path)
    except Exception as error:
        print(f"{place}: {error}", file=sys.stderr, flush=True)
        row = None
    said = row and {name: float(row[name]) for name in COLUMNS} | {"seconds": seconds}
    print(json.dumps(said), flush=True)
"""
"""Runs replicates on demand, with names that were there in every version."""

KEY = ("type", "vertices", "delta", "k_n", "replicate")
FOUND = {
    "outcome": "u1", "inside": "u1", "bond": "u1", "failure": "u1", "steps": "i8", "t_end": "f8",
    "error": "f8", "angle_i": "f8", "angle_j": "f8",
}  # fmt: skip
"""Columns of a replicate's row that are kept."""

RECORD = np.dtype([
    ("type", "U8"), ("vertices", "i4"), ("delta", "f8"), ("k_n", "f8"), ("replicate", "i4"),
    *FOUND.items(), ("seconds", "f8"), ("allowed", "i8"),
])  # fmt: skip
"""One replicate: its key, what became of it, CPU seconds, and how many steps it might take, those
that were rejected among them."""


@attrs.frozen
class Condition:
    """What a share of replicates that aggregate is of."""

    type: str
    vertices: int
    delta: float
    k_n: float


def failed_row():
    """Of a replicate that raised."""
    blank = {name: math.nan if kind == "f8" else 255 for name, kind in FOUND.items()}
    return blank | {"outcome": OUTCOMES.index("failed"), "steps": 0, "seconds": 0.0}


class Runner:
    """Runs replicates by the flocsim of a tree at a tolerance."""

    def __init__(self, tree, tolerance, conditions, folder, arguments):
        self.types = list(dict.fromkeys(each.type for each in conditions))
        self.max_steps = arguments.max_steps
        self.folder = folder / f"studies_{tolerance:g}"
        self.folder.mkdir()
        vertices = dict.fromkeys(each.vertices for each in conditions)
        for k_n in {each.k_n for each in conditions}:
            self.path(k_n).write_text(STUDY.format(
                types=", ".join(f'"{name}"' for name in self.types),
                vertices=", ".join(map(str, vertices)),
                k_n=k_n, k_t=k_n / 10.0, tolerance=tolerance, seed=arguments.seed,
                steps=self.max_steps,
            ))  # fmt: skip
        self.child = Child(tree, CHILD, ",".join(FOUND), folder=self.folder)

    def path(self, k_n):
        """The config of a stiffness."""
        return self.folder / f"stiffness_{k_n:g}.toml"

    def run(self, condition, replicate):
        """What became of a replicate: a tuple of RECORD."""
        place = self.types.index(condition.type)
        answer = self.child.ask(
            self.path(condition.k_n), place, condition.vertices, condition.delta, replicate
        )
        if not answer:
            sys.exit(f"the process ended in replicate {replicate} of {condition}")
        row = json.loads(answer) or failed_row()
        found = (*attrs.astuple(condition), replicate, *(row[name] for name in FOUND))
        return (*found, row["seconds"], self.max_steps)


class Truth:
    """Rows of replicates in a file that names what they are of."""

    def __init__(self, path, facts):
        self.path, self.facts = path, facts
        self.rows = {}
        if path.exists():
            with np.load(path) as data:
                there = json.loads(str(data["facts"]))
                rows = data["rows"]
            if there != facts:
                sys.exit(f"{path} has {there}, wanted is {facts}: give another file")
            self.rows = {tuple(row)[: len(KEY)]: tuple(row) for row in rows.tolist()}

    def lacks(self, key, max_steps):
        """Whether a replicate is still to be run, or to be given more steps."""
        if key not in self.rows:
            return True
        row = dict(zip(RECORD.names, self.rows[key], strict=True))
        return row["failure"] == FAILURES.index("step budget") and row["allowed"] < max_steps

    def of(self, condition, count):
        """Rows of the first replicates of a condition, those that are there."""
        keys = ((*attrs.astuple(condition), k) for k in range(count))
        return np.array([self.rows[key] for key in keys if key in self.rows], RECORD)

    def save(self):
        """Put all rows into the file, whole or not at all."""
        rows = np.array(list(self.rows.values()), RECORD)
        part = self.path.with_suffix(".part.npz")
        np.savez_compressed(part, rows=rows, facts=json.dumps(self.facts))
        os.replace(part, self.path)

    def compute(self, runner, conditions, count):
        """Run what is missing; the file is renewed now and then."""
        saved, began = time.monotonic(), time.monotonic()
        for condition in conditions:
            for replicate in range(count):
                if self.lacks((*attrs.astuple(condition), replicate), runner.max_steps):
                    row = runner.run(condition, replicate)
                    self.rows[row[: len(KEY)]] = row
                if time.monotonic() - saved > SAVED_EVERY:
                    self.save()
                    saved = time.monotonic()
            rows = self.of(condition, count)
            print(
                f"{time.monotonic() - began:.0f} s: {describe(condition)}: {len(rows)} replicates, "
                f"undecided {np.mean(decided(rows) == 0):.3f}, Pr[A] {probability(rows):.3f}, "
                f"steps {rows['steps'].mean():.0f} to {rows['steps'].max()}, "
                f"{rows['seconds'].sum():.1f} CPU s", flush=True,
            )  # fmt: skip
        self.save()


def describe(condition):
    """A condition in words."""
    return (
        f"k_n {condition.k_n:g}, {condition.type}, N = {condition.vertices}, "
        f"delta {condition.delta:g}"
    )


def one_of(rows, names):
    """Whether the outcome is one of these."""
    return np.isin(rows["outcome"], [OUTCOMES.index(name) for name in names])


def aggregated(rows):
    return one_of(rows, AGGREGATED)


def collided(rows):
    """Whether it is one of the classes: touched, and decided."""
    return one_of(rows, CLASSES)


def parted(rows):
    """Whether they touched and came apart."""
    return collided(rows) & ~aggregated(rows)


def decided(rows):
    return ~one_of(rows, ("undecided", "failed"))


def probability(rows):
    """Pr[A] of the collisions that are decided."""
    touched = collided(rows).sum()
    return aggregated(rows).sum() / touched if touched else math.nan


def hangs(rows):
    """Whether it is bound by its shape, or by resting."""
    kinds = [BONDS.index(name) + 1 for name in ("hook", "rest")]
    return aggregated(rows) & np.isin(rows["bond"], kinds)


def bound_by(rows, name):
    """How many are bound so."""
    return int((aggregated(rows) & (rows["bond"] == BONDS.index(name) + 1)).sum())


@attrs.frozen
class Pairs:
    """The same replicates in this tree and in truth."""

    here: np.ndarray
    truth: np.ndarray

    def __attrs_post_init__(self):
        for name in ("angle_i", "angle_j"):
            here, truth = self.here[name], self.truth[name]
            if not np.all((here == truth) | ~decided(self.here) | ~decided(self.truth)):
                sys.exit("the two trees draw other numbers: nothing to be compared")

    @property
    def both(self):
        """Those decided in both."""
        kept = decided(self.here) & decided(self.truth)
        return Pairs(self.here[kept], self.truth[kept])

    @property
    def flips(self):
        """Whether one of them aggregates and the other does not."""
        return aggregated(self.here) != aggregated(self.truth)

    @property
    def zone_flips(self):
        """Whether one of them has come inside and the other has not."""
        return self.here["inside"] != self.truth["inside"]

    @property
    def false_hooks(self):
        """Whether they hang here, where in truth they part."""
        return hangs(self.here) & parted(self.truth)

    @property
    def lost_hooks(self):
        """Whether they part here, where in truth they hang."""
        return parted(self.here) & hangs(self.truth)

    @property
    def difference(self):
        """Pr[A] here less that in truth."""
        return probability(self.both.here) - probability(self.both.truth)


CONDITION_COLUMNS = (
    "k_n", "type", "N", "delta", "replicates", "Pr[A] truth", "Pr[A]", "difference", "flips",
    "zone flips", "false hooks", "lost hooks", "undecided truth", "undecided", "failed",
    "steps", "largest",
)  # fmt: skip
SUM_COLUMNS = (
    "k_n", "type", "replicates", "worst difference", "flips [%]", "zone flips [%]", "false hooks",
    "lost hooks", "hooks (truth)", "rests (truth)", "undecided (truth) [%]", "failed (truth) [%]",
    "steps mean", "largest", "steps of truth", "replicates/s",
)  # fmt: skip


def add_condition(table, condition, pairs):
    """A row of the table of conditions."""
    both = pairs.both
    table.add(
        f"{condition.k_n:g}", condition.type, condition.vertices, f"{condition.delta:g}",
        len(pairs.here), float(probability(both.truth)), float(probability(both.here)),
        float(both.difference), int(both.flips.sum()), int(both.zone_flips.sum()),
        int(both.false_hooks.sum()), int(both.lost_hooks.sum()),
        int(one_of(pairs.truth, ("undecided",)).sum()),
        int(one_of(pairs.here, ("undecided",)).sum()),
        int(one_of(pairs.here, ("failed",)).sum()),
        float(pairs.here["steps"].mean()), int(pairs.here["steps"].max()),
    )  # fmt: skip


def of_both(here, truth):
    return f"{here:.3g} ({truth:.3g})"


def add_sum(table, k_n, kind, every):
    """A row of the table of sums; ``every``: Pairs of its conditions."""
    pairs = Pairs(*(np.concatenate([getattr(each, name) for each in every])
                    for name in ("here", "truth")))  # fmt: skip
    both = pairs.both
    differences = np.abs([each.difference for each in every])
    shares = [
        of_both(*(100.0 * float(one_of(rows, (name,)).mean()) for rows in attrs.astuple(pairs)))
        for name in ("undecided", "failed")
    ]
    bonds = [
        of_both(*(bound_by(rows, name) for rows in attrs.astuple(pairs)))
        for name in ("hook", "rest")
    ]
    table.add(
        k_n, kind, len(pairs.here),
        float(np.nanmax(differences)) if np.isfinite(differences).any() else math.nan,
        100.0 * float(both.flips.mean()), 100.0 * float(both.zone_flips.mean()),
        int(both.false_hooks.sum()), int(both.lost_hooks.sum()), *bonds, *shares,
        float(pairs.here["steps"].mean()), int(pairs.here["steps"].max()),
        float(pairs.truth["steps"].mean()), len(pairs.here) / float(pairs.here["seconds"].sum()),
    )  # fmt: skip


def print_reasons(found):
    """Why replicates are not decided, here and in truth."""
    for name, what in (("here", "Here"), ("truth", "In truth")):
        rows = np.concatenate([getattr(pairs, name) for pairs in found.values()])
        reasons, counts = np.unique(rows["failure"][~decided(rows)], return_counts=True)
        said = [f"{FAILURES[k] if k < len(FAILURES) else 'exception'} {count}"
                for k, count in zip(reasons, counts, strict=True)]  # fmt: skip
        print(f"{what} not decided: {', '.join(said) or 'none'}")
    print()


def print_worst(found, count):
    """The replicates that flip, and what becomes of them."""
    print("Flips: condition, replicate: in truth -> here (bond), steps")
    listed = [
        (condition, here, truth)
        for condition, pairs in found.items()
        for here, truth in zip(pairs.both.here[pairs.both.flips],
                               pairs.both.truth[pairs.both.flips], strict=True)
    ]  # fmt: skip
    for condition, here, truth in listed[:count]:
        ends = " -> ".join(
            f"{OUTCOMES[row['outcome']]} ({(*BONDS, 'none')[min(row['bond'], 4) - 1]})"
            for row in (truth, here)
        )
        print(f"{describe(condition)}, {here['replicate']}: {ends}, "
              f"{truth['steps']} -> {here['steps']}")  # fmt: skip
    print()


def compare(runner, truth, conditions, count, markdown):
    """{condition: Pairs}; prints the tables."""
    table = Table("By condition", CONDITION_COLUMNS)
    found = {}
    for condition in conditions:
        rows = truth.of(condition, count)
        if len(rows) == 0:
            continue
        here = [runner.run(condition, int(replicate)) for replicate in rows["replicate"]]
        found[condition] = Pairs(np.array(here, RECORD), rows)
        add_condition(table, condition, found[condition])
    if not found:
        sys.exit("the truth has nothing of these conditions yet: --compute")
    table.print(markdown)
    sums = Table("By stiffness and type", SUM_COLUMNS)
    for k_n in dict.fromkeys(each.k_n for each in found):
        of_stiffness = {each: pairs for each, pairs in found.items() if each.k_n == k_n}
        for kind in dict.fromkeys(each.type for each in of_stiffness):
            pairs = [pairs for each, pairs in of_stiffness.items() if each.type == kind]
            add_sum(sums, f"{k_n:g}", kind, pairs)
    add_sum(sums, "all", "all", list(found.values()))
    sums.print(markdown)
    known = {each: pairs.difference for each, pairs in found.items()}
    worst = max(known, key=lambda each: abs(np.nan_to_num(known[each])))
    print(f"Worst difference of Pr[A]: {known[worst]:+.3g} at {describe(worst)}")
    print_reasons(found)
    return found


def full_name(commit):
    """A commit by its whole hash."""
    command = ["git", "-C", str(ROOT), "rev-parse", "--verify", f"{commit}^{{commit}}"]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def arguments_of():
    parser = parser_of(__doc__)
    parser.add_argument("--truth", type=Path, required=True, metavar="FILE", help="its .npz")
    parser.add_argument("--compute", action="store_true", help="run what FILE lacks, and end")
    parser.add_argument("--commit", default=TRUTH_COMMIT, help="of the truth, default: %(default)s")
    parser.add_argument("--exact", type=float, default=EXACT, help="tolerance of the truth [m]")
    parser.add_argument("--tree", type=Path, default=ROOT, help="what is measured; default: this")
    parser.add_argument("--tolerance", type=float, default=1e-9, help="of what is measured [m]")
    parser.add_argument("--seed", type=int, default=12)
    parser.add_argument("--types", nargs="+", choices=TYPES, default=TYPES)
    parser.add_argument("--vertices", nargs="+", type=int, default=VERTICES, metavar="N")
    parser.add_argument("--delta", nargs="+", type=float, default=DELTA, metavar="SHARE")
    parser.add_argument("--k-n", nargs="+", type=float, default=STIFFNESS, metavar="N/m")
    parser.add_argument("--count", type=int, default=300, help="replicates of a condition")
    parser.add_argument("--max-steps", type=int, default=MOST_STEPS, help="of a replicate")
    parser.add_argument("--worst", type=int, default=0, help="list so many of the flips")
    return parser.parse_args()


def main():
    """Compute the truth, or print the tables."""
    arguments = arguments_of()
    print_heading()
    count = 5 if arguments.quick else arguments.count
    conditions = [
        Condition(kind, vertices, delta, k_n)
        for k_n, kind, vertices, delta in product(
            arguments.k_n, arguments.types, arguments.vertices, arguments.delta
        )
    ]
    truth = Truth(arguments.truth, {
        "commit": full_name(arguments.commit), "tolerance": arguments.exact,
        "seed": arguments.seed, "preset": "tang2014",
    })  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if arguments.compute:
            tree = other_tree(arguments.commit, folder)
            runner = Runner(tree, arguments.exact, conditions, folder, arguments)
            truth.compute(runner, conditions, count)
            runner.child.close()
            return
        tree = arguments.tree.resolve()
        runner = Runner(tree, arguments.tolerance, conditions, folder, arguments)
        found = compare(runner, truth, conditions, count, arguments.markdown)
        runner.child.close()
    if arguments.worst:
        print_worst(found, arguments.worst)


if __name__ == "__main__":
    main()
