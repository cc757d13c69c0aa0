"""Whatever happens to a study, nothing is lost, nothing hangs."""

import os
import resource
import signal
import subprocess

import pytest

from flocsim.io.results.file import read_results
from tests.helpers.jobs import alive, descendants, is_python, make_study, run_here
from tests.helpers.journals import rows_in
from tests.helpers.results_files import same_data
from tests.helpers.small_study import command, mpirun, problems, run_command
from tests.helpers.waiting import PATIENCE, wait_until

QUIETLY = ["study.toml", "--quiet", "--resume"]


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The results of an undisturbed run, which also compiles."""
    return run_here(make_study(tmp_path_factory.mktemp("faults") / "undisturbed"))


def assert_nothing_was_lost(folder, reference):
    """Finish a study: only what the journal lacks is run, and the results are the undisturbed."""
    finished, kept = (folder / "study.h5").exists(), rows_in(folder / "study.h5.journal")
    output = run_here(folder)
    assert same_data(reference, output) == []
    results = read_results(output)
    assert finished or results.run["computed"] == results.replicates["outcome"].size - kept


@pytest.mark.slow
@pytest.mark.parametrize(("ranks", "words"), [(3, []), (None, ["--jobs", "2"])])
def test_a_killed_rank_costs_nothing_that_was_finished(tmp_path, reference, ranks, words):
    if ranks:
        mpirun()
    folder = make_study(tmp_path / "study")
    journal = folder / "study.h5.journal"
    with subprocess.Popen(
        command(*QUIETLY, *words, ranks=ranks), cwd=folder, stderr=subprocess.DEVNULL
    ) as job:
        assert wait_until(lambda: rows_in(journal) > 0 or job.poll() is not None)
        pids = sorted(filter(is_python, descendants(job.pid)))
        os.kill(pids[-1], signal.SIGKILL)
        job.wait(timeout=PATIENCE)
        assert wait_until(lambda: not list(alive(pids)))
    assert_nothing_was_lost(folder, reference)


@pytest.mark.parametrize(
    ("size", "words"), [(60_000, []), pytest.param(500, ["--jobs", "2"], marks=pytest.mark.slow)]
)
def test_a_full_disk_ends_with_74_and_whole_chunks(tmp_path, reference, size, words):
    folder = make_study(tmp_path / "study")
    # No file may get longer, as though the disk were full then.
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))  # noqa: E731
    done = run_command(folder, *QUIETLY, *words, preexec_fn=limit)
    assert done.returncode == 74
    assert len(problems(done.stderr)) == 1
    assert "study.h5.journal could not be written: " in done.stderr
    assert_nothing_was_lost(folder, reference)
