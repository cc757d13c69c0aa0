"""What every kind of study can do: each ability works with each kind."""

import os
import shutil
import signal
import subprocess
import sys
import time
from itertools import product
from pathlib import Path

import attrs
import numpy as np
import pytest

import flocsim
from flocsim.__main__ import main
from flocsim.io.results.file import read_results
from flocsim.io.results.swarm_file import SWARMS
from tests.helpers import parts_here
from tests.helpers.journals import has_begun
from tests.helpers.kernel_study import kernel_text
from tests.helpers.small_study import mpirun
from tests.helpers.swarm_study import SWARM
from tests.helpers.tiers import rest_slow
from tests.helpers.waiting import PATIENCE

PAIRS = """\
preset = "tang2014"
seed = 1
replicates = 6
[scene]
types = ["III"]
delta = [0.25]
[shapes]
vertices = [1]
pool = 2
"""


@attrs.frozen
class Kind:
    """A kind of study: the words that run it, those that ask for more, its config, its reader."""

    name: str
    words: tuple[str, ...]
    more: tuple[str, ...]
    text: str
    read: object


KINDS = {
    each.name: each
    for each in (
        Kind("pairs", ("ensemble", "pairs.toml"), ("--replicates", "9"), PAIRS, read_results),
        Kind("rates", ("kernel", "rates.toml"), ("--replicates", "16"),
             kernel_text(replicates=8, scrambles=2).replace("kernel.h5", "rates.h5"), read_results),
        Kind("swarms", ("swarm", "swarms.toml"), ("--replicates", "3"),
             SWARM.replace('file = "swarm.h5"', 'file = "swarms.h5"'), SWARMS.read),
    )
}  # fmt: skip


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A folder with all configs and finished studies."""
    folder = tmp_path_factory.mktemp("matrix")
    for kind in KINDS.values():
        (folder / f"{kind.name}.toml").write_text(kind.text, "utf-8")
    here = os.getcwd()
    os.chdir(folder)
    try:
        for kind in KINDS.values():
            assert main([*kind.words, "-o", f"{kind.name}.h5", "--quiet"]) == 0
    finally:
        os.chdir(here)
    return folder


@attrs.frozen
class Cell:
    """A kind in a folder of its own, with its finished study and those of the others."""

    kind: Kind
    file: str

    def run(self, *words, output="new.h5"):
        """The exit code of its command with more words."""
        out = ["-o", output] if output else []
        return main([*self.kind.words, *words, *out, "--quiet"])

    def same(self, one, other):
        """Whether two files hold the same but for where they came from."""
        a, b = ([*columns(self.kind.read(each))] for each in (one, other))
        return len(a) > 2 and a == b


def columns(found):
    """All arrays of results as text, whatever their kind."""
    groups = getattr(found, "groups", None) or {
        name: getattr(found, name) for name in ("replicates", "probabilities")
    }
    for group in groups.values():
        yield from (str(np.asarray(each).tolist()) for each in group.values())


def in_processes(cell):
    assert cell.run("--jobs", "2") == 0
    assert cell.same("new.h5", cell.file)


def under_mpirun(cell):
    words = [mpirun(), "-n", "2", sys.executable, "-m", "flocsim", *cell.kind.words]
    done = subprocess.run(
        [*words, "-o", "new.h5", "--quiet"], capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 0, done.stderr
    assert cell.same("new.h5", cell.file)


def killed(cell):
    """Kill the command once something was computed."""
    words = [sys.executable, "-m", "flocsim", *cell.kind.words, "-o", "new.h5"]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, start_new_session=True) as running:
        until = time.monotonic() + PATIENCE
        while running.poll() is None and time.monotonic() < until:
            if has_begun(Path("new.h5.journal")):
                break
            time.sleep(0.002)
        running.send_signal(signal.SIGKILL)


def resume(cell):
    killed(cell)
    assert cell.run("--resume") == 0
    assert cell.same("new.h5", cell.file)


def extend(cell):
    shutil.copy(cell.file, "new.h5")
    assert cell.run(*cell.kind.more, "--resume") == 0
    assert cell.run(*cell.kind.more, output="fresh.h5") == 0
    assert cell.same("new.h5", "fresh.h5") and not cell.same("new.h5", cell.file)


def read_while_running(cell):
    killed(cell)
    assert os.path.exists("new.h5.journal")
    assert main(["info", "new.h5"]) == 0
    assert main(["plot", "new.h5"]) == 0


def opened(cell):
    found = flocsim.open(cell.file)
    pytest.importorskip("xarray")
    assert len(found.to_xarray().data_vars) > 3
    assert len(found.to_pandas()) > 0


def study(cell):
    found = flocsim.Study(f"{cell.kind.name}.toml").run(output="new.h5")
    assert "esults(" in repr(found) and cell.same("new.h5", cell.file)


def swept(cell):
    with parts_here.used():
        return swept_here(cell)


def swept_here(cell):
    words = ["sweep", cell.kind.words[1], "-o", "swept.h5"]
    code = main([*words, "--over", "fluid.viscosity=1e-3"])
    if code == 0:
        assert main([*words, "--over", "fluid.viscosity=1e-3,2e-3", "--resume"]) == 0
        assert main(["info", "swept.h5"]) == 0 == main(["plot", "swept.h5"])
        assert flocsim.open("swept.h5").to_xarray().sizes["viscosity"] == 2
    return code


def compared(cell):
    return main(["compare", cell.file, cell.file])


ABILITIES = {
    "jobs": in_processes,
    "mpirun": under_mpirun,
    "resume": resume,
    "extend": extend,
    "read while running": read_while_running,
    "open": opened,
    "Study": study,
    "sweep": swept,
    "compare": compared,
    "report": lambda cell: main(["report", cell.file]),
    "info": lambda cell: main(["info", cell.file]),
    "plot": lambda cell: main(["plot", cell.file]),
    "export": lambda cell: main(["export", "csv", cell.file]),
    "dry run": lambda cell: cell.run("--dry-run"),
}
LONG = {
    "jobs": None, "mpirun": "swarms", "resume": "pairs", "read while running": "swarms",
    "sweep": "rates", "extend": "pairs", "Study": None, "report": "rates", "plot": "rates",
}  # fmt: skip
"""Abilities that take long → the kind that shows them in the default run. Pairs under mpirun, in
processes and by Study, swarms and rates that are resumed and extended, have tests of their own."""


def is_quick(ability, kind):
    return LONG.get(ability, kind) == kind


CELLS = rest_slow(product(ABILITIES, KINDS), is_quick)


@pytest.mark.parametrize(("ability", "kind"), CELLS)
def test_every_kind_has_every_ability(home, in_tmp, ability, kind):
    shutil.copytree(home, in_tmp, dirs_exist_ok=True)
    assert not ABILITIES[ability](Cell(KINDS[kind], f"{kind}.h5"))


@pytest.mark.parametrize("kind", ["pairs", "rates", "swarms"])
def test_the_origin_of_rows_is_recorded(home, in_tmp, kind):
    shutil.copytree(home, in_tmp, dirs_exist_ok=True)
    cell, file = Cell(KINDS[kind], f"{kind}.h5"), f"{kind}.h5"
    run = cell.kind.read(file).run
    assert run["processor"] and run["identity"] and run["history"] == "[]"
