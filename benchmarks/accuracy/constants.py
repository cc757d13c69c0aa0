"""What halving and doubling each numeric constant of the engine does to steps and outcomes.

    python -m benchmarks.accuracy.constants [--list] [--constants NAME …] [--scenes 120]
        [--replicates 60] [--folder FOLDER] [--limit 40]

Runs replicates of the preset tang2014 and random scenes (random_scenes) in a copy of the package
whose constants lie in memory (tunable), so that it is compiled once. A process runs everything with
unchanged values: the results must be those of the package itself, bit by bit, and the flags of the
table tell the runs that read each constant. For each change it forks a child, which runs these
again with warm code. A child that takes longer than the limit for a run is killed: the change
"hangs". Results are stored in the folder, a line per constant, and a second call goes on with those
that are missing.

A fraction above 0.9 is changed by its distance to 1; a whole number is halved downwards.
"""

import contextlib
import functools
import hashlib
import json
import math
import os
import pickle
import select
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import attrs
import numpy as np

from benchmarks.accuracy.random_scenes import RandomScene, scene_of
from benchmarks.accuracy.tunable import PACKAGE, ROOMS, all_constants, dependents, make_copy
from benchmarks.reporting import ROOT, Table, begin
from flocsim.compiler import composer
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.kind import Overseer, study_of

FACTORS = {"×2": 2.0, "÷2": 0.5}

STUDY = """\
preset = "tang2014"
seed = 1
[scene]
types = ["I", "III"]
delta = [0.0, 0.4, 0.8]
[shapes]
source = "synthetic"
vertices = [1, 4, 16, 64]
pool = 4
[integrator]
check_share = 0.0
max_steps = 50_000
"""
"""The replicates, which the conditions take in turn."""

COMPILED_IN = {
    "integrators.backward_euler.method.FEWEST": "decides what is compiled (integrators.left_out)",
}
"""{constant: reason} why a change of it would compile engines anew."""

FAILED_RUNS = 2
"""Runs that hang or crash, after which a change is not tried any further."""

SLOWER = 50.0
"""A run hangs if it takes so many times as long as it did, and longer than ``--limit``."""

BEYOND = 3.0
"""A position has moved if it differs by so many times the sum of both stated errors."""


LITTLE = 0.01
"""Change of the number of steps, by halving and by doubling, below which a constant matters
little."""


@attrs.frozen
class Result:
    """What became of a run: its ``outcome`` and ``digest`` in text; ``steps`` tried and
    ``evaluations`` of forces (of replicates unknown); ``position`` and its ``error`` [m]."""

    outcome: str
    digest: str
    steps: int
    evaluations: int
    position: np.ndarray
    error: float

    def has_moved(self, other: "Result") -> bool:
        """Return True if the two positions differ by more than both errors."""
        allowed = BEYOND * (self.error + other.error)
        difference = np.abs(self.position - other.position)
        return bool(np.isfinite(allowed) and np.max(difference, initial=0.0) > allowed)


def digest_of(*values: object) -> str:
    """Return a hash that tells values apart by every bit."""
    parts = [each.tobytes() if isinstance(each, np.ndarray) else repr(each).encode()
             for each in values]  # fmt: skip
    return hashlib.blake2b(b"|".join(parts), digest_size=8).hexdigest()


def result_of(scene: RandomScene) -> Result:
    """Return the Result of a random scene."""
    end = scene.run()
    digest = digest_of(end.outcome, end.steps, end.evaluations, end.position, end.error)
    # The turning of a body counts as its outline moves, of some 5 µm.
    position = (end.position * np.array([1.0, 1.0, 5e-6])).ravel()
    return Result(str(end.outcome), digest, end.steps, end.evaluations, position, end.error)


class Replicates:
    """Replicates of the STUDY, in a file of a folder."""

    def __init__(self, folder: Path) -> None:
        path = folder / "study.toml"
        path.write_text(STUDY, "utf-8")
        self.config = load_config(path)
        self.flocs = study_of(self.config).flocs

    def run(self, number: int) -> Result:
        """Return the Result of a replicate, in a study of its own: nothing is kept of others."""
        study = study_of(self.config, self.flocs)
        index, place = divmod(number, len(study.conditions))
        rows, notes = study.run_some(study.conditions[place], index, index + 1, Overseer())
        row = dict(zip(study.row.names, rows[0].tolist(), strict=True))
        outcome = tuple(int(row[name]) for name in ("outcome", "inside", "bond", "failure"))
        steps = int(row["steps"]) + int(row["rejected"])
        digest = digest_of(*(f"{name} {row[name]!r}" for name in sorted(row)))
        text = f"{outcome} {notes[0].get('why', '') if notes else ''}".strip()
        return Result(text, digest, steps, 0, np.array([row["d_c_last"]]), float(row["error"]))


