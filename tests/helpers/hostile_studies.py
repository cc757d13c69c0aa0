"""Files of real, tiny studies of every kind, changed by an enemy who knows how they are made: the
config that they hold, what they say of themselves, their values and bytes, sealed again.

`Hostile` makes them, `judged` runs the commands on one in a process of its own with limits.
"""

import contextlib
import io
import json
import os
import resource
import signal
import sys
import time
import tomllib
import traceback
from pathlib import Path
from random import Random

import attrs
import h5py

import flocsim
from flocsim.__main__ import main
from flocsim.io.seals import seal
from tests.helpers.config_mutations import tables_of, toml
from tests.helpers.hostile_files import (
    ODD_TEXTS,
    change_json,
    hostile_hdf5,
    journal_file,
    written,
)
from tests.helpers.kernel_study import kernel_text
from tests.helpers.own_force import OWN
from tests.helpers.sealed import read_sealed
from tests.helpers.small_study import write_star_library
from tests.helpers.swarm_study import SWARM

MARK = "was-run"
EVIL = f"""\
import pathlib
pathlib.Path({MARK!r}).touch()
"""
"""A module that says when it was run."""

PAIRS = """\
preset = "tang2014"
seed = 1
replicates = 6
[scene]
types = ["I", "III"]
delta = [0.25]
[shapes]
vertices = [1, 4]
pool = 2
[forces.double_layer]
potential = "-20 mV"
[output]
file = "pairs.h5"
"""
OWN_CLASS = PAIRS + '[forces.mine]\nclass = "own_pull:Pull"\n'

LONGEST, LONGEST_WAIT, MOST_MEMORY = 5.0, 600.0, 2**30
"""What a command may take of a processor [s], of time [s], of memory [bytes]."""

ODD = (
    0, -1, 1, 7, 100_000, 10**9, 2**53, 2**62, 10**30, 1e-300, 1e300, -1e9, 0.5, float("nan"),
    float("inf"), True, "", "x" * 5000, "\x1b[31m", "1 um", "5 parsec", "1e999 m", "auto", "own",
    "evil:Evil", "antigravity:Evil", "own_pull:Pull", "pack.inner:Evil", "/dev/zero", "no.h5",
    "../../x.h5", "links.h5", "fifo.h5", ".", [], [1], [[]], [0] * 5000, list(range(1, 3000)),
    [0.25 + 1e-6 * k for k in range(5000)], [[1e-6, 2e-6]] * 20_000, {}, {"a": 1},
)  # fmt: skip
"""What stands in the place of a value of the config."""

TABLES = (
    ("forces.more", {"class": "evil:Evil"}), ("integrator", {"class": "evil:Evil"}),
    ("shapes", {"class": "evil:Evil"}), ("shapes", {"class": "antigravity:Evil"}),
    ("integrator", {"class": "pack.inner:Evil"}), ("forces.more", {"class": "sys:path"}),
    ("forces.mine", {"class": "linked:Pull"}), ("scene", {"kind": "swarm"}),
    ("scene", {"kind": "kernel"}), ("scene", {"kind": "cube"}), ("scene", {"kind": [1]}),
    ("scene", {"number": 10**9}), ("scene", {"pairs": [[1e-6, 2e-6]] * 30_000}),
    ("scene", {"meeting": "shear", "rate": 1e-30}), ("scene", {"meeting": "brownian"}),
    ("scene", {"types": [f"{k}" for k in range(30_000)]}), ("scene", {"time_limit": 1e30}),
    ("scene", {"delta": [k * 1e-6 for k in range(100_000)]}), ("shapes", {"pool": 100_000}),
    ("shapes", {"vertices": [1, 100_000]}), ("shapes", {"vertices": [*range(1, 3000)]}),
    ("shapes", {"source": "library", "file": "no.h5"}),
    ("shapes", {"source": "library", "file": "links.h5"}),
    ("shapes", {"source": "library", "file": "fifo.h5"}),
    ("shapes", {"source": "library", "file": "/dev/zero"}),
    ("shapes", {"source": "library", "file": "library.h5", "size": "own"}),
    ("shapes", {"primary_particles": 10**9, "fractal_dimension": 1.0}),
    ("integrator", {"tolerance": 1e-300}),
    ("integrator", {"name": "velocity_verlet", "step": 1e-30, "max_steps": 2**62}),
    ("integrator", {"max_steps": 2**53}), ("integrator", {"check_share": 1.0}),
    ("zone", {"distance": -1e9}), ("stop", {"half_width": 1e-12}), ("bodies", {"density": -1.0}),
    ("fluid", {"viscosity": 1e-300}), ("output", {"file": "/etc/passwd"}),
)  # fmt: skip
"""What is laid over the config."""


