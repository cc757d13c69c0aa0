"""Kinds of CPU: what decides the last digits of what is computed."""

import json
import os
import subprocess
import sys

import pytest

from flocsim.compiler.processor import cpu_kind
from tests.helpers.tiers import rest_slow


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
