"""One output file, and all that may happen to it in any order: runs, kills, signals, edits, second
jobs, full disks, other files in its place, moves of its folder. After every step all rows are
compared with those of fresh runs, the same for every kind of study.

Every run is a child of this process, so that a kill is a real one and nothing has to be imported;
replicates take some time more than they do, so that kills come in between.
"""

import contextlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import time
from functools import cached_property
from itertools import product
from pathlib import Path

import attrs
import numpy as np

from flocsim.__main__ import main
from flocsim.ensembles.config.loader import load_any_config
from flocsim.ensembles.config.sources import digest_of
from flocsim.ensembles.kind import ROW
from flocsim.ensembles.storage.identity import short
from flocsim.ensembles.study import Study
from flocsim.ensembles.swarms.study import SwarmStudy
from flocsim.errors import FileError
from flocsim.io.journal import PART
from flocsim.io.results.file import read_results
from flocsim.io.results.swarm_file import read_swarm
from flocsim.process import install
from tests.helpers.journals import computed_in, records_in, rows_in
from tests.helpers.small_study import write_star_library

PAIRS = """\
preset = "tang2014"
seed = {seed}
replicates = {replicates}
[scene]
pairs = "measured"
delta = {delta}
[shapes]
source = "library"
file = "stars.h5"
vertices = [1]
[fluid]
viscosity = "{viscosity} mPa s"
[forces.mine]
class = "own_pull:Pull"
[output]
file = "out.h5"
"""
RATES = """\
preset = "si"
seed = {seed}
replicates = {replicates}
[scene]
kind = "kernel"
meeting = ["settling"]
sizes = ["5 um", "12 um"]
scrambles = 2
[shapes]
source = "library"
file = "stars.h5"
vertices = [1]
[fluid]
viscosity = "{viscosity} mPa s"
[forces.mine]
class = "own_pull:Pull"
[output]
file = "out.h5"
"""
SWARMS = """\
preset = "si"
seed = {seed}
replicates = {replicates}
[scene]
kind = "swarm"
number = 6
area_fraction = 0.1
duration = "0.15 s"
every = "0.05 s"
[shapes]
source = "library"
file = "stars.h5"
vertices = [1]
[fluid]
viscosity = "{viscosity} mPa s"
[forces]
van_der_waals = false
double_layer = false
[forces.mine]
class = "own_pull:Pull"
[output]
file = "out.h5"
"""
OWN = """\
import attrs
from flocsim.forces import SurfaceForce
from neighbour import FACTOR


@attrs.frozen
class Pull(SurfaceForce):
    @property
    def reach(self):
        return 1e-6

    @staticmethod
    def kernel(pair, reach):
        return FACTOR * 1e-9 * (1.0 - pair.gap / reach)
"""
TEXTS = {"pairs": PAIRS, "rates": RATES, "swarms": SWARMS}
DELTAS = ((0.0,), (0.5,), (0.0, 0.5))
REPLICATES = {"pairs": range(1, 17), "rates": (2, 4, 8, 16), "swarms": range(1, 5)}
"""How many replicates a config may ask for."""

CHOICES = {
    "seed": (1, 2), "viscosity": (0.8, 1.0), "factor": ("-1e-3", "-2e-3"),
    "library": ((4.0, 6.0, 9.0), (4.0, 6.0, 12.0)),
}  # fmt: skip
"""What rows follow from, and what it may be."""

DONE = (0, 65)
ALLOWED = (*DONE, 2, 74, 75)
SLOWER = 0.01
"""Seconds that a replicate takes more."""

LONGEST = 600.0
"""Seconds after which a command hangs."""

ORPHANED = 60.0
"""Seconds within which all that a command started has ended."""


@attrs.frozen
class Physics:
    """What rows follow from."""

    seed: int = 1
    viscosity: float = 0.8
    factor: str = "-1e-3"
    library: tuple = (4.0, 6.0, 9.0)


