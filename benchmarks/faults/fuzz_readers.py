"""Hostile files of every kind: each is read, or refused with one line; no crash, no hang.

    python -m benchmarks.faults.fuzz_readers [--quick] [--markdown] [--only results …]
                                             [--count N] [--seconds S]

Valid files are changed through h5py, in their bytes, in their JSON, and sealed again
(tests/helpers/hostile_files.py), from a fixed seed. They are read in processes of their own, with
a limit on memory and 5 s of CPU time for each file: a process that ends by a signal is a crash.
What was accepted is looked at: NaN where there was none, codes without a word. Files that something
was found with are kept in the folder flocsim-fuzz among the temporary ones. (Atheris guides by the
coverage of Python code, but what crashes and hangs is C, which it does not see.)
"""

import math
import multiprocessing
import os
import random
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

from benchmarks.reporting import Table, parse_arguments, print_heading
from flocsim.ensembles.storage.identity import short
from flocsim.errors import ConfigError, FileError, FlocsimError
from tests.helpers import hostile_files

COUNT, QUICK = 5000, 250
LONGEST, LONGEST_WAIT = 5.0, 60.0
"""Seconds of CPU time, and of any time, from which on a file is a hang."""

WARM = 25
MEMORY = 6 * 2**30
KEPT = Path(tempfile.gettempdir()) / "flocsim-fuzz"


def read_results_file(path):
    """Read it in all ways; the values that were believed are checked."""
    from flocsim.ensembles.contents import text_of
    from flocsim.io.results.checks import check_rows
    from flocsim.io.results.file import read_results

    found = read_results(path)
    check_rows(found.replicates.__getitem__, len(found.failures), len(found.flocs))
    assert np.isfinite(found.delta).all()
    assert np.all(found.probabilities["n_total"] == found.count)
    text_of(path)


def read_kernel_file(path):
    """Read it, and make the tables for other models."""
    from flocsim.io.results.file import read_results
    from flocsim.io.results.kernel_tables import kernel_matrix

    read_results_file(path)
    kernel = read_results(path).kernel
    if kernel is not None:
        for mechanism in kernel.mechanisms:
            for vertices in kernel.vertices.tolist():
                kernel_matrix(kernel, mechanism, vertices)


def read_strengths_file(path):
    """Read it, describe it, draw it."""
    from flocsim.io.plots.curves import over_rate
    from flocsim.io.results.strength_file import read_strengths, table_of

    found = read_strengths(path)
    table_of(found)
    over_rate(found)


def read_library_file(path):
    """Read it, and make the shapes."""
    from flocsim.ensembles.contents import text_of
    from flocsim.io.shape_library import read_library

    entries = read_library(path)
    for entry in entries:
        for fit in entry.fits.values():
            assert np.isfinite(fit.vertices).all() and np.isfinite(fit.radius)
            assert math.isfinite(fit.shape.area)
        assert math.isfinite(entry.equivalent_radius / entry.spheroradius)
    text_of(path)


def read_picture_file(path):
    """Read it as a picture and as a mask, and look for flocs."""
    from flocsim.io.images.masks import read_masks, segment_mask
    from flocsim.io.images.pictures import segment
    from flocsim.io.images.reading import read_grey

    try:
        grey = read_grey(path)
        assert np.isfinite(grey).all() and grey.min() >= 0.0 and grey.max() <= 1.0
        if grey.size < 20_000:
            segment(grey)
    finally:
        for _, mask in read_masks(path):
            if mask.size < 20_000:
                segment_mask(mask)


def read_masks_file(path):
    """Read the masks and look for flocs."""
    from flocsim.io.images.masks import read_masks, segment_mask

    for _, mask in read_masks(path):
        assert mask.ndim == 2 and mask.min() >= 0
        if mask.size < 20_000:
            segment_mask(mask)


