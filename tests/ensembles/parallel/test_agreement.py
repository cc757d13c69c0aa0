"""No two ranks of a job run two things: rank 0 hands out what it has read, the rest is compared."""

import os
import subprocess
import sys

import pytest

from flocsim.compiler.processor import versions
from flocsim.ensembles import runner
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.parallel.communicator import Communicator, SharedError
from flocsim.ensembles.runner import first_difference, run_to_file
from flocsim.errors import UsageError
from flocsim.io.results.file import read_results
from tests.helpers.own_force import write_own
from tests.helpers.results_files import same_data
from tests.helpers.small_study import (
    SMALL,
    problems,
    run_command,
    small_config,
    write_small,
    write_star_library,
)
from tests.helpers.tiers import rest_slow

HERE = versions() | {"seed": 1, "kernels.spheres": "ab", "code": "cd"}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"seed": 2}, "in seed (2, on rank 0 1)"),
        ({"kernels.spheres": "xy"}, "in kernels.spheres ('xy', on rank 0 'ab')"),
        ({"code": "xy", "version of numpy": "2.1"}, "in version of numpy ('2.1', on rank 0"),
        ({"more": "xy"}, "in more ('xy', on rank 0 None)"),
    ],
)
def test_a_rank_that_would_compute_something_else_is_named(changed, said):
    line = first_difference(3, HERE, HERE | changed)
    assert line.startswith("rank 3 on ") and said in line and "\n" not in line
    assert first_difference(3, HERE, HERE) == ""


def test_the_versions_of_all_that_computes_are_compared():
    found = versions()
    assert {"version of numpy", "version of numba", "version of flocsim"} < found.keys()
    assert sys.version == found["version of Python"]


class Pair(Communicator):
    """Rank 0 of two; rank 1 answers as it is told to."""

    size = 2

    def __init__(self, answer):
        super().__init__()
        self.answer, self.heard = answer, []

    def send(self, to, message):
        """What rank 1 would hear."""
        self.heard.append(message)

    def gather(self, value):
        """The answers of both."""
        return [value, self.answer(value)]


def test_a_disagreement_ends_rank_0_with_one_line_and_the_others_with_its_code(tmp_path):
    comm = Pair(lambda own: UsageError("rank 1 on n1 has seed 2"))
    config = small_config(tmp_path, {"shapes": {"vertices": [1]}})
    with pytest.raises(SharedError, match="rank 1 on n1 has seed 2"):
        run_to_file(config, comm, tmp_path / "r.h5", "new")
    assert comm.heard[-1].exit_code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["small.toml"]


def test_a_kernel_that_cannot_be_hashed_ends_all_ranks(tmp_path):
    config = load_config(write_own(tmp_path, factor="[-1.0]"))
    comm = Pair(lambda own: own)
    with pytest.raises(SharedError, match=r"own_pull.py:\d+\) reads the global 'FACTOR', a list"):
        run_to_file(config, comm, tmp_path / "r.h5", "new")
    assert comm.heard[-1].exit_code == 2


EDITS = """\
import os, pathlib
from flocsim.ensembles.config import sources
if os.environ.get("FLOCSIM_EDIT"):
    text = sources.Sources.text

    def edited(self, path):
        found = text(self, path)
        pathlib.Path(path).write_text(found.replace("seed = 1", "seed = 9"))
        module = pathlib.Path("neighbour.py")
        return found

    sources.Sources.text = edited
    module = sources.Sources.module

    def replaced(self, path, folder):
        found = module(self, path, folder)
        pathlib.Path(path).write_bytes(found.replace(b"-1.0", b"+1.0"))
        return found

    sources.Sources.module = replaced
"""
"""A module that edits the config and the user's modules as soon as they have been read."""