def caches() -> dict[str, list]:
    """Return {module: functions of the ROOMS that remember what may follow from a constant}."""
    rooms = tuple(f"{PACKAGE}.{room.removesuffix('.py').replace('/', '.')}" for room in ROOMS)
    found = {}
    for name, module in list(sys.modules.items()):
        if name.startswith(rooms) and name != f"{PACKAGE}.hooks":
            known = [each for each in vars(module).values() if hasattr(each, "cache_clear")]
            found |= {name: known} if known else {}
    return found


def compose_once() -> None:
    """Let all modules link and hash each function once, which takes longer than a short run."""
    engines: dict = {}
    laws: dict = {}

    def compose(entry, fillings, **options):
        key = entry, frozenset(fillings.items()), *options.items()
        if key not in engines:
            engines[key] = composer.compose(entry, fillings, **options)
        return engines[key]

    def compile_law(law, told, *more):
        if (law, told) not in laws:
            laws[law, told] = composer.compile_law(law, told, *more)
        return laws[law, told]

    for name, module in list(sys.modules.items()):
        if name.startswith(PACKAGE) and module is not composer:
            for made in (compose, compile_law):
                if vars(module).get(made.__name__) is getattr(composer, made.__name__):
                    setattr(module, made.__name__, made)


class Runs:
    """All runs by their numbers: random scenes, then replicates."""

    def __init__(self, folder: Path, scenes: int, replicates: int) -> None:
        compose_once()
        self.scenes, self.count = scenes, scenes + replicates
        self.made: dict[int, RandomScene] = {}
        self.replicates = Replicates(folder) if replicates else None

    def prepare(self, number: int, afresh: bool) -> None:
        """Make the bodies and forces of a random scene, if they are not there; ``afresh``: in any
        case, with nothing remembered of other runs."""
        if afresh:
            for function in [each for known in caches().values() for each in known]:
                function.cache_clear()
        if number < self.scenes and (afresh or number not in self.made):
            self.made[number] = scene_of(number)

    def run(self, number: int) -> Result:
        """Return the Result of a run that is prepared."""
        if number < self.scenes:
            return result_of(self.made[number])
        return self.replicates.run(number - self.scenes)

    def name(self, number: int) -> str:
        """Return what a run is in words."""
        scene = number < self.scenes
        return f"scene {number}" if scene else f"replicate {number - self.scenes}"


# The process of the copy.