def read_config_file(path):
    """Load it, and take its text for a setting of the command line."""
    from flocsim.ensembles.config.loader import load_config, nested, parse_setting

    text = path.read_bytes().decode("utf-8", "replace")
    try:
        load_config(path)
    finally:
        nested([parse_setting("scene.delta=" + text[:5000])])


def read_swarm_file(path):
    """Read it, describe it, and make the shapes."""
    from flocsim.ensembles.contents import text_of
    from flocsim.io.plots.swarm import shape_of
    from flocsim.io.results.swarm_file import read_swarm

    found = read_swarm(path)
    replicates, _, bodies = found.groups["snapshots"]["cluster"].shape
    for replicate in range(min(replicates, 3)):
        for body in range(min(bodies, 5)):
            assert math.isfinite(shape_of(found, replicate, body).area)
    text_of(path)


def read_sweep_file(path):
    """Read it, and describe it."""
    from flocsim.ensembles.contents import text_of
    from flocsim.ensembles.sweep import read_joined

    read_joined(path)
    text_of(path)


def read_trajectory_file(path):
    """Read it; the motion that was believed is one."""
    from flocsim.io.trajectory import read_trajectory

    found = read_trajectory(path)
    assert np.isfinite(found.position).all() and len(found.shapes) == found.position.shape[1]


class SwarmJournalReader:
    """Makes journals of one study of swarms, and takes what they hold as a resumed run does."""

    def __init__(self, folder):
        from flocsim.ensembles.storage.row_store import key_of
        from flocsim.ensembles.swarms.study import SwarmStudy
        from flocsim.io.journal import CHUNK, PART
        from tests.helpers.swarm_study import swarm_config

        self.study, self.identity, self.parts = SwarmStudy(swarm_config(folder)), {"seed": 1}, []
        [condition], known = self.study.conditions, {"identity": short(self.identity)}
        for replicate in range(2):
            key, records = (key_of(condition), replicate), []

            def keep(name, about, data, key=key, records=records):
                records.append((PART, *key, known | about | {"name": name}, data))

            row, _ = self.study.run_task(self.study.places[0], replicate, lambda: False, None, keep)
            rows = np.array([tuple(row[name] for name in self.study.row.names)], self.study.row)
            self.parts += [*records, (CHUNK, *key, known, rows.tobytes())]

    def make(self, rng, folder):
        """A hostile journal."""
        return hostile_files.journal_file(rng, folder, self.parts)

    def read(self, path):
        """Take what it has, and make results of it where all is there."""
        from flocsim.ensembles.storage.resume import Beginning, refuse_other_sessions, take_journal
        from flocsim.ensembles.storage.row_store import RowStore
        from flocsim.ensembles.swarms.kind import results
        from flocsim.io.journal import Journal
        from flocsim.io.results.swarm_file import table_of

        journal = Journal(path)
        try:
            if journal.problem:
                raise FileError(journal.problem)  # as a run that begins says
            store = RowStore(journal, self.study.conditions, self.study.row)
            start = Beginning(store, self.identity)
            refuse_other_sessions(start, self.study)
            take_journal(start, self.study)
            assert all(remark.isprintable() for remark in start.remarks), start.remarks
            for parts in store.parts.values():
                left = self.study.left_of(parts)
                assert left is None or np.isfinite(left.state["motion"]).all()
            if store.intervals(0) == [(0, 2)]:
                table_of(results(self.study, start, 2, {}, None, True))
            if start.remarks:
                raise FileError(start.remarks[0])  # a part of it was refused
        finally:
            journal.release()


