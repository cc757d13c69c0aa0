"""Machines that round otherwise are told apart; rows that come out otherwise stop a run."""

import os
import subprocess
import sys

import attrs
import numpy as np
import pytest

from flocsim.ensembles import runner
from flocsim.ensembles.chunks import COLUMNS, ROW
from flocsim.ensembles.parallel.communicator import SerialCommunicator
from flocsim.ensembles.runner import SharedError, run_to_file
from flocsim.ensembles.storage.first_rows import difference, packed
from flocsim.ensembles.storage.resume import NEW, RESUME
from flocsim.ensembles.study import Study
from flocsim.errors import UsageError
from flocsim.io.results.file import read_results
from tests.helpers.small_study import small_config, small_study
from tests.helpers.tiers import rest_slow

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
        "from flocsim.integrators.radau import tableau as t; print(t.INVERSE, t.FROM_VECTORS);"
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


def changed(row):
    return row | {"t_end": np.nextafter(row["t_end"], np.inf)}


def test_a_rank_whose_first_row_differs_is_named(tmp_path):
    study = small_study(tmp_path, SPHERES)
    rows = study.compile(study.kinds)
    other = packed(study, {(0, 1): changed(rows[0, 1])})
    rows = packed(study, rows)
    assert len(rows[0, 1]) == ROW.itemsize
    assert difference(study, [rows, rows], "aa", {}) == difference(study, [rows], "a", rows) == ""
    line = difference(study, [rows, rows, other], "aaa", {})
    assert line.startswith(
        "replicate 0 of type I, N = 1, delta 0 differs between rank 2 and rank 0"
    )
    assert "differently here from the file" in difference(study, [rows], "a", other)
    assert "rank 1 rounds sin, exp" in difference(study, [rows, rows], "ab", {})


def test_a_file_whose_first_row_comes_out_otherwise_is_not_gone_on_with(tmp_path, monkeypatch):
    output = tmp_path / "r.h5"
    run_to_file(small_config(tmp_path, SPHERES), SerialCommunicator(), output, NEW)
    before = output.read_bytes()
    original = Study.run
    monkeypatch.setattr(Study, "run", lambda *words, **more: changed(original(*words, **more)))
    more = small_config(tmp_path, SPHERES | {"replicates": 3})
    with pytest.raises(SharedError, match="replicate 0 of type I, N = 1, delta 0 comes out") as why:
        run_to_file(more, SerialCommunicator(), output, RESUME)
    assert isinstance(why.value.args[0], UsageError)
    assert output.read_bytes() == before
    monkeypatch.undo()
    assert run_to_file(more, SerialCommunicator(), output, RESUME).computed == 1


@pytest.mark.slow
def test_stored_rows_are_those_of_the_file(tmp_path):
    output = tmp_path / "r.h5"
    config = small_config(tmp_path, SPHERES)
    run_to_file(config, SerialCommunicator(), output, NEW)
    study, seen = Study(config), []
    original = runner.first_rows.stored_rows

    def noted(study, store):
        seen.append(original(study, store))
        return seen[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runner.first_rows, "stored_rows", noted)
        more = attrs.evolve(config, replicates=3)
        run_to_file(more, SerialCommunicator(), output, RESUME)
    table = read_results(output).replicates
    row = np.array(tuple(table[name][0, 0, 0, 0] for name in COLUMNS), ROW)
    assert seen == [{(0, 1): row.tobytes()}] == [packed(study, study.compile([(0, 1)]))]
