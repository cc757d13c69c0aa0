"""Kinds of CPU: what decides the last digits is recorded, and a mixture is told."""

import json
import os
import subprocess
import sys

import pytest

from flocsim.compiler.processor import cpu_kind
from flocsim.ensembles import runner
from flocsim.ensembles.pairs import study as pairs
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.runner import run, run_to_file
from flocsim.ensembles.storage.resume import NEW, RESUME
from flocsim.io.journal import SESSION, journal_path
from flocsim.io.results.file import read_results
from flocsim.io.results.run_group import (
    describe_kind,
    distinct,
)
from tests.helpers.journals import records_in
from tests.helpers.small_study import small_config
from tests.helpers.tiers import rest_slow

HERE = {
    "cpu": "znver4", "compiled_for": "znver4", "features": ["avx2", "avx512f", "fma"],
    "numpy": ["X86_V3", "X86_V4"], "libm": ["glibc 2.36"],
}  # fmt: skip
OTHER = HERE | {"cpu": "znver2", "compiled_for": "znver2", "features": ["avx2", "fma"],
                "numpy": ["X86_V3"]}  # fmt: skip
SPHERES = {"shapes": {"vertices": [1]}, "scene": {"types": ["I"], "delta": [0.0]}, "replicates": 5}


@pytest.mark.parametrize(
    ("name", "value", "differing"),
    rest_slow(
        [
            ("NUMBA_CPU_NAME", "generic", {"compiled_for", "features"}),
            ("NUMBA_CPU_FEATURES", "+sse2", {"features"}),
            ("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2", {"libm"}),
        ],
        lambda name, value, differing: name == "NUMBA_CPU_NAME",
    ),
)
def test_another_kind_is_seen_by_what_makes_it_one(name, value, differing):
    code = "import json; from flocsim.compiler.processor import cpu_kind as k; "
    command = [sys.executable, "-c", code + "print(json.dumps(k()))"]
    env = {key: text for key, text in os.environ.items() if key != name}
    here, there = (
        json.loads(subprocess.run(command, env=each, capture_output=True, check=True).stdout)
        for each in (env, env | {name: value})
    )
    assert {key for key in here if here[key] != there[key]} == differing
    assert here == json.loads(json.dumps(here))


def test_what_numpy_does_not_use_makes_another_kind():
    found = cpu_kind()["numpy"]
    if "X86_V4" not in found:
        pytest.skip("numpy uses no AVX-512 here")
    code = "from flocsim.compiler.processor import cpu_kind; print(cpu_kind()['numpy'])"
    env = os.environ | {"NPY_DISABLE_CPU_FEATURES": "X86_V4"}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert "X86_V4" not in done.stdout
    assert "X86_V3" in done.stdout


def test_words_name_what_tells_two_kinds_apart():
    assert describe_kind(HERE) == "znver4"
    assert describe_kind(HERE, [OTHER]) == "znver4 (avx512f, X86_V4)"
    assert describe_kind(OTHER, [HERE]) == "znver2"
    generic = HERE | {"compiled_for": "generic", "features": []}
    assert describe_kind(generic, [HERE]) == "znver4 (compiled for generic)"
    assert describe_kind(HERE, [generic]) == "znver4 (avx2, avx512f, fma)"
    assert distinct([HERE, OTHER, HERE]) == [HERE, OTHER]


def run_on(folder, monkeypatch, kind, mode=RESUME, **more):
    """Run the study as on a kind of CPU; how it Ended."""
    monkeypatch.setattr(runner, "cpu_kind", lambda: kind)
    return run_to_file(small_config(folder, SPHERES | more), Communicator(), folder / "r.h5", mode)


def cpus_of(path):
    """The kinds of CPU that a results file names."""
    return json.loads(read_results(path).run["cpus"])


@pytest.mark.slow
def test_a_results_file_extended_on_another_kind_records_both(tmp_path, monkeypatch):
    run_on(tmp_path, monkeypatch, HERE, NEW)
    assert cpus_of(tmp_path / "r.h5") == [HERE]
    run_on(tmp_path, monkeypatch, OTHER)  # nothing is computed
    assert run_on(tmp_path, monkeypatch, OTHER, replicates=6).computed == 1
    assert cpus_of(tmp_path / "r.h5") == [HERE, OTHER]
    run_on(tmp_path, monkeypatch, OTHER, replicates=7)
    assert cpus_of(tmp_path / "r.h5") == [HERE, OTHER]


def test_a_journal_resumed_on_another_kind_records_both(tmp_path, monkeypatch):
    run_on(tmp_path, monkeypatch, HERE, NEW)
    whole = read_results(tmp_path / "r.h5")
    (tmp_path / "r.h5").unlink()
    with monkeypatch.context() as patch:
        # All is in the journal, and the results file cannot be written.
        patch.setattr(pairs, "write_results", lambda *words: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            run_on(tmp_path, patch, HERE, NEW)
    [session] = records_in(journal_path(tmp_path / "r.h5"), SESSION)
    assert json.loads(session["about"])["cpus"] == [HERE]
    assert run_on(tmp_path, monkeypatch, OTHER, replicates=6).computed == 1
    results = read_results(tmp_path / "r.h5")
    assert json.loads(results.run["cpus"]) == [HERE, OTHER]
    assert (results.replicates["angle_i"][..., :5] == whole.replicates["angle_i"]).all()


def test_a_study_in_memory_records_its_kind(tmp_path):
    results = run(small_config(tmp_path, SPHERES))
    assert json.loads(results.run["cpus"]) == [cpu_kind()]
