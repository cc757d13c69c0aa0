"""Whoever is killed takes along all that it has started, and what was finished is gone on with."""

import os
import signal
import subprocess
import sys

import pytest

from tests.ensembles.test_matrix import PAIRS
from tests.helpers.journals import has_begun
from tests.helpers.swarm_study import SWARM
from tests.helpers.tiers import rest_slow
from tests.helpers.waiting import PATIENCE, wait_until

SCRIPT = """\
import flocsim
flocsim.Study("study.toml").run(jobs=2, output="new.h5", mode="resume")
"""
FLOCSIM = [sys.executable, "-m", "flocsim"]
OVER = ["--over", "fluid.viscosity=1e-3,2e-3"]
SWEEP = ["sweep", "study.toml", *OVER, "-o", "new.h5", "--jobs", "2"]
RUNS = {
    "sweep": ([*FLOCSIM, *SWEEP], "new.parts/0000.h5.journal", ["--resume"]),
    "Study.run": ([sys.executable, "-c", SCRIPT], "new.h5.journal", []),
}
"""What is killed, a file that shows that its processes work, further words that go on with it."""


def members(group):
    """The processes of a group that run; one that nobody has waited for is none."""
    found = subprocess.run(["ps", "-eo", "pid=,pgid=,stat="], capture_output=True, text=True).stdout
    rows = [line.split() for line in found.splitlines()]
    return [int(pid) for pid, of, state in rows if int(of) == group and state[0] != "Z"]


@pytest.mark.parametrize(
    ("name", "text"),
    rest_slow([("sweep", PAIRS), ("sweep", SWARM), ("Study.run", PAIRS),
               ("Study.run", SWARM)], lambda name, text: name == "sweep" and text is PAIRS),
    ids=["sweep", "sweep of swarms", "Study.run", "Study.run of swarms"],
)  # fmt: skip
def test_nobody_is_left_and_the_rest_is_run(in_tmp, name, text):
    # As many as take longer than it is until the first are seen.
    few, more = ("= 6", "= 1000") if text is PAIRS else ("= 2", "= 40")
    assert f"replicates {few}\n" in text
    changed = text.replace(f"replicates {few}\n", f"replicates {more}\n")
    (in_tmp / "study.toml").write_text(changed, "utf-8")
    first, shows, then = RUNS[name]
    running = subprocess.Popen(
        first, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        path = in_tmp / shows
        # Looked at first: once there are rows, a quick machine may soon be done with all.
        assert wait_until(lambda: len(members(running.pid)) > 1)
        assert wait_until(lambda: has_begun(path))
        running.send_signal(signal.SIGKILL)
        running.wait()
        assert wait_until(lambda: not members(running.pid)), members(running.pid)
    finally:
        for each in members(running.pid):
            os.kill(each, signal.SIGKILL)
    done = subprocess.run([*first, *then], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    assert (in_tmp / "new.h5").exists()