def lay(table, place, more):
    """Put values into the table at a dotted place."""
    for name in place.split("."):
        if not isinstance(table.get(name), dict):
            table[name] = {}
        table = table[name]
    table.update(more)


def changed_config(rng, text):
    """(text of a config with something odd, {dotted key: value} of what was put there)."""
    kind = rng.randrange(8)
    if kind == 0:
        place = rng.randrange(len(text))
        return text[:place] + rng.choice(ODD_TEXTS) + text[place + rng.randrange(20) :], {}
    try:
        table, said = tomllib.loads(text), {}
    except (tomllib.TOMLDecodeError, RecursionError):
        return text, {}
    for _ in range(rng.choice([1, 1, 2])):
        if kind < 4:
            place, more = rng.choice(TABLES)
            lay(table, place, more)
            said |= {f"{place}.{key}": value for key, value in more.items()}
        else:
            owner = rng.choice([each for each in tables_of(table) if each] or [table])
            key = rng.choice([*owner, "preset", "seed"])
            owner[key] = rng.choice(ODD)
            said |= {f"{name}.{key}": owner[key] for name, each in table.items() if each is owner}
    lines = [f"{toml(key)} = {toml(value)}" for key, value in table.items()]
    return "\n".join(lines).replace("\0", ""), said


def long_json(rng, value):
    """A JSON value in which a list, or a number, has become very large."""
    if isinstance(value, dict) and value:
        asked = [key for key in ("asked", "swarm", "first", "replicate") if key in value]
        keys = rng.sample(list(value), min(len(value), rng.choice([1, 1, 2, 3])))
        keys = asked if asked and rng.random() < 0.6 else keys
        return value | {key: long_json(rng, value[key]) for key in keys}
    if isinstance(value, list) and value and rng.random() < 0.4:
        return [long_json(rng, value[0]), *value[1:]]
    if isinstance(value, list):
        first = value[0] if value else 0
        if isinstance(first, str):
            return [f"{first}{k}" for k in range(rng.choice([1000, 100_000]))]
        if isinstance(first, int | float):
            return [first + k for k in range(rng.choice([1000, 100_000]))]
        return [first] * 20_000
    if isinstance(value, str):
        return value + rng.choice(["x" * 100_000, "\x1b]0;x\x07", "\n\n"])
    return rng.choice([10**9, 2**52, 2**40 - 10, -(10**9), 1e300, 0])


def changed_text(rng, text):
    """A text that a file holds as JSON, or plainly, with something odd in it."""
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return rng.choice([*ODD_TEXTS, "x" * 10_000])
    work = long_json if rng.random() < 0.4 else change_json
    found = json.dumps(work(rng, value))
    return rng.choice(ODD_TEXTS) if rng.random() < 0.05 else found


def texts_in(file):
    """[(holder, key)] of the texts of an open file: scalar datasets, and attributes."""
    found = []

    def look(name, each):
        if isinstance(each, h5py.Dataset) and each.shape == () and each.dtype.kind == "O":
            found.append((file, name))
        found.extend((each.attrs, key) for key in each.attrs if isinstance(each.attrs[key], str))

    file.visititems(look)
    found.extend((file.attrs, key) for key in file.attrs if isinstance(file.attrs[key], str))
    return found


def text_at(holder, key):
    if isinstance(holder, h5py.AttributeManager):
        return str(holder[key])
    return holder[key].asstr()[()]


def put(holder, key, text):
    """Another text in its place; what h5py cannot hold is left out."""
    with contextlib.suppress(ValueError, UnicodeEncodeError, OSError):
        text = text.encode("utf-8", "replace").decode().replace("\0", "")
        if isinstance(holder, h5py.AttributeManager):
            holder[key] = text
        else:
            holder[key][()] = text


def changed_study(rng, data):
    """HDF5 data with other texts in it: mostly another config, now and then believed by the
    identity that it is held against."""
    image = io.BytesIO(data)
    with h5py.File(image, "r+") as file:
        texts = texts_in(file)
        configs = [(holder, key) for holder, key in texts if key.endswith("config")]
        identities = [(holder, key) for holder, key in texts if key.endswith("identity")]
        if configs and rng.random() < 0.75:
            text, said = changed_config(rng, text_at(*configs[0]))
            put(*configs[0], text)
            if identities and said and rng.random() < 0.5:
                identity = json.loads(text_at(*identities[0]))
                put(*identities[0], json.dumps(identity | said))
        else:
            for holder, key in rng.sample(texts, min(len(texts), rng.choice([1, 1, 2]))):
                put(holder, key, changed_text(rng, text_at(holder, key)))
    return image.getvalue()