@pytest.mark.parametrize("ranks", rest_slow([None, 2], lambda ranks: False))
def test_files_that_are_edited_during_the_start_are_read_once(tmp_path, ranks):
    path = write_own(tmp_path)
    before = path.read_text()
    (tmp_path / "sitecustomize.py").write_text(EDITS)
    env = os.environ | {"FLOCSIM_EDIT": "1"}
    env["PYTHONPATH"] = os.pathsep.join([str(tmp_path), env.get("PYTHONPATH", "")])
    words = [] if ranks else ["--jobs", "2"]
    done = run_command(tmp_path, "small.toml", "--quiet", *words, ranks=ranks, env=env)
    assert (done.returncode, problems(done.stderr)) == (0, [])
    assert "seed = 9" in path.read_text()
    assert "+1.0" in (tmp_path / "neighbour.py").read_text()
    path.write_text(before)
    write_own(tmp_path)
    done = run_command(tmp_path, "small.toml", "--quiet", "-o", "alone.h5")
    assert (done.returncode, problems(done.stderr)) == (0, [])
    assert same_data(tmp_path / "small.h5", tmp_path / "alone.h5") == []
    assert read_results(tmp_path / "small.h5").run["ranks"] == 2


DIFFERS = """\
import os
if "1" in map(os.environ.get, ("PMI_RANK", "OMPI_COMM_WORLD_RANK")):
    from flocsim.ensembles import runner

    found = runner.versions()
    runner.versions = lambda: found | {"version of numpy": "0.9"}
"""


def test_ranks_with_other_versions_are_refused_by_all(tmp_path):
    write_small(tmp_path, vertices="[1]")
    (tmp_path / "sitecustomize.py").write_text(DIFFERS)
    env = os.environ | {}
    env["PYTHONPATH"] = os.pathsep.join([str(tmp_path), env.get("PYTHONPATH", "")])
    done = run_command(tmp_path, "small.toml", ranks=2, env=env)
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert "rank 1 on " in line
    assert "differs from rank 0 in version of numpy ('0.9', on rank 0" in line
    assert not list(tmp_path.glob("small.h5*"))


def test_a_library_that_is_replaced_during_the_start_is_read_once(tmp_path):
    library = tmp_path / "stars.h5"
    write_star_library(library)
    text = SMALL.replace("[shapes]", '[shapes]\nsource = "library"\nfile = "stars.h5"')
    config = load_config(write_small(tmp_path, text, vertices="[4]", replicates="2"))
    comm = Pair(lambda own: own)
    comm.send = lambda to, message: library.unlink(missing_ok=True)
    study, *_ = runner.join(config, comm)
    assert len(study.flocs) == 3
    assert not library.exists()


SPHERES = {"shapes": {"vertices": [1]}, "scene": {"types": ["I"], "delta": [0.0]}, "replicates": 2}


@pytest.mark.parametrize(
    ("name", "value"),
    rest_slow(
        [
            ("OPENBLAS_CORETYPE", "Prescott"),
            ("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4"),
            ("NPY_DISABLE_CPU_FEATURES", "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"),
        ],
        lambda name, value: name == "GLIBC_TUNABLES",
    ),
)
def test_a_machine_that_rounds_otherwise_has_another_digest(name, value):
    code = (
        "from flocsim.ensembles.storage.identity import arithmetic_digest as a; print(a());"
        "from flocsim.integrators.radau import tableau as t; print(t.INVERSE, t.FROM_EIGENBASIS);"
        "import math, numpy as np; x = np.linspace(1, 9, 2000); print(hash((np.exp(x).tobytes(),"
        "tuple(map(math.exp, x)), tuple(map(math.sin, x)),"
        "np.linalg.solve(x.reshape(-1, 2, 2) ** 2, x.reshape(-1, 2, 2)).tobytes(),"
        "(x[:100].reshape(-1, 2) @ np.array([[.6, .8], [-.8, .6]])).tobytes())))"
    )
    env = {key: text for key, text in os.environ.items() if key != name} | {"PYTHONHASHSEED": "0"}
    found = [
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", code], env=each, capture_output=True, text=True
        ).stdout.splitlines()
        for each in (env, env | {name: value})
    ]
    if len(found[1]) < 3 or found[0][2] == found[1][2]:
        pytest.skip("this machine computes the same under that setting")
    assert found[0][0] != found[1][0]
    # What is compiled in does not hang on the machine.
    assert found[0][1] == found[1][1]
