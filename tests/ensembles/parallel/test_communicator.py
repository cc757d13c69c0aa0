"""Jobs under a real mpirun: the same results, one message, no hang."""

import os
import signal
import subprocess
import sys
import time

import pytest

from flocsim.__main__ import main
from flocsim.ensembles.parallel import processes
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.parallel.processes import find_communicator, launched_rank, launched_size
from flocsim.io.results.file import read_results
from tests.helpers.results_files import same_data
from tests.helpers.small_study import (
    SMALL,
    command,
    launcher_kind,
    mpirun,
    problems,
    run_command,
    write_small,
)
from tests.helpers.tiers import rest_slow
from tests.helpers.waiting import PATIENCE

LAUNCHER = (*processes.LAUNCHER_SIZES, *processes.LAUNCHER_RANKS)


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """The folder of the small study, run without a launcher."""
    folder = tmp_path_factory.mktemp("mpi")
    write_small(folder, vertices="[1, 4]")
    words = [str(folder / "small.toml"), "--output", str(folder / "serial.h5"), "--quiet"]
    assert main(["ensemble", *words]) == 0
    return folder


def unexpected(errors):
    """Lines on stderr: none, as the preset implies what is doubtful."""
    return errors.splitlines()


@pytest.mark.parametrize("ranks", rest_slow([1, 2, 3], lambda ranks: ranks == 3))
def test_any_number_of_ranks_gives_the_same_bytes(serial, ranks):
    name = f"ranks{ranks}.h5"
    done = run_command(serial, "small.toml", "--output", name, ranks=ranks)
    assert (done.returncode, unexpected(done.stderr)) == (0, [])
    assert f"on {ranks} rank" in done.stdout
    # One rank speaks.
    assert done.stdout.count("24 replicates: ") == 1
    assert same_data(serial / name, serial / "serial.h5") == []
    assert read_results(serial / name).run["ranks"] == ranks


PROBE = """\
import sys
from flocsim.__main__ import main
code = main(["ensemble", "small.toml", "--output", "probe.h5", "--dry-run"])
print("modules of mpi4py:", sorted(name for name in sys.modules if name.split(".")[0] == "mpi4py"))
sys.exit(code)
"""


@pytest.mark.slow
def test_without_threads_in_mpi_rank_0_answers_between_two_replicates(serial):
    env = os.environ | {"MPI4PY_RC_THREAD_LEVEL": "funneled"}
    done = run_command(serial, "small.toml", "--output", "slow.h5", "--quiet", ranks=3, env=env)
    assert (done.returncode, done.stdout, problems(done.stderr)) == (0, "", [])
    assert same_data(serial / "slow.h5", serial / "serial.h5") == []


@pytest.mark.parametrize("jobs", rest_slow([2, 3], lambda jobs: False))
def test_processes_of_this_machine_give_the_same_bytes(serial, jobs):
    name = f"jobs{jobs}.h5"
    done = run_command(serial, "small.toml", "--output", name, "--jobs", jobs)
    assert (done.returncode, unexpected(done.stderr)) == (0, [])
    assert f"on {jobs} ranks" in done.stdout
    assert same_data(serial / name, serial / "serial.h5") == []


@pytest.mark.parametrize(
    ("words", "ranks", "said"),
    [(["--jobs", 0], None, "must be at least 1"), (["--jobs", 2], 2, "leave out one or the other")],
)
def test_jobs_that_cannot_be_are_refused(serial, words, ranks, said):
    done = run_command(serial, "small.toml", *words, ranks=ranks)
    assert done.returncode == 2
    assert said in done.stderr


def test_without_a_launcher_mpi_is_not_even_imported(serial):
    done = subprocess.run(
        [sys.executable, "-c", PROBE], cwd=serial, capture_output=True, text=True, timeout=PATIENCE
    )
    assert (done.returncode, problems(done.stderr)) == (0, [])
    assert done.stdout.splitlines()[-1] == "modules of mpi4py: []"


FAILS_LATE = """\
import attrs
from flocsim.ensembles.parallel.processes import launched_rank
from flocsim.ensembles.study import Study
from flocsim.forces import CentreForce


def run_some(study, condition, first, stop, *more, original=Study.run_some):
    if len(more) > 1:  # not while it compiles
        raise MemoryError
    return original(study, condition, first, stop, *more)


if launched_rank() == 1:
    Study.run_some = run_some


@attrs.frozen
class Late(CentreForce):
    absent = "it only brings the trouble along"

    @staticmethod
    def kernel(pair):
        return 0.0
"""