@attrs.define
class Asked:
    """What the config asks for besides."""

    replicates: int = 2
    delta: tuple = (0.0,)


class Wrong(AssertionError):
    """Something that may not be."""


def demand(holds, words):
    if not holds:
        raise Wrong(words)


@attrs.define(eq=False)
class Truths:
    """Rows of fresh runs in a folder, one for each Physics that was asked for."""

    kind: str
    folder: Path
    known: dict = attrs.Factory(dict)

    def of(self, physics):
        """The results of all replicates and displacements."""
        if physics not in self.known:
            home = self.folder / f"truth-{len(self.known)}"
            home.mkdir(exist_ok=True)
            write(home, self.kind, physics, Asked(REPLICATES[self.kind][-1], DELTAS[-1]))
            if not self.known:
                self.load(home)
            child = Child(home, ["ensemble", "study.toml", "--quiet"], slower=0.0)
            demand(child.end() in DONE, child.said())
            self.known[physics] = Found.at(home / "out.h5", self.kind)
        return self.known[physics]

    def load(self, home):
        """Import and load here what every child needs then."""
        words = ["ensemble", str(home / "study.toml"), "-o", str(home / "first.h5"), "--quiet"]
        demand(main(words) in DONE, "the study cannot be run")

    def by_identity(self, key):
        """The Physics with this short identity, among those that were asked for."""
        return next((each for each, found in self.known.items() if found.key == key), None)


def write(folder, kind, physics, asked):
    """The config, the modules and the library."""
    values = {"seed": physics.seed, "viscosity": physics.viscosity}
    text = TEXTS[kind].format(**values, replicates=asked.replicates, delta=list(asked.delta))
    put(folder / "study.toml", text.encode())
    put(folder / "own_pull.py", OWN.encode())
    put(folder / "neighbour.py", f"FACTOR = {physics.factor}\n".encode())
    fresh = folder / "fresh.h5"
    write_star_library(fresh, vertices=(1, 4), ratios=physics.library)
    os.replace(fresh, folder / "stars.h5")


def put(path, data):
    """A file as editors write it: whole."""
    fresh = path.with_name(f"{path.name}.fresh")
    fresh.write_bytes(data)
    os.replace(fresh, path)


@attrs.define(eq=False)
class Found:
    """A results file: what it says it is of, and its rows."""

    run: dict
    rows: dict
    """{(condition, replicate): bytes of all columns}."""

    @classmethod
    def at(cls, path, kind):
        """The file at a path; FileError where there is none that can be read."""
        if kind == "swarms":
            found = read_swarm(path)
            columns = [
                found.groups[name][column] for name in ("counts", "snapshots", "bodies", "ends")
                for column in sorted(found.kind.groups[name].columns)
            ]  # fmt: skip
            numbers = found.scales["replicate"].tolist()
            condition = name_of("swarm", int(found.run["vertices"]), 0.0)
            rows = {(condition, k): b"".join(np.ascontiguousarray(each[place]).tobytes()
                                       for each in columns)
                    for place, k in enumerate(numbers)}  # fmt: skip
            return cls(found.run, rows)
        results = read_results(path)
        axes = results.types, results.vertices.tolist(), results.delta.tolist()
        rows = {
            (name_of(*condition), k): row_bytes(
                {name: each[(*place, k)] for name, each in results.replicates.items()}
            )
            for condition, place in zip(product(*axes), product(*map(indices, axes)), strict=True)
            for k in range(results.count)
        }
        return cls(results.run, rows)

    @cached_property
    def key(self):
        return short(json.loads(self.run["identity"]))


def name_of(*condition):
    """A condition as the journal names it."""
    return json.dumps(condition)


def indices(axis):
    return range(len(axis))


def row_bytes(row):
    """A row of the table of replicates as bytes; reasons are numbered by each file."""
    return b"".join(np.array(row[name], ROW[name]).tobytes() for name in ROW.names
                    if name != "failure")  # fmt: skip