@attrs.define(eq=False)
class Hostile:
    """Makes hostile files in ``folder``, where tiny studies of all kinds are run first."""

    folder: Path
    data: dict[str, bytes] = attrs.Factory(dict)
    parts: dict[str, list] = attrs.Factory(dict)

    def make_studies(self):
        """Run a study of every kind, and keep its file, or its journal."""
        folder = self.folder
        (folder / "own_pull.py").write_text(OWN, "utf-8")
        (folder / "neighbour.py").write_text("FACTOR = -1e-3\n", "utf-8")
        (folder / "pairs.toml").write_text(PAIRS, "utf-8")
        (folder / "own_classes.toml").write_text(OWN_CLASS, "utf-8")
        (folder / "rates.toml").write_text(kernel_text(), "utf-8")
        (folder / "swarms.toml").write_text(SWARM, "utf-8")
        plain = PAIRS.replace("[1, 4]", "[1]").replace('"I", ', "")
        (folder / "plain.toml").write_text(plain, "utf-8")
        write_star_library(folder / "library.h5", vertices=(1, 4))
        over = ["--over", "fluid.viscosity=1e-3,2e-3"]
        for name, words in {
            "pairs": ["ensemble", "pairs.toml"],
            "own_classes": ["ensemble", "own_classes.toml"], "rates": ["kernel", "rates.toml"],
            "swarms": ["swarm", "swarms.toml"],
            "strengths": ["strength", "pairs.h5", "--count", "1", "--precision", "0.5"],
            "sweeps": ["sweep", "plain.toml", *over],
            "swarm_sweeps": ["sweep", "swarms.toml", *over],
        }.items():  # fmt: skip
            quiet = [] if words[0] == "sweep" else ["--quiet"]
            with kept_journal(folder / f"{name}.h5.journal", self.parts, name):
                assert main([*words, "-o", f"{name}.h5", *quiet]) in (0, 65), name
        flocsim.open("pairs.h5").replicate(0).save("trajectories.h5")
        self.data["libraries"] = read_sealed(folder / "library.h5")
        for name in (*KINDS, "trajectories"):
            if (folder / f"{name}.h5").exists():
                self.data[name] = read_sealed(folder / f"{name}.h5")
        self.make_traps()
        for name in KINDS:  # what commands import and compile, they find in every process
            if name in self.data:
                path = written(folder, "bad.h5", seal(self.data[name]))
                for words in commands(path, Random(1)):
                    with contextlib.suppress(SystemExit):
                        main([str(each) for each in words])

    def make_traps(self):
        """Modules that must not be run, and files that nobody should wait for."""
        folder = self.folder
        (folder / "own_pull.py").write_text(EVIL + OWN, "utf-8")
        (folder / "evil.py").write_text(EVIL, "utf-8")
        (folder / "pack").mkdir()
        for name in ("__init__.py", "inner.py"):
            (folder / "pack" / name).write_text(EVIL, "utf-8")
        os.symlink("evil.py", folder / "linked.py")
        os.symlink("links.h5", folder / "links.h5")
        os.mkfifo(folder / "fifo.h5")
        (folder / "folder.h5").mkdir()
        for name in ("own_pull", "neighbour"):
            sys.modules.pop(name, None)

    def file(self, kind, rng):
        """The path of a hostile file of a kind."""
        for each in (self.folder / "bad.h5", self.folder / "bad.h5.journal"):
            each.unlink(missing_ok=True)
        if kind == "places":
            return self.place(rng)
        if kind.endswith("journals"):
            parts = [(k, long_json(rng, about) if rng.random() < 0.4 else about, data)
                     for k, about, data in self.parts[kind.removesuffix("_journals")]]  # fmt: skip
            return journal_file(rng, self.folder, parts)
        data = self.data[kind]
        data = seal(changed_study(rng, data)) if rng.random() < 0.75 else hostile_hdf5(rng, data)
        return written(self.folder, "bad.h5", data)

    def place(self, rng):
        """A path at which no file of ours lies, or another than its name says."""
        path = self.folder / "bad.h5"
        names = ["links.h5", "fifo.h5", "folder.h5", "/dev/zero", "/dev/null", "evil.py", "no.h5",
                 "pairs.toml", "pairs.h5", "swarms.h5"]  # fmt: skip
        kind = rng.randrange(3)
        if kind == 0:
            return Path(rng.choice(names))
        os.symlink(rng.choice(names), path)
        return path