class JournalReader:
    """Makes journals of one study, and takes what they hold as a resumed run does."""

    def __init__(self, folder):
        from flocsim.ensembles.config.loader import load_config
        from flocsim.ensembles.study import Study
        from tests.helpers.small_study import write_small

        path = write_small(folder, vertices="[1]")
        self.study = Study(load_config(path), flocs=[])
        self.identity = {"seed": 1, "kernels.spheres": "x"}
        self.parts = hostile_files.journal_parts(self.identity, short(self.identity), self.rows())

    def rows(self):
        """Two good rows."""
        from flocsim.ensembles.kind import ROW
        from flocsim.io.results.checks import FURTHER_RUNS
        from flocsim.io.results.schema import SHAPE_COLUMNS

        rows = np.zeros(2, ROW)
        rows["inside"], rows["bond"], rows["floc_i"], rows["floc_j"] = 1, 1, -1, -1
        rows["r_i"], rows["r_j"], rows["D_0"] = 1e-5, 2e-5, 4e-5
        for name in SHAPE_COLUMNS:
            rows[name] = 1.0
        for run in FURTHER_RUNS:
            for name in ("outcome", "inside", "bond"):
                rows[f"{run}_{name}"] = rows[name][0], 255
        return rows

    def make(self, rng, folder):
        """A hostile journal."""
        return hostile_files.journal_file(rng, folder, self.parts)

    def read(self, path):
        """Take its rows and look at them."""
        from flocsim.ensembles.collision.draw import FAILURES
        from flocsim.ensembles.storage.resume import Beginning, refuse_other_sessions, take_journal
        from flocsim.ensembles.storage.row_store import RowStore
        from flocsim.io.journal import Journal
        from flocsim.io.results.checks import check_rows

        journal = Journal(path)
        try:
            if journal.problem:
                raise FileError(journal.problem)
            start = Beginning(RowStore(journal, self.study.conditions), self.identity)
            refuse_other_sessions(start, self.study)
            take_journal(start, self.study)
            for place in range(len(self.study.conditions)):
                for first, stop in start.store.intervals(place):
                    rows = start.store.rows(place, first, stop)
                    check_rows(rows.__getitem__, len(FAILURES), 0)
            assert all(remark.isprintable() for remark in start.remarks), start.remarks
        finally:
            journal.release()


def reader(name, folder):
    """(maker of hostile files, function that reads one) of a kind."""
    if name == "journals":
        journals = JournalReader(folder)
        return journals.make, journals.read
    if name == "swarm_journals":
        swarms = SwarmJournalReader(folder)
        return swarms.make, swarms.read
    return {
        "swarms": (hostile_files.swarm_file, read_swarm_file),
        "results": (hostile_files.results_file, read_results_file),
        "libraries": (hostile_files.library_file, read_library_file),
        "compounds": (hostile_files.compounds_file, read_library_file),
        "kernels": (hostile_files.kernel_file, read_kernel_file),
        "strengths": (hostile_files.strengths_file, read_strengths_file),
        "sweeps": (hostile_files.sweep_file, read_sweep_file),
        "trajectories": (hostile_files.trajectory_file, read_trajectory_file),
        "pictures": (hostile_files.picture_file, read_picture_file),
        "masks": (hostile_files.masks_file, read_masks_file),
        "configs": (hostile_files.config_file, read_config_file),
    }[name]


KINDS = (
    "results", "libraries", "journals", "pictures", "masks", "configs", "swarms", "swarm_journals",
    "compounds", "kernels", "strengths", "sweeps", "trajectories",
)  # fmt: skip


def outcome(read, path):
    """("read" or "refused" or what is wrong, why) of one file."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(path)
        return "read", ""
    except AssertionError:
        return "wrongly accepted", traceback.format_exc()
    except FlocsimError as error:
        lines = str(error).split("\n")
        plain = all(line.isprintable() for line in lines)
        if not plain or (len(lines) > 1 and not isinstance(error, ConfigError)):
            return "not one plain line", repr(str(error))
        return "refused", ""
    except Exception:
        return "traceback", traceback.format_exc()


def made(make, name, number, folder):
    """The file of a number; a change that its library refuses to write is left out."""
    for attempt in range(100):
        try:
            return make(random.Random(f"{name} {number} {attempt}"), folder)
        except Exception:
            continue
    raise RuntimeError(f"no file of {name} could be made")


def work(name, first, count, folder, pipe):
    """Read the files of numbers from ``first`` on, telling the parent about each."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)  # decoders speak there
    folder.mkdir(parents=True, exist_ok=True)
    make, read = reader(name, folder)
    for number in range(WARM):
        # The first of all import what they need, which takes seconds on a busy machine.
        outcome(read, made(make, f"{name} warm", number, folder))
    for number in range(first, count):
        path = made(make, name, number, folder)
        pipe.send(("begin", str(path), ""))
        pipe.send((*outcome(read, path), ""))
    pipe.send(("end", "", ""))


