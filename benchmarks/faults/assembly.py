"""What is left of a study that is killed while its results file is made.

    python -m benchmarks.faults.assembly [--quick] [--markdown] [--kills K] [--rows R]

A journal of made-up rows stands for a study that has just been finished, so that a job has nothing
to do but to assemble. It is killed (one rank, the launcher, or all) at a random time while the file
is written; half of the studies extend an older results file. Afterwards nothing of the journal may
be gone, what lies at the place of the results is the old file or the whole new one, and the study
resumed on another number of ranks, without a replicate computed, ends with the bytes of a study
that nobody disturbed.
"""

import random
import shutil
import signal
import sys
import tempfile
import time
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.faults.job import KINDS, STUDY, Job, Tally
from benchmarks.reporting import Table, parse_arguments, print_heading
from flocsim.ensembles.collision.draw import FURTHER
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.kind import COLUMNS, ROW, chunk_record, layout
from flocsim.ensembles.pairs.kind import KIND
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.runner import run_to_file
from flocsim.ensembles.storage.identity import identity_of, short
from flocsim.ensembles.storage.resume import RESUME, begin, claim
from flocsim.ensembles.study import Study
from flocsim.io.journal import journal_path
from flocsim.io.records import SESSION, encode
from flocsim.io.results.file import read_results
from flocsim.io.results.schema import NOT_APPLICABLE
from tests.helpers.results_files import same_data
from tests.helpers.sealed import read_sealed

SHARE_OLD = 0.2
"""Of the replicates of an extended study, how many its older results file has."""


def made_up_rows(seed, count):
    """Rows as if of a study of spheres, any that fit together; fewer are the first of more."""
    rows = np.zeros(count, ROW)
    for number, name in enumerate(COLUMNS):
        drawn = np.random.default_rng([seed, number]).random(count)
        rows[name] = drawn if ROW[name].kind == "f" else (100.0 * drawn).astype("i8")
    rows["d_c_over_D_0"] = rows["d_c_collision"] / rows["D_0"]
    rows["outcome"] %= 6
    inside = np.array([1, 1, 0, 0, NOT_APPLICABLE, NOT_APPLICABLE], "u1")
    rows["inside"] = inside[rows["outcome"]]
    rows["bond"] = np.where(np.isin(rows["outcome"], [0, 2]), 1 + rows["bond"] % 3, NOT_APPLICABLE)
    rows["failure"], rows["crossed_zone"] = 0, rows["inside"]
    # A few are run again, and some of them end as the one before did.
    again, found = rows["checked_outcome"] % 5 == 0, np.arange(count)
    found = np.maximum(found - (rows["checked_inside"] % 10 == 0), 0)
    for name in ("outcome", "inside", "bond"):
        rows[f"checked_{name}"] = np.where(again, rows[name][found], NOT_APPLICABLE)
    for column in FURTHER:
        if not column.startswith("checked_"):  # none a third time, or cut otherwise
            rows[column] = NOT_APPLICABLE
    rows["floc_i"] = rows["floc_j"] = -1
    return rows