class Child:
    """A command in a process group of its own."""

    def __init__(self, folder, words, slower=SLOWER, disk=None):
        self.folder, self.words = folder, words
        self.out = folder / f"said-{time.monotonic_ns()}"
        # A signal that comes before it is ready waits until then.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        self.pid = os.fork()
        if self.pid:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        else:
            code = 70
            try:
                os.setsid()
                os.chdir(folder)
                descriptor = os.open(self.out, os.O_CREAT | os.O_WRONLY)
                os.dup2(descriptor, 1)
                os.dup2(descriptor, 2)
                sys.stdout = sys.stderr = open(descriptor, "w", closefd=False)  # noqa: SIM115
                sys.argv = ["flocsim", *words]
                for name in ("own_pull", "neighbour"):
                    sys.modules.pop(name, None)
                slow_down(slower)
                if disk is not None:  # no file may be longer, as though the disk were full then
                    resource.setrlimit(resource.RLIMIT_FSIZE, (disk, disk))
                install()
                signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
                code = main(words)
            except SystemExit as end:
                code = end.code
            finally:
                sys.stdout.flush()
                os._exit(70 if code is None else code)

    def signal(self, number):
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def end(self):
        """Wait for it: its exit code, less than 0 of a signal; nobody of its group is left."""
        until, status = time.monotonic() + LONGEST, None
        while status is None and time.monotonic() < until:
            pid, found = os.waitpid(self.pid, os.WNOHANG)
            status = found if pid else None
            time.sleep(0.002)
        if status is None:
            os.killpg(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
            raise Wrong(f"{self.words} hangs: {self.said()}")
        until = time.monotonic() + ORPHANED
        while (left := group(self.pid)) and time.monotonic() < until:
            time.sleep(0.02)
        if left:
            os.killpg(self.pid, signal.SIGKILL)
            raise Wrong(f"{self.words} leaves {left}")
        return os.waitstatus_to_exitcode(status)

    def said(self):
        return self.out.read_text("utf-8", "replace") if self.out.exists() else ""


def slow_down(seconds):
    """Let a replicate take some time more."""
    for study in (Study, SwarmStudy):
        original = study.run_task

        def run_task(*words, original=original, **more):
            time.sleep(seconds)
            return original(*words, **more)

        study.run_task = run_task


def group(number):
    """The processes of a group that run."""
    found = []
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            with contextlib.suppress(OSError):
                text = Path(f"/proc/{entry}/stat").read_text()
                state, _, of, *_ = text.rpartition(")")[2].split()
                if int(of) == number and state != "Z":
                    found.append(int(entry))
    return found


@attrs.define(eq=False)
class World:
    """A folder with a study, and what may happen to it; ``steps`` says what has."""

    kind: str
    folder: Path
    truths: Truths
    rng: random.Random
    physics: Physics = attrs.Factory(Physics)
    asked: Asked = attrs.Factory(Asked)
    steps: list = attrs.Factory(list)

    @property
    def output(self):
        return self.folder / "out.h5"

    @property
    def journal(self):
        return self.folder / "out.h5.journal"

    def go(self, steps):
        """Take these steps, of STEPS; Wrong, with those so far, where something is."""
        write(self.folder, self.kind, self.physics, self.asked)
        self.truths.of(self.physics)
        for step in steps:
            before = self.tasks()
            self.steps.append([step.__name__])
            try:
                given_up = step(self) or set()
                after = self.tasks()
                lost = before - after - given_up
                demand(not lost, f"finished tasks are lost: {sorted(lost)[:3]}")
            except Wrong as error:
                raise Wrong(f"{self.steps}: {error}") from error

    # What is there ----------------------------------------------------------------------------

    def tasks(self):
        """{(identity, condition, replicate)} of all that any file has, which has to be right."""
        found = set()
        for path in self.folder.iterdir():
            if path.suffix == ".journal":
                found |= self.tasks_of_journal(path)
            elif path.name.startswith("out") and path.suffix == ".h5":
                found |= self.tasks_of_results(path)
        return found

    def tasks_of_results(self, path):
        try:
            found = Found.at(path, self.kind)
        except FileError:
            return set()  # garbage that was put there, or a file of another kind
        physics = self.truths.by_identity(found.key)
        demand(physics is not None, f"{path.name} is of no physics that there was")
        truth = self.truths.of(physics)
        for task, row in found.rows.items():
            demand(truth.rows.get(task) == row, f"{path.name} has a row of other physics: {task}")
        config = self.folder / "label.toml"
        config.write_text(str(found.run["config"]), "utf-8")
        for name in ("own_pull", "neighbour"):
            sys.modules.pop(name, None)
        label = load_any_config(config)
        demand(label.seed == physics.seed, f"{path.name} has the config of another seed")
        viscosity = label.fluid.viscosity
        demand(abs(1e3 * viscosity - physics.viscosity) < 1e-9, "the config of another viscosity")
        kept = json.loads(found.run["modules"])["neighbour.py"]
        source = f"FACTOR = {physics.factor}\n"
        demand(kept == {"digest": digest_of(source.encode()), "source": source},
               f"{path.name} keeps the source of another module")  # fmt: skip
        return {(found.key, *task) for task in found.rows}

    def tasks_of_journal(self, path):
        found = set()
        for each in computed_in(path):
            key, first = each["identity"], each["first"]
            found |= {(key, each["condition"], first + k) for k in range(each["count"])}
            physics = self.truths.by_identity(key)
            demand(physics is not None, f"{path.name} is of no physics that there was")
            if self.kind != "swarms":
                rows = np.frombuffer(each["data"], ROW)
                truth = self.truths.of(physics)
                for k in range(each["count"]):
                    known = truth.rows.get((each["condition"], first + k))
                    demand(known == row_bytes(rows[k]), f"{path.name} has a row of other physics")
        return found

    # What happens -----------------------------------------------------------------------------

    def words(self, mode=None):
        modes = [[], ["--resume"], ["--resume"], ["--resume"], ["--restart"], ["--overwrite"],
                 ["--resume", "--overwrite"]]  # fmt: skip
        mode = self.rng.choice(modes) if mode is None else mode
        self.steps[-1] += mode
        return ["ensemble", "study.toml", "--quiet", *mode]

    def must_work(self, words):
        """Whether the command has no reason to refuse: all that is there is of this study."""
        key, mine = self.truths.of(self.physics).key, self.wanted()
        if "--resume" not in words:
            return not self.output.exists() and not self.journal.exists()
        journal = self.tasks_of_journal(self.journal) if self.journal.exists() else set()
        if self.others_begun(key):
            return False
        there = set()
        if self.output.exists():
            there = self.tasks_of_results(self.output)
            if not there and "--overwrite" not in words:
                return False
        return {each for each in journal | there if each[0] == key} == journal | there and {
            each[1:] for each in journal | there
        } <= mine

    def others_begun(self, key):
        """Whether the journal has a part of a swarm of another study, which is refused as its
        finished tasks are."""
        if not self.journal.exists():
            return False
        return any(each["identity"] != key for each in records_in(self.journal, PART))

    def wanted(self):
        every = {condition for condition, _ in self.truths.of(self.physics).rows}
        if self.kind == "pairs":
            every = {each for each in every if json.loads(each)[2] in self.asked.delta}
        return {(condition, k) for condition in every for k in range(self.asked.replicates)}

    def judge(self, child, code, possible, must=False):
        """Hold what a command that ran with one of the ``possible`` Physics has left."""
        said = child.said()
        demand("Traceback" not in said and "internal error" not in said, said)
        demand(code in ALLOWED, f"exit code {code}: {said}")
        lines = [each for each in said.splitlines()
                 if not each.startswith("flocsim: warning: ") and each]  # fmt: skip
        demand(code == 0 or len(lines) <= 4, f"exit code {code} in many lines: {said}")
        demand(not must or code in DONE, f"refused without a reason: {said}")
        if code in DONE:
            found = Found.at(self.output, self.kind)
            keys = {self.truths.of(each).key for each in possible}
            demand(found.key in keys, "the results are of another physics than was asked for")
            demand(self.wanted() <= set(found.rows), "rows that were asked for are missing")

    def run(self):
        words = self.words()
        must, stamp = self.must_work(words), self.stamp()
        known = self.tasks_of(self.output) | self.tasks_of(self.journal)
        child = Child(self.folder, words)
        code = child.end()
        self.judge(child, code, {self.physics}, must)
        if code in DONE and words[-1] == "--resume" and self.stamp() != stamp:
            computed, key = int(Found.at(self.output, self.kind).run["computed"]), self.truths.of(
                self.physics
            ).key  # fmt: skip
            fresh = {each for each in self.wanted() if (key, *each) not in known}
            demand(computed <= len(fresh) or not must, f"{computed} were run, {len(fresh)} missing")

    def stamp(self):
        return os.stat(self.output).st_ino if self.output.exists() else 0

    def resume(self):
        words = self.words(["--resume"])
        must = self.must_work(words)
        child = Child(self.folder, words)
        self.judge(child, child.end(), {self.physics}, must)

    def resume_on_other_ranks(self):
        words = [*self.words(["--resume"]), "--jobs", "2"]
        must = self.must_work(words)
        child = Child(self.folder, words)
        self.judge(child, child.end(), {self.physics}, must)

    def extend(self):
        more = [each for each in REPLICATES[self.kind] if each > self.asked.replicates]
        self.asked.replicates = self.rng.choice(more[:4] or [self.asked.replicates])
        write(self.folder, self.kind, self.physics, self.asked)
        self.resume()

    def ask(self):
        """Edit what the config asks for, and nothing that rows follow from."""
        self.asked.replicates = self.rng.choice(REPLICATES[self.kind])
        self.asked.delta = self.rng.choice(DELTAS)
        write(self.folder, self.kind, self.physics, self.asked)

    def ask_and_resume(self):
        self.ask()
        self.resume()

    def edited(self, *names):
        name = self.rng.choice(names)
        self.steps[-1] += [name]
        other = next(each for each in CHOICES[name] if each != getattr(self.physics, name))
        self.physics = attrs.evolve(self.physics, **{name: other})
        self.truths.of(self.physics)
        write(self.folder, self.kind, self.physics, self.asked)

    def edit_config(self):
        self.edited("seed", "viscosity")

    def edit_module(self):
        self.edited("factor")

    def edit_library(self):
        self.edited("library")

    def begun(self):
        """A command that has run for some time, as often as not until it has kept something."""
        child = Child(self.folder, self.words())
        wait = self.rng.choice([0.0, 0.05, 0.1, 0.2, 0.3, 0.5]) * self.rng.random()
        until = time.monotonic() + 5.0
        if self.rng.random() < 0.6:
            while time.monotonic() < until and not self.has_kept() and child_runs(child):
                time.sleep(0.002)
        time.sleep(wait)
        return child

    def has_kept(self):
        with contextlib.suppress(OSError):
            return rows_in(self.journal) > 0
        return False

    def kill(self):
        child = self.begun()
        child.signal(signal.SIGKILL)
        code = child.end()
        demand(code in (-signal.SIGKILL, *ALLOWED), f"exit code {code}: {child.said()}")

    def interrupt(self):
        self.stopped_by(signal.SIGINT)

    def terminate(self):
        self.stopped_by(signal.SIGTERM)

    def stopped_by(self, number):
        child = self.begun()
        child.signal(number)
        code = child.end()
        # A signal that comes before flocsim listens ends it as it ends any program.
        self.judge(child, 75 if code == -number else code, {self.physics})

    def suspend_and_continue(self):
        child = self.begun()
        child.signal(signal.SIGSTOP)
        time.sleep(self.rng.random())
        child.signal(signal.SIGCONT)
        self.judge(child, child.end(), {self.physics})

    def full_disk(self):
        sizes = [each.stat().st_size for each in self.folder.glob("out.h5*")]
        disk = max([30_000, *sizes]) + self.rng.randrange(60_000)
        child = Child(self.folder, self.words(["--resume"]), disk=disk)
        self.judge(child, child.end(), {self.physics})

    def move(self):
        """Rename the folder, as often as not under a run."""
        child = self.begun() if self.rng.random() < 0.5 else None
        while child is not None and not child.out.exists() and child_runs(child):
            time.sleep(0.002)  # until it is in the folder
        moved = self.folder.with_name(f"{self.folder.name}-moved")
        self.folder.rename(moved)
        if child is not None:
            child.folder, child.out = moved, moved / child.out.name
            code, said = child.end(), child.said()
            demand("Traceback" not in said and "internal error" not in said, said)
            demand(code in ALLOWED, f"exit code {code}: {said}")
        self.folder = moved

    def edit_while_it_runs(self):
        child, before = self.begun(), self.physics
        self.edited(*CHOICES)
        # Files are edited one after the other: a run may read some of them before.
        self.judge(child, child.end(), {before, self.physics})

    def second_job(self):
        words = [self.words(), self.words()]
        must = all(self.must_work(each) for each in words)
        children = [Child(self.folder, words[0])]
        time.sleep(self.rng.choice([0.0, 0.1, 0.3]) * self.rng.random())
        children.append(Child(self.folder, words[1]))
        codes = [child.end() for child in children]
        for child, code in zip(children, codes, strict=True):
            self.judge(child, code, {self.physics})
        demand(not must or set(codes) & {*DONE}, "two jobs refuse each other")

    def replace(self):
        """Put something else into the place of the results, or of the journal."""
        what = self.rng.choice(["other", "garbage", "nothing", "cut", "no journal"])
        self.steps[-1] += [what]
        path = self.journal if what == "no journal" else self.output
        gone = self.tasks_of(path)
        if what == "other":
            place = self.rng.randrange(len(self.truths.known))
            shutil.copy(self.truths.folder / f"truth-{place}" / "out.h5", self.folder / "new")
            os.replace(self.folder / "new", self.output)
        elif what == "garbage":
            put(self.output, b"no results")
        elif what == "cut" and self.output.exists():
            put(self.output, self.output.read_bytes()[:-100])
        elif what in ("nothing", "no journal"):
            path.unlink(missing_ok=True)
        return gone

    def tasks_of(self, path):
        if not path.exists():
            return set()
        is_journal = path == self.journal
        try:
            return self.tasks_of_journal(path) if is_journal else self.tasks_of_results(path)
        except FileNotFoundError:  # a run that ends takes its journal away
            return set()

    def replace_while_it_runs(self):
        child = self.begun()
        gone = self.replace()
        code = child.end()
        said = child.said()
        demand("Traceback" not in said and "internal error" not in said, said)
        demand(code in ALLOWED, f"exit code {code}: {said}")
        return gone


def child_runs(child):
    """Whether it has not ended; it is not waited for."""
    with contextlib.suppress(OSError, ValueError):
        return Path(f"/proc/{child.pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


STEPS = [
    World.run, World.run, World.resume, World.resume, World.extend, World.ask,
    World.ask_and_resume, World.edit_config, World.edit_module, World.edit_library, World.kill,
    World.kill, World.interrupt, World.terminate, World.suspend_and_continue,
    World.edit_while_it_runs, World.second_job, World.replace, World.replace_while_it_runs,
    World.full_disk, World.move,
]  # fmt: skip