@contextlib.contextmanager
def kept_journal(path, parts, name):
    """Keep the records of the journal that a command writes, which it removes at its end."""
    from flocsim.io.journal import Journal

    original = Journal.remove

    def remove(journal):
        if Path(journal.path).name == path.name:
            parts[name] = [
                (each.kind, each.condition, each.first, each.about, each.data)
                for each in journal.records()
            ]
        original(journal)

    Journal.remove = remove
    try:
        yield
    finally:
        Journal.remove = original


KINDS = (
    "pairs", "own_classes", "rates", "swarms", "strengths", "sweeps", "swarm_sweeps",
    "trajectories", "libraries", "pairs_journals", "swarms_journals",
    "places",
)  # fmt: skip


def commands(path, rng):
    """The command lines that are run on a file."""
    compared = ["pairs.h5", path] if rng.random() < 0.5 else [path, "swarms.h5"]
    exported = rng.choice(["gsd", "csv", "matrix"])
    figure = rng.choice(["4", "overview", "sizes", "clusters", "strip", "kernel", "rate", "bonds"])
    return [
        ["info", path],
        ["info", path, rng.choice(["--config", "--modules", "--water"])],
        ["report", path, "-o", "out.html", "--overwrite"],
        ["strength", path, "-o", "out.h5", "--overwrite", "--count", "1", "--precision", "0.5"],
        ["trajectory", path, "-o", "out.png", "--overwrite"],
        ["compare", *compared],
        ["export", exported, path, "-o", "out.gsd" if exported == "gsd" else "out.csv",
         "--overwrite"],
        ["plot", path, "--overwrite", "--format", "png",
         *([] if rng.random() < 0.15 else ["--figures", figure])],
    ]  # fmt: skip


def judged(lines):
    """[what is wrong with the commands of ``lines``, run in a process of its own]."""
    receiving, sending = os.pipe()
    lines = [[str(each) for each in words] for words in lines]
    pid = os.fork()
    if pid == 0:
        os.close(receiving)
        code = 1
        try:
            for number, words in enumerate(lines):
                os.write(sending, f"{number}\n".encode())
                for wrong in wrongs(words):
                    os.write(sending, f"{json.dumps([words, wrong])}\n".encode())
            code = 0
        finally:
            os._exit(code)
    os.close(sending)
    with os.fdopen(receiving) as pipe:
        said = pipe.read().splitlines()
    _, status = os.waitpid(pid, 0)
    found = [line for line in said if line.startswith("[")]
    if status:
        number = int([line for line in said if not line.startswith("[")][-1])
        ends = {signal.SIGALRM: "hangs", signal.SIGXCPU: "hangs"}
        word = ends.get(os.WTERMSIG(status), f"ends with status {status}")
        found.append(json.dumps([lines[number], word]))
    return found


def wrongs(words):
    """What is wrong with one command, run here."""
    out, err = io.StringIO(), io.StringIO()
    signal.setitimer(signal.ITIMER_REAL, LONGEST_WAIT)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    # A copied process begins with the memory of the first one.
    began, before, code, trace = time.process_time(), most_memory(), 0, ""
    limit = int(began + 2 * LONGEST) + 1
    resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.RLIM_INFINITY))
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = main(words)
    except SystemExit as end:
        code = end.code
    except BaseException:
        trace = traceback.format_exc()
    lasted = time.process_time() - began
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    said = [each for each in err.getvalue().splitlines()
            if not each.startswith(WARNING) and " is kept as " not in each]  # fmt: skip
    if trace or "Traceback" in err.getvalue():
        yield trace or err.getvalue()
    elif code not in (0, 2, 65, 74):
        yield f"exit code {code}: {said}"
    elif len(said) != (code != 0) and not err.getvalue().startswith("usage:"):
        yield f"exit code {code}, {len(said)} lines: {said}"
    if any(len(each) > 1500 or not each.isprintable() for each in said):
        yield f"no plain line: {said}"[:3000]
    if not all(each.isprintable() for each in out.getvalue().splitlines()) and words[0] != "info":
        yield f"unprintable: {out.getvalue()!r}"[:1000]
    if lasted > LONGEST:
        yield f"takes {lasted:.1f} s"
    if (memory := most_memory() - before) > MOST_MEMORY:
        yield f"takes {memory / 2**20:.0f} MiB"
    if os.path.exists(MARK):
        os.unlink(MARK)
        yield "runs foreign code"


def most_memory():
    """What this process has taken of memory at most [bytes]."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


WARNING = "flocsim: warning: "
