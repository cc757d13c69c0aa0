"""The results file made by several ranks: the same bytes, and nothing believed that is not seen."""

import os
import queue
import random
import subprocess
import sys
import tempfile
import threading
from functools import cache
from itertools import pairwise, product
from pathlib import Path

import pytest

from benchmarks.faults.assembly import finish_here, kill_once, prepare, resumed, write_study
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.estimates.summary import Reader, results_of, sums_of
from flocsim.ensembles.parallel import assembly
from flocsim.ensembles.parallel.communicator import Communicator, ExitCode, StopRequested
from flocsim.ensembles.storage import row_store
from flocsim.ensembles.storage.identity import identity_of
from flocsim.ensembles.study import Study
from flocsim.errors import FileError
from flocsim.io.journal import journal_path
from flocsim.io.results import layout
from flocsim.io.results.layout import RowFile, new_row_file, shared_row_file
from tests.helpers.results_files import same_data
from tests.helpers.small_study import mpirun, problems, run_command
from tests.helpers.tiers import rest_slow

REPLICATES = 12_000
"""Of ten conditions: four blocks, the last one short."""


class Threads(Communicator):
    """Ranks that are threads of this process."""

    def __init__(self, rank, size, queues):
        super().__init__()
        self.rank, self.size, self.queues = rank, size, queues
        self.sent = []

    def send(self, to, message):
        self.sent.append(message)
        self.queues[self.rank, to].put(message)

    def arrived(self):
        for source in range(self.size):
            waiting = self.queues[source, self.rank]
            while not waiting.empty():
                yield source, waiting.get()


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """{name: folder} of a study whose rows are all in a journal, and of one that is extended."""
    return prepare(tmp_path_factory.mktemp("assembly"), REPLICATES)


@pytest.fixture(scope="module")
def reference(folders, tmp_path_factory):
    """The results of one process."""
    return finish_here(copied(folders["new file"], tmp_path_factory.mktemp("reference")))


def copied(folder, to):
    """A copy of a study's folder."""
    for path in folder.iterdir():
        (to / path.name).write_bytes(path.read_bytes())
    return to


@cache
def study_and_identity(text):
    """Of a config's text."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "study.toml")
        path.write_text(text)
        study = Study(load_config(path))
    return study, identity_of(study)


def assemble(folder, ranks):
    """Make the results of a folder's study by threads: (file, warnings, what rank 0 sent)."""
    study, identity = study_and_identity((folder / "study.toml").read_text())
    queues = {(a, b): queue.SimpleQueue() for a in range(ranks) for b in range(ranks)}
    comms = [Threads(rank, ranks, queues) for rank in range(ranks)]
    others = [threading.Thread(target=assembly.assist, args=(study, each)) for each in comms[1:]]
    for thread in others:
        thread.start()
    warnings = []
    try:
        start = resumed(study, identity, folder)
        with start.resources:
            reader = Reader(start.store, study.shape)
            nothing = sums_of(reader.codes, 10, 0, 0)
            draft = results_of(study, REPLICATES, nothing, {"note": "same"})
            with new_row_file(folder / "made.h5", draft) as file:
                sums, digests = assembly.assemble(reader, file, comms[0], warnings.append)
                file.complete(results_of(study, REPLICATES, sums, {"note": "same"}), digests)
    finally:
        sent = list(comms[0].sent)
        comms[0].broadcast(ExitCode(0))
        for thread in others:
            thread.join()
    return folder / "made.h5", warnings, sent


@pytest.fixture(scope="module")
def by_one_rank(folders, tmp_path_factory):
    """What `assemble` makes with one rank."""
    return assemble(copied(folders["new file"], tmp_path_factory.mktemp("one")), 1)[0]