def throw(name, count, seconds, root):
    """(Counter of outcomes, longest time [s], what was wrong) of so many files of a kind."""
    context = multiprocessing.get_context("spawn")
    counts, slowest, wrong, number = Counter(), 0.0, [], 0
    until = time.monotonic() + seconds
    while number < count and time.monotonic() < until:
        receiving, sending = context.Pipe(duplex=False)
        job = context.Process(target=work, args=(name, number, count, root / name, sending))
        job.start()
        sending.close()
        path, began, cpu, ended = "", time.monotonic(), 0.0, ""
        while not ended:
            if not receiving.poll(0.5):
                waited = time.monotonic() - began
                busy = cpu_seconds(job.pid) - cpu
                if (path and (busy > LONGEST or waited > LONGEST_WAIT)) or waited > 300.0:
                    ended = "hang"
                continue
            try:
                what, text, _ = receiving.recv()
            except EOFError:
                ended = "crash"
                break
            if what == "begin":
                path, began, cpu = text, time.monotonic(), cpu_seconds(job.pid)
            elif what == "end":
                ended = "end"
            else:
                slowest = max(slowest, time.monotonic() - began)
                counts[what] += 1
                number += 1
                if what not in ("read", "refused"):
                    wrong.append((what, text))
                    keep(path, f"{what}-{number}")
                if time.monotonic() > until:
                    ended = "time"
        job.join(20.0 if ended == "crash" else 0.0)
        job.kill()
        job.join()
        if ended in ("hang", "crash"):
            counts[ended] += 1
            number += 1
            wrong.append((ended, f"{path}: exit code {job.exitcode}"))
            keep(path, f"{ended}-{number}")
    return counts, slowest, wrong


def cpu_seconds(pid):
    """CPU time [s] that a process has used; 0 where it has gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def keep(path, name):
    """Keep a file that something was found with."""
    if path:
        KEPT.mkdir(exist_ok=True)
        shutil.copy(path, KEPT / f"{name.replace(' ', '-')}-{Path(path).name}")


def main():
    """Print the table; exit code 1 where a file was neither read nor refused as it should be."""
    most = {"type": float, "default": math.inf, "help": "seconds for each kind of file"}
    arguments = parse_arguments(
        __doc__, seconds=most, count={"type": int, "default": 0, "help": "files of each kind"},
        only={"nargs": "+", "default": list(KINDS), "choices": KINDS},
    )  # fmt: skip
    print_heading(("h5py", "pillow", "tifffile"))
    count = arguments.count or (QUICK if arguments.quick else COUNT)
    columns = ("read", "refused", "traceback", "not one plain line", "wrongly accepted", "hang",
               "crash")  # fmt: skip
    table = Table("Hostile files", ("reader", "files", *columns, "slowest [s]"))
    found = []
    with tempfile.TemporaryDirectory() as name:
        for kind in arguments.only:
            counts, slowest, wrong = throw(kind, count, arguments.seconds, Path(name))
            table.add(kind, counts.total(), *(counts[each] for each in columns), slowest)
            found += wrong
    table.print(arguments.markdown)
    for (what, text), number in Counter(found).most_common(20):
        print(f"{number} × {what}: {text}\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