YUKAWA = """\
import math

import attrs
from flocsim.fields import quantity
from flocsim.forces import CentreForce

SIGN = 1.0


@attrs.frozen
class Yukawa(CentreForce):
    strength: float = quantity("N", at_least=0.0)
    length: float = quantity("m", above=0.0)

    @staticmethod
    def kernel(pair, strength, length):
        return SIGN * strength * math.exp(-pair.gap / length)
"""

FAILS_EARLY = """\
from flocsim.ensembles.parallel.processes import launched_rank
if launched_rank() == 1:
    raise RuntimeError("no licence")
"""


def with_force(folder, source, name):
    """A config with a force of the module's in the folder."""
    (folder / "mine.py").write_text(source)
    text = f'[forces.mine]\nclass = "mine:{name}"\n'
    return write_small(folder, SMALL + text, vertices="[1]")


def test_a_rank_that_fails_half_way_ends_the_whole_job(tmp_path):
    with_force(tmp_path, FAILS_LATE, "Late")
    # More than rank 0 can run before rank 1 gets to it.
    done = run_command(tmp_path, "small.toml", "--replicates", 20_000, ranks=2)
    assert done.returncode == 70
    assert "flocsim: rank 1: out of memory: use fewer ranks on each machine" in done.stderr
    assert not (tmp_path / "small.h5").exists()


@pytest.mark.slow
def test_a_config_that_one_rank_cannot_load_stops_all(tmp_path):
    with_force(tmp_path, FAILS_EARLY + YUKAWA, "Yukawa")
    text = (tmp_path / "small.toml").read_text() + 'strength = "1 nN"\nlength = "1 um"\n'
    (tmp_path / "small.toml").write_text(text)
    done = run_command(tmp_path, "small.toml", ranks=2)
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert "mine.py:3: RuntimeError: no licence" in line


WRONG = [
    (["nowhere.toml"], {}, 2, "nowhere.toml: no such file"),
    (["small.toml"], {"types": '["IV"]'}, 2, "scene.types"),
    (["small.toml", "--output", "no/folder.h5"], {}, 74, "no/folder.h5 could not be written"),
]


@pytest.mark.parametrize(
    ("words", "changes", "code", "said"),
    rest_slow(WRONG, lambda words, changes, code, said: code == 74),
)
def test_what_is_wrong_is_said_by_one_rank_in_one_line(tmp_path, words, changes, code, said):
    write_small(tmp_path, **changes)
    done = run_command(tmp_path, *words, ranks=2)
    assert (done.returncode, done.stdout) == (code, "")
    [line] = done.stderr.splitlines()
    assert said in line


@pytest.mark.parametrize(("words", "code", "said"), rest_slow(
    [("--bogus", 2, "error: "), ("--help", 0, "--dry-run  ")], lambda words, *_: words == "--bogus"
))  # fmt: skip
def test_wrong_arguments_and_help_are_printed_once(tmp_path, words, code, said):
    done = run_command(tmp_path, words, ranks=2)
    assert (done.returncode, (done.stdout + done.stderr).count(said)) == (code, 1)


AFTER_CTRL_C = {
    "flocsim": (75, "SIGINT"), "MPICH": (75, "SIGINT"), "Open MPI": (1, "SIGTERM"),
    "Intel": (-signal.SIGINT, "SIGINT"),
}  # fmt: skip
"""Exit code, and the signal that ranks get. Others than MPICH's mpirun end as they like: Open MPI's
sends SIGTERM on, Intel's is a shell script, which the signal ends once its job has ended."""


