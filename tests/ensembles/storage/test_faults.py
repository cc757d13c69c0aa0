"""Whatever happens to a study, nothing is lost, nothing hangs."""

import random
import resource
import signal

import pytest

from tests.helpers.jobs import Job, errors_of, make_study, run_here, verdict
from tests.helpers.small_study import mpirun, problems
from tests.helpers.tiers import rest_slow


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """A folder to work in."""
    return tmp_path_factory.mktemp("faults")


@pytest.fixture(scope="module")
def reference(root):
    """The results of an undisturbed run, which also compiles."""
    return run_here(make_study(root / "ref"))


def job(folder, kind):
    """A job that has begun to write."""
    if kind.startswith("mpirun"):
        mpirun()
    started = Job.start(folder, kind)
    started.wait_for_journal()
    return started


@pytest.mark.parametrize(
    ("kind", "target"),
    rest_slow(
        [("mpirun -n 2", "rank"), ("mpirun -n 3", "launcher"), ("--jobs 2", "group")],
        lambda kind, target: False,
    ),
)
def test_a_kill_costs_nothing_that_was_finished(root, reference, kind, target):
    folder = make_study(root / f"kill {kind} {target}")
    started = job(folder, kind)
    pids = started.send(signal.SIGKILL, target, random.Random(1))
    code, _ = started.finish(pids)
    assert code is not None
    assert verdict(folder, reference) == ""


@pytest.mark.parametrize(
    ("kind", "sign"),
    rest_slow(
        [("serial", signal.SIGTERM), ("mpirun -n 2", signal.SIGUSR1), ("--jobs 2", signal.SIGINT)],
        lambda kind, sign: False,
    ),
)
def test_a_signal_ends_with_75_and_a_journal(root, reference, kind, sign):
    folder = make_study(root / f"signal {kind}")
    started = job(folder, kind)
    code, _ = started.finish(started.send(sign, "launcher", random.Random(1)))
    assert code == 75
    errors = errors_of(folder).read_text()
    assert f"stopped by {sign.name}" in errors
    assert "Traceback" not in errors
    assert verdict(folder, reference) == ""


@pytest.mark.parametrize(
    ("kind", "size"), [("serial", 60_000), pytest.param("--jobs 2", 500, marks=pytest.mark.slow)]
)
def test_a_full_disk_ends_with_74_and_whole_chunks(root, reference, kind, size):
    folder = make_study(root / f"disk {kind} {size}")
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))  # noqa: E731
    started = Job.start(folder, kind, preexec_fn=limit)
    code, _ = started.finish([started.process.pid])
    assert code == 74
    errors = errors_of(folder).read_text()
    assert len(problems(errors)) == 1
    assert "study.h5.journal could not be written: " in errors
    assert verdict(folder, reference) == ""