class Trials:
    """The unchanged runs, and what they read; runs of changes in children."""

    def __init__(self, runs: Runs, limit: float) -> None:
        from flocsim import tuned  # of the copy alone

        self.runs, self.limit, self.table = runs, limit, tuned
        self.unchanged: list[Result] = []
        self.spent: list[float] = []
        self.readers: list[set[int]] = [set() for _ in tuned.VALUES]
        self.remembered: set[int] = set()

    def begin(self) -> None:
        """Run everything unchanged: to compile, and to note what is read. What is read only while
        a run is prepared, or by its first run, is remembered in results: where it is changed, runs
        are prepared afresh."""
        for number in range(self.runs.count):
            self.runs.prepare(number, False)
            self.runs.run(number)
        for number in range(self.runs.count):
            prepared = self.read_by(lambda n=number: self.runs.prepare(n, True))
            first = self.read_by(lambda n=number: self.runs.run(n))
            began = time.perf_counter()
            again = self.read_by(lambda n=number: self.unchanged.append(self.runs.run(n)))
            self.spent.append(time.perf_counter() - began)
            self.remembered |= prepared | (first - again)
            for index in prepared | first | again:
                self.readers[index].add(number)

    def read_by(self, function: Callable[[], object]) -> set[int]:
        """Return the indices of the constants that a function reads."""
        self.table.flags[:] = [0.0] * self.table.COUNT
        function()
        return {index for index, read in enumerate(self.table.flags) if read}

    def child(
        self, changes: dict[int, float], numbers: list[int], afresh: bool
    ) -> tuple[int, int]:  # fmt: skip
        """Start a child with changed values that sends the result of each run; return its process
        id and the end of its pipe."""
        end, start = os.pipe()
        process = os.fork()
        if process:
            os.close(start)
            return process, end
        with os.fdopen(start, "wb") as pipe:
            for index, value in changes.items():
                self.table.values[index] = value
            for number in numbers:
                try:
                    self.runs.prepare(number, afresh)
                    found: object = self.runs.run(number)
                except Exception as error:
                    found = f"{type(error).__name__}: {error}"
                data = pickle.dumps(found)
                pipe.write(len(data).to_bytes(8, "big") + data)
                pipe.flush()
        os._exit(0)

    def results(
        self, changes: dict[int, float], numbers: list[int], afresh: bool
    ) -> dict[int, object]:  # fmt: skip
        """Return {number: Result, or text on what went wrong} of runs with changed values."""
        found: dict[int, object] = {}
        failed = 0
        while len(found) < len(numbers) and failed < FAILED_RUNS:
            left = [each for each in numbers if each not in found]
            process, pipe = self.child(changes, left, afresh)
            try:
                for number in left:
                    allowed = max(self.limit, SLOWER * self.spent[number])
                    data = message(pipe, allowed)
                    if not isinstance(data, bytes):
                        found[number], failed = data, failed + 1
                        break
                    found[number] = pickle.loads(data)
            finally:
                os.close(pipe)
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
                os.waitpid(process, 0)
        return found

    def effect(self, changes: dict[int, float], afresh: bool) -> dict:
        """Return what changed values do: ratios of steps and evaluations over all runs, that of
        steps over replicates, the geometric mean of each run's ratio; and the runs whose outcomes,
        positions or bits differ, or that fail."""
        numbers = sorted(set().union(*(self.readers[index] for index in changes)))
        began = time.perf_counter()
        found = self.results(changes, numbers, afresh)
        results = {n: r for n, r in found.items() if isinstance(r, Result)}
        steps, before = self.sums(results, "steps", range(self.runs.count))
        ours = self.sums(results, "steps", range(self.runs.scenes, self.runs.count))
        forces = self.sums(results, "evaluations", range(self.runs.count))
        logs = [math.log((r.steps + 1) / (self.unchanged[n].steps + 1)) for n, r in results.items()]
        ratios = {
            "steps": steps / before,
            "steps of replicates": ours[0] / ours[1] if ours[1] else 1.0,
            "mean": math.exp(sum(logs) / self.runs.count),
            "evaluations": forces[0] / forces[1] if forces[1] else 1.0,
        }
        differs = {n: r for n, r in results.items() if r.outcome != self.unchanged[n].outcome}
        return ratios | {
            "runs": len(found),
            "bits": sum(r.digest != self.unchanged[n].digest for n, r in results.items()),
            "outcomes": {self.runs.name(n): [self.unchanged[n].outcome, r.outcome]
                         for n, r in differs.items()},
            "moved": [self.runs.name(n) for n, r in results.items()
                      if r.has_moved(self.unchanged[n])],
            "wrong": {self.runs.name(n): r for n, r in found.items() if isinstance(r, str)},
            "seconds": time.perf_counter() - began,
        }  # fmt: skip

    def sums(self, results: dict[int, Result], name: str, numbers: range) -> tuple[int, int]:
        """Return the sum of a number of each run, with the changed results and without."""
        before = sum(getattr(self.unchanged[n], name) for n in numbers)
        gained = sum(getattr(results[n], name) - getattr(self.unchanged[n], name)
                     for n in numbers if n in results)  # fmt: skip
        return before + gained, before


def message(pipe: int, seconds: float) -> bytes | str:
    """Return the next message of a child; "hangs" or "crashes" where it does not come."""
    end = time.monotonic() + seconds
    data, size, has_size = b"", 8, False
    while True:
        if len(data) == size and has_size:
            return data
        if len(data) == size:
            size, has_size, data = int.from_bytes(data, "big"), True, b""
        ready, _, _ = select.select([pipe], [], [], max(end - time.monotonic(), 0.0))
        if not ready:
            return "hangs"
        got = os.read(pipe, size - len(data))
        if not got:
            return "crashes"
        data += got


def changed_value(value: float, factor: float) -> float:
    """Return a value that is changed by a factor."""
    if isinstance(value, int):
        return int(value * factor)
    return 1.0 - (1.0 - value) * factor if 0.9 < value < 1.0 else value * factor