def write_study(folder, replicates, first=0, longest=16_384):
    """A folder with a config and the journal of a run that has got all replicates from ``first``.

    A condition after the other, its chunks of up to ``longest`` rows in any order.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "study.toml").write_text(
        # Of rows that are made up many have no outcome.
        STUDY.replace("replicates = 200", f"replicates = {replicates}")
        + "[stop]\nundecided = 1.0\n"
    )
    study = Study(load_config(folder / "study.toml"))
    identity = identity_of(study)
    key = short(identity)
    rng = random.Random(replicates)
    session = {"identity": identity, "short": key, "layout": layout(), "date": "",
               "command": "", "cpus": []}  # fmt: skip
    with open(journal_path(folder / "study.h5"), "wb") as file:
        file.write(encode(SESSION, session))
        for place, condition in enumerate(study.conditions):
            rows = made_up_rows(place, replicates)
            starts = [first]
            while starts[-1] < replicates:
                starts.append(min(starts[-1] + rng.randint(1, longest), replicates))
            chunks = list(pairwise(starts))
            rng.shuffle(chunks)
            for start, stop in chunks:
                file.write(chunk_record(condition, start, rows[start:stop], key))
    return folder


def resumed(study, identity, folder):
    """The Beginning of a study that goes on from what is in its folder."""
    journal, _ = claim(folder / "study.h5", RESUME)
    return begin(study, identity, folder / "study.h5", RESUME, journal, KIND.old_rows)


def finish_here(folder):
    """Finish the study in this process: its results file; all rows must have been there."""
    config = load_config(folder / "study.toml")
    ended = run_to_file(config, Communicator(), folder / "study.h5", "resume")
    assert (ended.code, ended.computed) == (0, 0)
    return folder / "study.h5"


def prepare(root, replicates):
    """{name: folder} of a study to be made from nothing and of one to be extended."""
    whole = write_study(root / "whole", replicates)
    old = int(SHARE_OLD * replicates)
    finish_here(write_study(root / "part", old))
    extended = write_study(root / "extended", replicates, first=old)
    shutil.copy(root / "part" / "study.h5", extended / "study.h5")
    return {"new file": whole, "extended file": extended}


def unfinished(folder):
    """The unfinished file in a folder, if there is one."""
    return next((path for path in folder.glob(".*unfinished")), None)


def wait_for_assembly(job):
    """Until the job has begun its results file, or has ended."""
    until = time.monotonic() + 30.0
    while job.process.poll() is None and time.monotonic() < until:
        if unfinished(job.folder):
            return
        time.sleep(0.001)


def assembly_seconds(source, kind):
    """How long a job makes its file, undisturbed."""
    folder = shutil.copytree(source, source.with_name(source.name + "-timed"))
    job = Job.start(folder, kind)
    wait_for_assembly(job)
    began = time.monotonic()
    while unfinished(folder):
        time.sleep(0.001)
    seconds = time.monotonic() - began
    job.finish([job.process.pid])
    shutil.rmtree(folder)
    return seconds


def kill_once(source, kind, target, rng, longest, reference):
    """(what is wrong, seconds to the end, whether it hung, whether it hit) of a killed assembly."""
    folder = source.with_name(source.name + "-killed")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source, folder)
    old = folder / "study.h5"
    before = old.read_bytes() if old.exists() else None
    rows = journal_path(old).read_bytes()
    job = Job.start(folder, kind)
    wait_for_assembly(job)
    time.sleep(rng.uniform(0.0, longest))
    pids = job.send(signal.SIGKILL, target, rng)
    code, seconds = job.finish(pids)
    if code is None:
        return "hang", seconds, True, True
    hit = journal_path(old).exists()
    return what_is_wrong(folder, before, rows, kind, rng, reference), seconds, False, hit


def what_is_wrong(folder, before, rows, kind, rng, reference):
    """What is wrong with what a killed job has left, and with what is made of it; or ""."""
    output = folder / "study.h5"
    now = output.read_bytes() if output.exists() else None
    is_new = now is not None and now != before
    journal = journal_path(output)
    if is_new:
        read_sealed(output)
    elif not journal.exists() or not journal.read_bytes().startswith(rows):
        return "the journal has lost rows"
    other = Job.start(folder, rng.choice([each for each in KINDS if each != kind]))
    code, _ = other.finish([other.process.pid])
    if code != 0:
        return f"resumed, it ended with {code}"
    if apart := same_data(reference, output):
        return f"bytes differ: {apart}"
    if read_results(output, replicates=False).run["computed"]:
        return "replicates were computed again"
    left = sorted(path.name for path in folder.iterdir())
    return "" if left == ["study.h5", "study.toml"] else f"left: {left}"


def kill_often(root, kills, replicates, seed=None):
    """({kind of job: Tally}, how many kills came while the file was being made)."""
    rng = random.Random(seed)
    sources = prepare(root, replicates)
    reference = finish_here(shutil.copytree(sources["new file"], root / "reference"))
    longest = cache(lambda name, kind: 1.1 * assembly_seconds(sources[name], kind))
    tallies = {f"{kind}, {name}": Tally() for name in sources for kind in KINDS}
    hits = 0
    for number in range(kills):
        name = list(sources)[number % len(sources)]
        kind = list(KINDS)[number // len(sources) % len(KINDS)]
        target = rng.choice(["rank", "launcher", "group"])
        found = kill_once(sources[name], kind, target, rng, longest(name, kind), reference)
        problem, seconds, hang, hit = found
        hits += hit
        tallies[f"{kind}, {name}"].add(
            f"{kind}, {name}, {target}: {problem}" if problem else "", seconds, hang
        )
    return tallies, hits


def main():
    """Print the table; exit code 1 if anything was lost."""
    arguments = parse_arguments(
        __doc__,
        kills={"type": int, "default": 0, "help": "kills (default: 100, quick: 8)"},
        rows={"type": int, "default": 1_000_000, "help": "rows of the study"},
    )
    print_heading(("h5py", "mpi4py", "mpich"))
    kills = arguments.kills or (8 if arguments.quick else 100)
    with tempfile.TemporaryDirectory() as name:
        tallies, hits = kill_often(Path(name), kills, arguments.rows // 10)
    columns = ("job", "kills", "same bytes after", "hangs", "slowest end [s]")
    table = Table(f"Kills while the results file is made ({hits} before it was whole)", columns)
    for kind, tally in tallies.items():
        table.add(kind, tally.faults, tally.right, tally.hangs, tally.slowest)
    table.print(arguments.markdown)
    wrong = [problem for tally in tallies.values() for problem in tally.wrong]
    print(*wrong, sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