@pytest.mark.parametrize("ranks", rest_slow([None, 2], bool))
def test_ctrl_c_saves_what_is_done_and_a_resumed_run_goes_on(serial, in_tmp, capsys, ranks):
    words = ["small.toml", "--replicates", "100000", "--output", f"late{ranks}.h5"]
    job = subprocess.Popen(
        command(*words, ranks=ranks),
        cwd=serial, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    assert "100000" in job.stdout.readline()
    journal = serial / f"late{ranks}.h5.journal"
    size = journal.stat().st_size
    while journal.stat().st_size == size:  # until a chunk is finished
        time.sleep(0.01)
    os.killpg(job.pid, signal.SIGINT)
    _, errors = job.communicate(timeout=PATIENCE)
    code, name = AFTER_CTRL_C["flocsim" if ranks is None else launcher_kind()]
    assert job.returncode == code
    # On a busy machine the job may be ended before it has told how far it is.
    assert f"stopped by {name}" in errors
    assert "Traceback" not in errors
    assert not (serial / f"late{ranks}.h5").exists()
    again = ["small.toml", "--output", f"late{ranks}.h5"]
    os.chdir(serial)
    assert main(["ensemble", *again]) == 2
    assert "holds an unfinished run: continue it with --resume" in capsys.readouterr().err
    assert main(["ensemble", *again, "--resume"]) == 0
    # What was computed beyond the three replicates that are asked for now is not thrown away.
    beyond = "has more rows than this run needs, and is kept"
    lines = unexpected(capsys.readouterr().err)
    assert all(beyond in line for line in lines)
    assert (serial / f"late{ranks}.h5.journal").exists() == (lines != [])
    assert same_data(serial / f"late{ranks}.h5", serial / "serial.h5") == []


@pytest.mark.slow
def test_a_force_of_ones_own_runs_on_all_ranks_and_is_never_stale(tmp_path):
    text = SMALL + '[forces.mine]\nclass = "mine:Yukawa"\nstrength = "1 nN"\nlength = "1 um"\n'
    write_small(tmp_path, text, vertices="[1]", types='["III"]', delta="[0.0]")
    classes = []
    for sign in ("1.0", "-1."):
        # Of the same length, within the same second: only the content tells the two apart.
        (tmp_path / "mine.py").write_text(YUKAWA.replace("1.0", sign, 1))
        done = run_command(tmp_path, "small.toml", "--quiet", "--overwrite", ranks=2)
        assert done.returncode == 0
        table = read_results(tmp_path / "small.h5").probabilities
        classes.append((int(table["n_held"].sum()), int(table["n_class"][..., 0].sum())))
    # Repelled by 1 nN the light spheres rest over each other untouched; attracted they stick.
    assert classes == [(3, 0), (0, 3)]


def test_a_launcher_of_another_kind_is_found_out(tmp_path):
    mpirun()
    write_small(tmp_path)
    env = os.environ | {"PMI_SIZE": "2", "PMI_RANK": "0", "PMI_CONTROL_PORT": "9"}
    done = run_command(tmp_path, "small.toml", env=env)
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert "the launcher started 2 ranks but MPI counts 1" in line


@pytest.mark.parametrize("more", [{}, {"PMI_FD": "9"}])
def test_ranks_of_a_launcher_that_has_gone_are_forgotten(folder, no_launcher, more):
    env = os.environ | {"PMI_RANK": "1", "PMI_SIZE": "2"} | more
    done = run_command(folder, "small.toml", "--dry-run", env=env)
    assert done.returncode == 0
    [line] = done.stderr.splitlines()
    assert line.startswith("flocsim: PMI_RANK=1 and PMI_SIZE=2 in the environment are left over")
    assert "on 1 rank" in done.stdout


@pytest.mark.parametrize(("rank", "lines"), [("0", 1), ("1", 0)])
def test_tasks_of_srun_that_are_no_ranks_do_not_run_side_by_side(
    tmp_path, no_launcher, rank, lines
):
    mpirun()
    write_small(tmp_path)
    env = os.environ | {"SLURM_STEP_NUM_TASKS": "2", "SLURM_PROCID": rank}
    done = run_command(tmp_path, "small.toml", env=env)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, lines)
    assert lines == 0 or "or srun --mpi=pmi2 (MPICH, Intel MPI) or --mpi=pmix" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["small.toml"]


def test_mpi_that_cannot_be_loaded_says_what_to_install(tmp_path):
    write_small(tmp_path)
    (tmp_path / "mpi4py.py").write_text("raise RuntimeError('cannot load MPI library')\n")
    launched = {"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "0"}
    env = os.environ | launched | {"PYTHONPATH": str(tmp_path)}
    done = run_command(tmp_path, "small.toml", env=env)
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert "mpi4py cannot be loaded (cannot load MPI library): install flocsim[mpi]" in line


@pytest.fixture
def no_launcher(environment):
    """An environment without any launcher's variables."""
    for name in (*LAUNCHER, "SLURM_PROCID"):
        environment.pop(name, None)
    return environment


def test_who_launched_this_process(no_launcher):
    assert (launched_size(), launched_rank()) == (0, 0)
    no_launcher["PMI_RANK"] = "3"
    assert (launched_size(), launched_rank()) == (None, 3)
    no_launcher["SLURM_STEP_NUM_TASKS"] = "2"
    assert launched_size() == 2
    no_launcher["PMI_SIZE"] = "4"
    assert launched_size() == 4


def test_one_rank_works_alone(no_launcher):
    assert type(find_communicator()) is Communicator
    no_launcher["PMI_SIZE"] = "1"
    assert type(find_communicator()) is Communicator


def test_a_communicator_of_one():
    alone = Communicator()
    alone.barrier()
    assert (alone.gather(5), alone.broadcast(5)) == ([5], 5)
    with pytest.raises(SystemExit) as caught:
        alone.abort(70)
    assert caught.value.code == 70