def changes_of(index: int, value: float, tuned: list, more: dict[int, list[int]]) -> dict:
    """Return {index: value} of a changed constant and of those that are computed from it."""
    changes = {index: value}
    for other in more.get(index, ()):
        constant = tuned[other]
        known = dict(vars(sys.modules[constant.module]))
        known |= {tuned[place].name: given for place, given in changes.items()}
        changes[other] = eval(constant.text, known)
    return changes


def work(folder: Path, scenes: int, replicates: int, limit: float, wanted: list[str]) -> None:
    """Run all wanted constants that the folder has no result of, in the process of the copy."""
    constants = pickle.loads((folder / "constants.pickle").read_bytes())
    tuned = [each for each in constants if not each.left_out]
    trials = Trials(Runs(folder, scenes, replicates), limit)
    began = time.perf_counter()
    trials.begin()
    compare(folder, trials)
    print(f"{trials.runs.count} runs in {sum(trials.spent):.1f} s, compiled and noted in "
          f"{time.perf_counter() - began:.0f} s", file=sys.stderr, flush=True)  # fmt: skip
    more, file = dependents(tuned), folder / "results.jsonl"
    done = {each["key"] for each in stored(folder)}
    for index, constant in enumerate(tuned):
        if constant.key in done or not is_wanted(constant, wanted):
            continue
        value = trials.table.VALUES[index]
        value = int(value) if type(constant.value) is int else value
        afresh = index in trials.remembered or constant.module in caches()
        found = {"key": constant.key, "value": value, "documented": constant.documented,
                 "readers": len(trials.readers[index])}  # fmt: skip
        for name, factor in FACTORS.items():
            other = changed_value(value, factor)
            if other != value:
                changes = changes_of(index, other, tuned, more)
                found[name] = {"value": other} | trials.effect(changes, afresh)
        with file.open("a", encoding="utf-8") as out:
            out.write(json.dumps(found) + "\n")
        write_table(folder, constants)


def compare(folder: Path, trials: Trials) -> None:
    """Exit unless the copy with unchanged values gives the results of the package, to every bit."""
    digests = json.loads((folder / "package.json").read_text("utf-8"))
    own = [each.digest for each in trials.unchanged]
    differ = [trials.runs.name(n) for n, (a, b) in enumerate(zip(own, digests, strict=True))
              if a != b]  # fmt: skip
    if differ:
        sys.exit(f"{len(differ)} runs of the copy differ from the package: {', '.join(differ)}")
    print(f"{len(own)} runs of the copy are those of the package to every bit", file=sys.stderr)


# The table.


def stored(folder: Path) -> list[dict]:
    """Return the results that a folder has."""
    file = folder / "results.jsonl"
    if not file.exists():
        return []
    return [json.loads(line) for line in file.read_text("utf-8").splitlines()]


def is_wanted(constant, names: list[str]) -> bool:
    """Return True if a constant is tuned and has one of the names, with or without its module;
    without names, any that is tuned."""
    named = not names or constant.name in names or constant.key in names
    return named and not constant.left_out and constant.key not in COMPILED_IN


def words_of(effect: dict | None) -> list[str]:
    """Return the columns of one change."""
    if effect is None:
        return ["-"] * 5
    wrong = Counter(each if each in ("hangs", "crashes") else "raises"
                    for each in effect["wrong"].values())  # fmt: skip
    more = "".join(f", {count} {name}" for name, count in wrong.items())
    if not effect["bits"] and not wrong:
        return ["1", "1", "1", "0", "0"]
    ratios = (effect.get(name) for name in ("steps", "steps of replicates", "mean"))
    shown = ["?" if ratio is None else f"{ratio:.3f}" for ratio in ratios]
    return [*shown, f"{len(effect['outcomes'])}{more}", str(len(effect["moved"]))]


