"""One output file, and all that may happen to it in any order: runs, kills, signals, edits, second
jobs, full disks, other files in its place, moves of its folder. After every event all rows are
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
from flocsim.io.results.swarm_file import SWARMS
from flocsim.process import install
from tests.helpers.journals import computed_in, records_in, rows_in
from tests.helpers.small_study import write_star_library

TEXT = """\
preset = "{preset}"
seed = {seed}
replicates = {replicates}
[scene]
{scene}
[shapes]
source = "library"
file = "stars.h5"
vertices = [1]
[fluid]
viscosity = "{viscosity} mPa s"
[forces]
{forces}
[forces.mine]
class = "own_pull:Pull"
[output]
file = "out.h5"
"""
KINDS = {
    "pairs": {"preset": "tang2014", "scene": 'pairs = "measured"\ndelta = {delta}', "forces": ""},
    "rates": {
        "preset": "si",
        "scene": 'kind = "kernel"\nmeeting = ["settling"]\nsizes = ["5 um", "12 um"]\n'
        "scrambles = 2",
        "forces": "",
    },
    "swarms": {
        "preset": "si",
        "scene": 'kind = "swarm"\nnumber = 6\narea_fraction = 0.1\nduration = "0.15 s"\n'
        'every = "0.05 s"',
        "forces": "van_der_waals = false\ndouble_layer = false",
    },
}
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
MODULES = "own_pull", "neighbour"
DELTAS = ((0.0,), (0.5,), (0.0, 0.5))
REPLICATES = {"pairs": range(1, 17), "rates": (2, 4, 8, 16), "swarms": range(1, 5)}
"""How many replicates a config may ask for."""

CHOICES = {
    "seed": (1, 2), "viscosity": (0.8, 1.0), "factor": ("-1e-3", "-2e-3"),
    "library": ((4.0, 6.0, 9.0), (4.0, 6.0, 12.0)),
}  # fmt: skip
"""What rows follow from, and what it may be."""

RESUME = ("--resume",)
MODES = ((), RESUME, RESUME, RESUME, ("--restart",), ("--overwrite",), ("--resume", "--overwrite"))

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
            write(home, self.kind, physics, REPLICATES[self.kind][-1], DELTAS[-1])
            if not self.known:  # import and load here what every child needs then
                words = ["ensemble", f"{home}/study.toml", "-o", f"{home}/first.h5", "--quiet"]
                demand(main(words) in DONE, "the study cannot be run")
            child = Child(home, ["ensemble", "study.toml", "--quiet"], slower=0.0)
            demand(child.end() in DONE, child.said())
            self.known[physics] = Found.at(home / "out.h5", self.kind)
        return self.known[physics]

    def by_identity(self, key):
        """The Physics with this short identity among those that were asked for; Wrong for none."""
        physics = next((each for each, found in self.known.items() if found.key == key), None)
        demand(physics is not None, "rows of no physics that there was")
        return physics


def write(folder, kind, physics, replicates, delta):
    """The config, the modules and the library, each put in place whole, as editors do."""
    values = {"replicates": replicates, "delta": list(delta)} | attrs.asdict(physics)
    values |= {name: text.format(**values) for name, text in KINDS[kind].items()}
    files = {
        "study.toml": TEXT.format(**values),
        "own_pull.py": OWN,
        "neighbour.py": f"FACTOR = {physics.factor}\n",
    }
    for name, text in files.items():
        put(folder / name, text.encode())
    write_star_library(folder / "fresh.h5", vertices=(1, 4), ratios=physics.library)
    os.replace(folder / "fresh.h5", folder / "stars.h5")


def put(path, data):
    fresh = path.with_name(f"{path.name}.fresh")
    fresh.write_bytes(data)
    os.replace(fresh, path)


@attrs.frozen(eq=False)
class Found:
    """A results file: the group ``run``, the short identity in it, and the bytes of its rows,
    {(condition as the journal names it, replicate): bytes of all columns}."""

    run: dict
    key: str
    rows: dict

    @classmethod
    def at(cls, path, kind):
        """The file at a path; FileError where there is none that can be read."""
        if kind == "swarms":
            found = SWARMS.read(path)
            condition = json.dumps(["swarm", int(found.run["vertices"]), 0.0])
            columns = [
                found.groups[group][name] for group in ("counts", "snapshots", "bodies", "ends")
                for name in sorted(found.kind.groups[group].columns)
            ]  # fmt: skip
            rows = {
                (condition, k): b"".join(each[place].tobytes() for each in columns)
                for place, k in enumerate(found.scales["replicate"].tolist())
            }
        else:
            found = read_results(path)
            axes = found.types, found.vertices.tolist(), found.delta.tolist()
            table = np.zeros((*map(len, axes), found.count), ROW)
            for name in set(ROW.names) - {"failure"}:  # reasons are numbered by each file
                table[name] = found.replicates[name]
            names = [json.dumps(condition) for condition in product(*axes)]
            keys = product(names, range(found.count))
            rows = dict(zip(keys, (row.tobytes() for row in table.ravel()), strict=True))
        return cls(found.run, short(json.loads(found.run["identity"])), rows)


class Child:
    """A command in a process group of its own; ``sent`` is the signal that was sent to it."""

    sent = 0

    def __init__(self, folder, words, slower=SLOWER, disk=None):
        self.words, self.out = words, folder / f"said-{time.monotonic_ns()}"
        # A signal that comes before it is ready waits until then.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        self.pid = os.fork()
        if self.pid:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
            return
        code = 70
        try:
            os.setsid()
            os.chdir(folder)
            descriptor = os.open(self.out, os.O_CREAT | os.O_WRONLY)
            os.dup2(descriptor, 1)
            os.dup2(descriptor, 2)
            sys.stdout = sys.stderr = open(descriptor, "w", closefd=False)  # noqa: SIM115
            sys.argv = ["flocsim", *words]
            forget_modules()
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
        self.sent = number
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.pid, number)

    def runs(self):
        """Whether it has not ended; it is not waited for."""
        return state_of(self.pid)[0] not in "Z "

    def end(self):
        """Wait for it: its exit code, less than 0 of a signal; nobody of its group is left."""
        wait_until(lambda: not self.runs(), LONGEST)
        hangs = self.runs()
        if not hangs:
            status = os.waitpid(self.pid, 0)[1]
            wait_until(lambda: not group(self.pid), ORPHANED)
        if left := group(self.pid):
            os.killpg(self.pid, signal.SIGKILL)
            if hangs:
                os.waitpid(self.pid, 0)
            raise Wrong(f"{self.words} {'hangs' if hangs else f'leaves {left}'}: {self.said()}")
        return os.waitstatus_to_exitcode(status)

    def said(self):
        return self.out.read_text("utf-8", "replace") if self.out.exists() else ""


def wait_until(holds, seconds):
    """Wait until something holds, for so many seconds at most."""
    until = time.monotonic() + seconds
    while not holds() and time.monotonic() < until:
        time.sleep(0.01)


def forget_modules():
    for name in MODULES:
        sys.modules.pop(name, None)


def slow_down(seconds):
    """Let a replicate take some time more."""
    for study in (Study, SwarmStudy):

        def run_some(*words, original=study.run_some, **more):
            time.sleep(seconds)
            return original(*words, **more)

        study.run_some = run_some


def state_of(pid):
    """(state, process group) of a process, (" ", 0) of none."""
    with contextlib.suppress(OSError):
        state, _, of, *_ = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return state, int(of)
    return " ", 0


def group(number):
    """The processes of a group that have not ended."""
    try:
        os.killpg(number, 0)
    except ProcessLookupError:
        return []
    states = {int(name): state_of(name) for name in os.listdir("/proc") if name.isdigit()}
    return [pid for pid, (state, of) in states.items() if of == number and state != "Z"]


@attrs.define(eq=False)
class World:
    """A folder with a study that asks for ``replicates`` at each ``delta``, and what may happen to
    it; ``steps`` says what has."""

    kind: str
    folder: Path
    truths: Truths
    rng: random.Random
    physics: Physics = attrs.Factory(Physics)
    replicates: int = 2
    delta: tuple = (0.0,)
    steps: list = attrs.Factory(list)
    seen: dict = attrs.Factory(dict)
    """{what tells two results files apart: the tasks in it}, so that each is checked once."""

    @property
    def output(self):
        return self.folder / "out.h5"

    @property
    def journal(self):
        return self.folder / "out.h5.journal"

    def go(self, names):
        """Let these EVENTS happen; Wrong, with those so far, where something is."""
        self.write()
        for name in names:
            before = self.tasks()
            self.steps.append([name])
            try:
                given_up = EVENTS[name][1](self) or set()
                lost = before - self.tasks() - given_up
                demand(not lost, f"finished tasks are lost: {sorted(lost)[:3]}")
            except Wrong as error:
                raise Wrong(f"{self.steps}: {error}") from error

    def write(self):
        self.truths.of(self.physics)
        write(self.folder, self.kind, self.physics, self.replicates, self.delta)

    # What is there ----------------------------------------------------------------------------

    def tasks(self):
        """{(identity, condition, replicate)} of all that any file has, which has to be right."""
        return set().union(*map(self.tasks_of, self.folder.glob("out*")))

    def tasks_of(self, path):
        """The tasks in one file; none where it is gone by now, garbage, or of another kind."""
        if path.suffix == ".journal":
            return self.tasks_of_journal(path)
        if path.suffix != ".h5":
            return set()
        try:
            about = os.stat(path)
            mark = about.st_ino, about.st_mtime_ns, about.st_size
            if mark not in self.seen:
                self.seen[mark] = self.tasks_of_results(path)
            return self.seen[mark]
        except (FileError, FileNotFoundError):
            return set()

    def tasks_of_results(self, path):
        found = Found.at(path, self.kind)
        physics = self.truths.by_identity(found.key)
        truth = self.truths.of(physics)
        for task, row in found.rows.items():
            demand(truth.rows.get(task) == row, f"{path.name} has a row of other physics: {task}")
        # The config and the module that it keeps are those of its rows.
        config = self.folder / "label.toml"
        config.write_text(str(found.run["config"]), "utf-8")
        forget_modules()
        label = load_any_config(config)
        demand(label.seed == physics.seed, f"{path.name} has the config of another seed")
        viscosity = label.fluid.viscosity
        demand(abs(1e3 * viscosity - physics.viscosity) < 1e-9, "the config of another viscosity")
        source = f"FACTOR = {physics.factor}\n"
        kept = {"digest": digest_of(source.encode()), "source": source}
        modules = json.loads(found.run["modules"])
        demand(modules["neighbour.py"] == kept, f"{path.name} keeps the source of another module")
        return {(found.key, *task) for task in found.rows}

    def tasks_of_journal(self, path):
        found = set()
        for each in computed_in(path):
            truth = self.truths.of(self.truths.by_identity(each["identity"])).rows
            tasks = [(each["condition"], each["first"] + k) for k in range(each["count"])]
            found |= {(each["identity"], *task) for task in tasks}
            if self.kind != "swarms":  # of these the parts have what is compared
                rows = np.frombuffer(each["data"], ROW).copy()
                rows["failure"] = 0
                same = [truth.get(task) for task in tasks] == [row.tobytes() for row in rows]
                demand(same, f"{path.name} has a row of other physics")
        return found

    def wanted(self):
        """{(condition, replicate)} of all that the config asks for."""
        every = {condition for condition, _ in self.truths.of(self.physics).rows}
        if self.kind == "pairs":
            every = {each for each in every if json.loads(each)[2] in self.delta}
        return set(product(every, range(self.replicates)))

    def must_work(self, mode):
        """Whether a command has no reason to refuse: all that is there is of this study."""
        if "--resume" not in mode:
            return not self.output.exists() and not self.journal.exists()
        key = self.truths.of(self.physics).key
        # A part of a swarm of another study is refused as its finished tasks are.
        begun = records_in(self.journal, PART) if self.journal.exists() else []
        results = self.tasks_of(self.output)
        is_other = self.output.exists() and not results and "--overwrite" not in mode
        there = results | self.tasks_of(self.journal)
        mine = {(key, *task) for task in self.wanted()}
        return not is_other and there <= mine and all(each["identity"] == key for each in begun)

    # What happens -----------------------------------------------------------------------------

    def start(self, mode=None, *more, disk=None):
        """A command with these options, or any: its Child."""
        mode = self.rng.choice(MODES) if mode is None else mode
        self.steps[-1] += mode
        return Child(self.folder, ["ensemble", "study.toml", "--quiet", *mode, *more], disk=disk)

    def judge(self, child, *possible, must=False):
        """Wait for a command, and check what it has said and left; the results are of one of the
        ``possible`` Physics, unless something else was put into their place."""
        code, said = child.end(), child.said()
        demand("Traceback" not in said and "internal error" not in said, said)
        demand(code in ALLOWED or code == -child.sent, f"exit code {code}: {said}")
        lines = [line for line in said.splitlines() if not line.startswith("flocsim: warning: ")]
        demand(code == 0 or len(lines) <= 4, f"exit code {code} in many lines: {said}")
        demand(not must or code in DONE, f"refused without a reason: {said}")
        if code in DONE and possible:
            found = Found.at(self.output, self.kind)
            keys = {self.truths.of(each).key for each in possible}
            demand(found.key in keys, "the results are of another physics than was asked for")
            demand(self.wanted() <= set(found.rows), "rows that were asked for are missing")
        return code

    def command(self, mode=None, *more):
        """Run a command to its end: it runs what is missing, and nothing else."""
        mode = self.rng.choice(MODES) if mode is None else mode
        must, key = self.must_work(mode), self.truths.of(self.physics).key
        known = self.tasks_of(self.output) | self.tasks_of(self.journal)
        before = self.stamp()
        code = self.judge(self.start(mode, *more), self.physics, must=must)
        if code in DONE and must and mode == RESUME and self.stamp() != before:
            computed = int(Found.at(self.output, self.kind).run["computed"])
            fresh = {each for each in self.wanted() if (key, *each) not in known}
            demand(computed <= len(fresh), f"{computed} were run, {len(fresh)} missing")

    def stamp(self):
        return os.stat(self.output).st_ino if self.output.exists() else 0

    def extend(self):
        more = [each for each in REPLICATES[self.kind] if each > self.replicates]
        self.replicates = self.rng.choice(more[:4] or [self.replicates])
        self.write()
        self.command(RESUME)

    def ask(self):
        """Edit what the config asks for, and nothing that rows follow from."""
        self.replicates = self.rng.choice(REPLICATES[self.kind])
        self.delta = self.rng.choice(DELTAS)
        self.write()

    def edit(self, *names):
        """Edit one thing that rows follow from."""
        name = self.rng.choice(names)
        self.steps[-1] += [name]
        other = next(each for each in CHOICES[name] if each != getattr(self.physics, name))
        self.physics = attrs.evolve(self.physics, **{name: other})
        self.write()

    def begun(self):
        """A command that has run for some time, as often as not until it has kept something."""
        child = self.start()
        wait = self.rng.choice([0.0, 0.05, 0.1, 0.2, 0.3, 0.5]) * self.rng.random()
        if self.rng.random() < 0.6:
            wait_until(lambda: rows_in(self.journal) or not child.runs(), 5.0)
        time.sleep(wait)
        return child

    def disturb(self, number):
        """Send a signal to a command that runs."""
        child = self.begun()
        child.signal(number)
        if number == signal.SIGSTOP:
            time.sleep(self.rng.random())
            child.signal(signal.SIGCONT)
        self.judge(child, self.physics)

    def full_disk(self):
        sizes = [each.stat().st_size for each in self.folder.glob("out.h5*")]
        disk = max([30_000, *sizes]) + self.rng.randrange(60_000)
        self.judge(self.start(RESUME, disk=disk), self.physics)

    def move(self):
        """Rename the folder, as often as not under a run."""
        child = self.begun() if self.rng.random() < 0.5 else None
        if child is not None:  # until it is in the folder
            wait_until(lambda: child.out.exists() or not child.runs(), LONGEST)
        moved = self.folder.with_name(f"{self.folder.name}-moved")
        self.folder.rename(moved)
        if child is not None:
            child.out = moved / child.out.name
            self.judge(child)
        self.folder = moved

    def edit_while_it_runs(self):
        child, before = self.begun(), self.physics
        self.edit(*CHOICES)
        # Files are edited one after the other: a run may read some of them before.
        self.judge(child, before, self.physics)

    def second_job(self):
        modes = [self.rng.choice(MODES) for _ in range(2)]
        must = all(map(self.must_work, modes))
        children = [self.start(modes[0])]
        time.sleep(self.rng.choice([0.0, 0.1, 0.3]) * self.rng.random())
        children.append(self.start(modes[1]))
        codes = [self.judge(child, self.physics) for child in children]
        demand(not must or set(codes) & {*DONE}, "two jobs refuse each other")

    def replace(self):
        """Put something else into the place of the results, or of the journal; the tasks that are
        given up so."""
        what = self.rng.choice(["other", "garbage", "nothing", "cut", "no journal"])
        self.steps[-1] += [what]
        path = self.journal if what == "no journal" else self.output
        gone = self.tasks_of(path)
        if what == "other":
            other = self.truths.folder / f"truth-{self.rng.randrange(len(self.truths.known))}"
            shutil.copy(other / "out.h5", self.folder / "new")
            os.replace(self.folder / "new", path)
        elif what == "garbage":
            put(path, b"no results")
        elif what == "cut" and path.exists():
            put(path, path.read_bytes()[:-100])
        elif what != "cut":
            path.unlink(missing_ok=True)
        return gone

    def replace_while_it_runs(self):
        child = self.begun()
        gone = self.replace()
        self.judge(child)
        return gone


EVENTS = {
    "run": (6, World.command),
    "resume": (6, lambda world: world.command(RESUME)),
    # Other ranks are processes that start anew, which takes seconds: once in a while.
    "resume on other ranks": (1, lambda world: world.command(RESUME, "--jobs", "2")),
    "extend": (3, World.extend),
    "ask": (3, World.ask),
    "ask and resume": (3, lambda world: world.ask() or world.command(RESUME)),
    "edit config": (3, lambda world: world.edit("seed", "viscosity")),
    "edit module": (3, lambda world: world.edit("factor")),
    "edit library": (3, lambda world: world.edit("library")),
    "kill": (6, lambda world: world.disturb(signal.SIGKILL)),
    "interrupt": (3, lambda world: world.disturb(signal.SIGINT)),
    "terminate": (3, lambda world: world.disturb(signal.SIGTERM)),
    "suspend and continue": (3, lambda world: world.disturb(signal.SIGSTOP)),
    "edit while it runs": (3, World.edit_while_it_runs),
    "second job": (3, World.second_job),
    "replace": (3, World.replace),
    "replace while it runs": (3, World.replace_while_it_runs),
    "full disk": (3, World.full_disk),
    "move": (3, World.move),
}
"""{event: (how often, what happens)}."""