@pytest.mark.parametrize(
    ("name", "ranks"),
    rest_slow(
        product(["new file", "extended file"], [1, 2, 3, 4, 7]),
        lambda name, ranks: name == "new file" and ranks == 7,
    ),
)
def test_any_number_of_ranks_writes_the_same_file(
    folders, reference, by_one_rank, tmp_path, name, ranks
):
    made, warnings, sent = assemble(copied(folders[name], tmp_path), ranks)
    assert same_data(made, reference) == []
    assert warnings == []
    shares = [each for each in sent if isinstance(each, assembly.Share)]
    assert len(shares) == min(ranks - 1, 3)
    written = [0, *(end for share in shares for end in share.blocks)]
    assert (
        written[1::2]
        == [(4 * rank // ranks if ranks < 4 else rank) for rank in range(1, ranks)][:3]
    )
    assert ranks == 1 or written[-1] == 4
    assert made.read_bytes() == by_one_rank.read_bytes()


def test_ranks_count_as_well_and_give_the_same_tables(folders, by_one_rank, tmp_path, monkeypatch):
    monkeypatch.setattr(assembly, "COUNTED_ROWS", 100)
    made, _, sent = assemble(copied(folders["new file"], tmp_path), 3)
    reviews = [each for each in sent if isinstance(each, assembly.Review)]
    assert [each.counted for each in reviews] == [(4000, 8000), (8000, 12000)]
    assert made.read_bytes() == by_one_rank.read_bytes()


def test_parts_make_up_the_whole():
    for count, parts in ((10, 3), (3052, 3052), (10**9, 10_000), (1, 1)):
        found = assembly.parts_of(count, parts)
        assert len(found) == parts
        assert [found[0][0], found[-1][1]] == [0, count]
        assert all(one[1] == other[0] for one, other in pairwise(found))
        assert all(first < stop for first, stop in found)


@pytest.mark.slow
@pytest.mark.parametrize("words", [["--jobs", 3], [], None])
def test_the_command_writes_the_same_bytes(folders, reference, tmp_path, words):
    folder = copied(folders["extended file"], tmp_path)
    more = {"ranks": 3} if words == [] else {}
    done = run_command(folder, "study.toml", "--resume", "--quiet", *(words or []), **more)
    assert (done.returncode, problems(done.stderr)) == (0, [])
    assert same_data(folder / "study.h5", reference) == []
    assert sorted(path.name for path in folder.iterdir()) == ["study.h5", "study.toml"]


def test_without_a_common_file_system_rank_0_does_it_alone(
    folders, reference, tmp_path, monkeypatch
):
    monkeypatch.setattr(layout, "TOKEN_SIZE", 16)

    def elsewhere(path, token, plan):
        return shared_row_file(path, bytes(16), plan)

    monkeypatch.setattr(assembly, "shared_row_file", elsewhere)
    made, warnings, _ = assemble(copied(folders["new file"], tmp_path), 3)
    assert same_data(made, reference) == []
    [line] = warnings
    assert "2 of 3 ranks could not write their share of the results" in line
    assert "the ranks share no file system" in line


def test_a_file_of_another_job_is_not_written_to(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"of another job" * 10)
    plan = layout.Plan(0, 0, {})
    (tmp_path / "link").symlink_to(path)
    cases = [("x", bytes(32), "share no file system"), ("absent", bytes(32), "cannot be seen here"),
             ("link", path.read_bytes()[:32], "cannot be seen here")]  # fmt: skip
    for name, token, said in cases:
        with pytest.raises(FileError, match=said), shared_row_file(tmp_path / name, token, plan):
            pass


class Elsewhere:
    """The machine's name: another for each thread."""

    @staticmethod
    def node():
        return threading.current_thread().name


def test_what_another_machine_has_written_is_read_before_it_is_believed(
    folders, reference, tmp_path, monkeypatch
):
    monkeypatch.setattr(assembly, "platform", Elsewhere)
    write, lost = RowFile.write_block, []

    def lose_one(file, block, columns):
        found = write(file, block, columns)
        if block == 2 and not lost and threading.current_thread() is not threading.main_thread():
            lost.append(block)
            os.pwrite(file.descriptor, bytes(100), file.plan.columns["steps"][0] + 8 * 70_000)
        return found

    monkeypatch.setattr(RowFile, "write_block", lose_one)
    made, warnings, sent = assemble(copied(folders["new file"], tmp_path), 3)
    assert lost == [2]
    reviewed = [
        block for each in sent if isinstance(each, assembly.Review) for block in each.digests
    ]
    assert len(reviewed) == 3  # and rank 0 reads the fourth
    assert same_data(made, reference) == []
    assert warnings == []


@pytest.mark.parametrize("ranks", rest_slow([1, 3], lambda ranks: ranks == 3))
def test_rows_that_were_damaged_meanwhile_are_not_taken(folders, tmp_path, monkeypatch, ranks):
    folder = copied(folders["new file"], tmp_path)
    path = journal_path(folder / "study.h5")
    begun = assembly.parts_of

    def damage(*words, **more):
        with open(path, "r+b") as file:
            file.seek(path.stat().st_size // 2)
            byte = file.read(1)
            file.seek(-1, os.SEEK_CUR)
            file.write(bytes([byte[0] ^ 4]))
        return begun(*words, **more)

    monkeypatch.setattr(assembly, "parts_of", damage)
    size = path.stat().st_size
    with pytest.raises(FileError, match=f"{path.name} is damaged from byte"):
        assemble(folder, ranks)
    assert path.stat().st_size >= size
    names = sorted(each.name for each in folder.iterdir())
    assert names == ["study.h5.journal", "study.toml"]


@pytest.mark.parametrize("ranks", rest_slow([1, 3], lambda ranks: ranks == 3))
def test_nothing_is_counted_that_is_not_what_was_written(
    folders, by_one_rank, tmp_path, monkeypatch, ranks
):
    monkeypatch.setattr(assembly, "COUNTED_ROWS", 100)
    count, damaged = assembly.Assembly.count, []

    def after_damage(rank_zero, together):
        file = rank_zero.file
        os.pwrite(file.descriptor, b"\5" * 100, file.plan.columns["outcome"][0] + 70_000)
        damaged.append(together)
        return count(rank_zero, together)

    monkeypatch.setattr(assembly.Assembly, "count", after_damage)
    made, _, _ = assemble(copied(folders["new file"], tmp_path), ranks)
    assert damaged == [True]
    assert made.read_bytes() == by_one_rank.read_bytes()


@pytest.mark.slow
def test_an_older_file_that_is_another_one_by_now_is_not_read(folders, tmp_path, monkeypatch):
    folder = copied(folders["extended file"], tmp_path)
    found = row_store.old_columns

    def other(table):
        columns = found(table)
        (folder / "other").write_bytes((folder / "study.h5").read_bytes() + b"?")
        (folder / "other").replace(folder / "study.h5")
        return columns

    monkeypatch.setattr(row_store, "old_columns", other)
    made, [line], _ = assemble(folder, 2)
    assert "study.h5 is a different file here" in line
    assert made.exists()


def test_a_signal_ends_it_and_leaves_nothing_behind(folders, tmp_path, monkeypatch):
    folder = copied(folders["new file"], tmp_path)
    monkeypatch.setattr(assembly, "stop_requested", lambda: True)
    before = journal_path(folder / "study.h5").read_bytes()
    with pytest.raises(StopRequested):
        assemble(folder, 3)
    assert sorted(path.name for path in folder.iterdir()) == [
        "study.h5.journal", "study.toml",
    ]  # fmt: skip
    assert journal_path(folder / "study.h5").read_bytes().startswith(before)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "kind"), [("new file", "mpirun -n 2"), ("extended file", "--jobs 2")]
)
def test_a_kill_while_the_file_is_made_loses_nothing(folders, reference, name, kind):
    if kind.startswith("mpirun"):
        mpirun()
    found = kill_once(folders[name], kind, "group", random.Random(1), 0.01, reference)
    problem, _, hung, _ = found
    assert (problem, hung) == ("", False)


PEAKS = """\
import contextlib, io, resource, sys
from flocsim.__main__ import main
from flocsim.commands.show import read_content
from tests.helpers.results_files import same_data

for path in sys.argv[1:]:
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(["info", path]) == 0
    read_content(path)
    assert same_data(path, path) == []
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


@pytest.mark.slow
def test_readers_of_a_large_file_take_no_more_memory_than_of_a_small_one(reference, tmp_path):
    large = finish_here(write_study(tmp_path, 5 * REPLICATES))
    done = subprocess.run(
        [sys.executable, "-c", PEAKS, reference, large], capture_output=True, text=True, check=True
    )
    before, after = map(float, done.stdout.split())
    assert large.stat().st_size > 50e6
    assert after - before < 12.0