def write_table(folder: Path, constants: list) -> None:
    """Write the table of all results and of what is left out."""
    results = {each["key"]: each for each in stored(folder)}
    columns = ["constant", "value", "documented", "runs that read it"]
    for name in FACTORS:
        columns += [f"{name}: steps", "of replicates", "mean", "outcomes", "moved"]
    table = Table("Effect of each constant", tuple(columns))
    for each in constants:
        found = results.get(each.key)
        known = "yes" if each.documented else "no"
        if found is not None:
            cells = [each for name in FACTORS for each in words_of(found.get(name))]
            table.rows.append([each.key, each.text, known, str(found["readers"]), *cells])
    lists = {
        "Changes nothing, though runs read it": [
            f"{key} ({found['readers']} runs)" for key, found in results.items()
            if found["readers"] and changes_nothing(found)
        ],
        f"Changes no outcome, and steps by less than {LITTLE:.0%}": [
            f"{key} ({found['readers']} runs)" for key, found in results.items()
            if changes_little(found)
        ],
        "Read by no run": [key for key, found in results.items() if not found["readers"]],
        "Left out": [f"{each.key} = {each.text[:60]}: {each.left_out}" for each in constants
                     if each.left_out] + [f"{key}: {why}" for key, why in COMPILED_IN.items()],
    }  # fmt: skip
    text = table.aligned()
    for title, lines in lists.items():
        text += "\n".join([f"\n\n{title}: {len(lines)}", *lines])
    (folder / "table.txt").write_text(text + "\n", "utf-8")


def effects_of(found: dict) -> list[dict]:
    """Return the effects of all changes of a constant."""
    return [found[name] for name in FACTORS if name in found]


def changes_nothing(found: dict) -> bool:
    """Return True if no run differs by a bit."""
    return not any(each["bits"] or each["wrong"] for each in effects_of(found))


def changes_little(found: dict) -> bool:
    """Return True if some bits differ, but no outcome or position, and steps by less than LITTLE
    in all."""
    ratios = ("steps", "steps of replicates", "mean")
    return not changes_nothing(found) and not any(
        each["outcomes"] or each["moved"] or each["wrong"]
        or any(abs(each.get(name, 1.0) - 1.0) > LITTLE for name in ratios)
        for each in effects_of(found)
    )  # fmt: skip


def print_list(constants: list) -> None:
    """Print all constants with value, place, and whether they are documented."""
    columns = ("constant", "file:line", "value", "documented", "kind")
    table = Table("Numeric constants", columns)
    for each in constants:
        place = f"{each.module.replace('.', '/')}:{each.line}"
        known = "yes" if each.documented else "no"
        table.rows.append([each.key, place, each.text[:50], known, each.left_out or each.kind])
    table.print()
    kinds = Counter(each.kind for each in constants)
    print(", ".join(f"{count} {kind}" for kind, count in kinds.items()))


def run_package(folder: Path, scenes: int, replicates: int) -> None:
    """Store the digests of all runs of the package itself."""
    runs = Runs(folder, scenes, replicates)
    digests = []
    for number in range(runs.count):
        runs.prepare(number, True)
        digests.append(runs.run(number).digest)
    (folder / "package.json").write_text(json.dumps(digests), "utf-8")


def start(folder: Path, place: Path, *words: object) -> None:
    """Run a part of this benchmark in a process of the package at a place."""
    command = [sys.executable, "-m", "benchmarks.accuracy.constants", *map(str, words)]
    variables = {"PYTHONPATH": str(place), "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run(command, cwd=place, env={**os.environ, **variables}, check=True)


def main() -> None:
    """List the constants, or run their changes and print the table."""
    options = begin(
        __doc__, list=False, scenes=120, replicates=60, limit=40.0,
        constants={"nargs": "+", "default": []}, folder="constants-results",
        part={"choices": ["package", "copy"], "help": "used by this benchmark itself"},
    )  # fmt: skip
    folder = Path(options.folder).resolve()
    run_of = functools.partial(start, folder, ROOT)
    shared = ["--folder", folder, "--scenes", options.scenes, "--replicates", options.replicates]
    if options.part == "package":
        run_package(folder, options.scenes, options.replicates)
        return
    if options.part == "copy":
        work(folder, options.scenes, options.replicates, options.limit, options.constants)
        return
    constants = all_constants()
    if options.list:
        print_list(constants)
        return
    folder.mkdir(parents=True, exist_ok=True)
    wanted = [each for each in constants if is_wanted(each, options.constants)]
    if {each.key for each in wanted} <= {each["key"] for each in stored(folder)}:
        write_table(folder, constants)
        print((folder / "table.txt").read_text("utf-8"))
        return
    make_copy(folder / "copy", [each for each in constants if not each.left_out])
    (folder / "constants.pickle").write_bytes(pickle.dumps(constants))
    run_of("--part", "package", *shared)
    chosen = ["--constants", *options.constants] if options.constants else []
    start(folder, folder / "copy", "--part", "copy", *shared, "--limit", options.limit, *chosen)
    print((folder / "table.txt").read_text("utf-8"))


if __name__ == "__main__":
    main()
