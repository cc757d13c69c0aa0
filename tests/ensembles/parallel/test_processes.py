"""What copies of the process do for it."""

import json
import multiprocessing
import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from flocsim.ensembles import runner
from flocsim.ensembles.kind import flocs_of, study_of
from flocsim.ensembles.parallel.processes import in_copies
from tests.helpers.small_study import small_config
from tests.helpers.swarm_study import swarm_config
from tests.helpers.waiting import PATIENCE, wait_until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux")


def has_ended(number):
    """Whether a process is gone, or soon is; nobody may have asked for its exit code."""

    def gone():
        try:
            return Path(f"/proc/{number}/stat").read_text().split()[2] == "Z"
        except (FileNotFoundError, ProcessLookupError):
            return True

    return wait_until(gone)


def test_works_are_done_in_other_processes_by_the_end(tmp_path):
    paths = [tmp_path / str(place) for place in range(3)]
    in_copies([partial(leave, path) for path in paths])
    numbers = {path.read_text() for path in paths}
    assert len(numbers) == 3 and str(os.getpid()) not in numbers


def leave(path):
    path.write_text(str(os.getpid()))


def test_a_process_that_may_have_no_children_does_the_works_itself(tmp_path):
    # As the processes of --jobs, where the engine is not compiled yet.
    context = multiprocessing.get_context("fork")
    work = partial(leave, tmp_path / "done")
    process = context.Process(target=in_copies, args=([work],), daemon=True)
    process.start()
    process.join(PATIENCE)
    assert process.exitcode == 0
    assert (tmp_path / "done").read_text() == str(process.pid)


def test_the_first_one_speaks_and_how_a_work_fails_is_not_told(capfd):
    in_copies([partial(print, "one"), partial(print, "two"), lambda: 1 / 0])
    assert capfd.readouterr() == ("one\n", "")


KILLED = """
import os, time
from flocsim.ensembles.parallel.processes import in_copies

def work():
    print(os.getpid(), flush=True)
    time.sleep(1200.0)

in_copies([work])
"""


def test_they_end_with_a_killed_parent():
    job = subprocess.Popen([sys.executable, "-c", KILLED], stdout=subprocess.PIPE, text=True)
    number = int(job.stdout.readline())
    os.kill(job.pid, signal.SIGKILL)
    job.wait(timeout=PATIENCE)
    assert has_ended(number)


def test_a_study_knows_which_engines_the_disk_has(tmp_path, environment):
    config = small_config(tmp_path, {"shapes": {"vertices": [1, 4]}})
    study = study_of(config, flocs_of(config))
    study.compile(study.kinds)
    assert study.uncompiled(study.kinds) == []
    environment["FLOCSIM_CACHE"] = str(tmp_path / "cache")
    assert study.uncompiled(study.kinds) == study.kinds
    encounter = study.draw(*study.kinds[0], 0.0, 0).encounter
    name = study.batches.driver(encounter, config.integrator.method).name
    (tmp_path / "cache" / f"{name}-1234.code").touch()
    assert study.uncompiled(study.kinds) == study.kinds[1:]
    environment["FLOCSIM_CACHE"] = str(tmp_path / "small.toml" / "no folder")
    assert study.uncompiled(study.kinds) == []


def test_a_study_of_swarms_knows_whether_the_disk_has_its_engine(tmp_path, own_cache):
    study = study_of(swarm_config(tmp_path))
    own_cache.mkdir()
    assert study.uncompiled(study.kinds) == study.kinds
    name = study.first.begin(1.0).runner.driver.name
    (own_cache / f"{name}-1234.code").touch()
    assert study.uncompiled(study.kinds) == []


@pytest.mark.parametrize("rank", [0, 1])
def test_each_rank_compiles_its_own_kinds_in_a_copy(tmp_path, rank):
    compiled = tmp_path / "compiled"
    study = SimpleNamespace(
        kinds=[(0, 1), (0, 4)], uncompiled=list, compile=partial(note, compiled)
    )
    comm = SimpleNamespace(
        rank=rank,
        size=2,
        barrier=lambda: None,
        gather=lambda value: None,
        broadcast=lambda value: None,
    )
    runner.compile_in_turn(study, comm)
    lines = [json.loads(line) for line in compiled.read_text().splitlines()]
    own, every = [list(study.kinds[rank])], [list(each) for each in study.kinds]
    assert [kinds for _, kinds in lines] == [own, every]
    assert [number == os.getpid() for number, _ in lines] == [False, True]


def note(path, kinds):
    with path.open("a") as file:
        file.write(json.dumps([os.getpid(), list(kinds)]) + "\n")
