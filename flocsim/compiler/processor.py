"""What of the processor, of numba's settings and of the libraries decides what is computed."""

import functools
import os
import platform
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

PACKAGES = "numba", "llvmlite", "numpy", "scipy", "shapely", "flocsim"
COMPILERS = "numba", "llvmlite", "numpy", "flocsim"
"""Packages of which machine code depends on the version."""

BASELINE = "x86-64-v3"
"""The processor that engines are compiled for, where the one at hand can do all that it can: others
can then use the same code, and what is not a loop over many numbers is no slower
(benchmarks/speed/processors.py)."""

OF_BASELINE = {
    "avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sahf", "sse3",
    "sse4.1", "sse4.2", "ssse3", "xsave",
}  # fmt: skip
"""What the baseline can do more than any x86-64, as LLVM calls it."""

SETTINGS = {
    "OPT": "_OptLevel(3)", "LOOP_VECTORIZE": "1", "SLP_VECTORIZE": "0", "BOUNDSCHECK": "None",
    "USING_SVML": "False", "CPU_NAME": "None", "CPU_FEATURES": "None", "DISABLE_JIT": "0",
}  # fmt: skip
"""numba's settings that change machine code, as they are where nobody has said anything."""

CONFIG_FILE = Path(".numba_config.yaml")
"""Where numba looks for settings, beside the environment."""

SVML = {"linux": "libsvml.so", "darwin": "libsvml.dylib"}
"""Intel's library of functions on vectors, which numba uses where it is installed."""


@functools.cache
def versions() -> dict[str, str]:
    """{"version of numpy": "2.4"} and so on."""
    found = {"version of Python": sys.version}
    for name in PACKAGES:
        try:
            found[f"version of {name}"] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[f"version of {name}"] = "none that is installed"
    return found


def numba_settings() -> dict[str, str]:
    """numba's settings that change machine code.

    It takes its time to load, so that it is asked only where it is loaded, or where something may
    have set what is not usual.
    """
    told = any(f"NUMBA_{name}" in os.environ for name in [*SETTINGS, "ENABLE_AVX"])
    if "numba" not in sys.modules and not (told or CONFIG_FILE.exists() or has_svml()):
        return SETTINGS
    import numba

    config: Any = numba.config
    return {name: str(getattr(config, name, None)) for name in SETTINGS}


@functools.cache
def has_svml() -> bool:
    """Whether numba would use functions on vectors of Intel's library."""
    import llvmlite.binding as llvm

    try:
        llvm.load_library_permanently(SVML.get(sys.platform, "svml_dispmd"))
    except RuntimeError:
        return False
    return llvm.targets.has_svml()


@functools.cache
def compilers() -> dict[str, str]:
    """The versions that machine code depends on; of Python all releases that read the same
    bytecode are one."""
    found = versions()
    known = {name: found[f"version of {name}"] for name in COMPILERS}
    return {"Python": str(sys.implementation.cache_tag), **known}


def set_for_numba() -> tuple[str, str, str, str]:
    """What was set for numba of the processor that it is to compile for."""
    settings = numba_settings()
    more = CONFIG_FILE.read_text("utf-8", "replace") if CONFIG_FILE.exists() else ""
    named = settings["CPU_NAME"], settings["CPU_FEATURES"]
    return *named, os.environ.get("NUMBA_ENABLE_AVX", ""), more


def baseline() -> str:
    """BASELINE where this processor can do all that it can, and nothing was set for numba; else ""
    for code made for this very processor."""
    import llvmlite.binding as llvm

    if set_for_numba() != ("None", "None", "", ""):
        return ""
    known = llvm.get_host_cpu_features()
    return BASELINE if all(known.get(name) for name in OF_BASELINE) else ""


def shared_kind() -> str:
    """The kind of machine, system and processor, that others can share engines with, as the name of
    a folder; "" where engines are for this very processor."""
    import llvmlite.binding as llvm

    target = baseline()
    return f"{llvm.get_process_triple()}-{target}" if target else ""


def compiled_for(loops: bool = False) -> tuple[str, ...]:
    """What of the machine the machine code of an engine depends on; ``loops``: that of functions
    that are mostly loops, which are compiled for this very processor."""
    import llvmlite.binding as llvm

    triple, target = llvm.get_process_triple(), baseline()
    if target and not loops:
        return triple, target
    native = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return triple, *native, *set_for_numba()


def cpu_kind() -> dict:
    """The kind of CPU of this process, as JSON can hold it; two that are equal give equal rows.

    ``cpu``: LLVM's name of the machine's; ``compiled_for`` and ``features``: what numba makes code
    for, NUMBA_CPU_NAME and NUMBA_CPU_FEATURES heeded; ``numpy``: the instructions that numpy uses,
    NPY_DISABLE_CPU_FEATURES heeded; ``libm``: the C library, which computes exp and log; what
    was set for it and for the linear algebra.
    """
    import llvmlite.binding as llvm
    import numpy

    settings = numba_settings()
    cpu, native = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    features = native if settings["CPU_FEATURES"] == "None" else settings["CPU_FEATURES"]
    simd = numpy.show_config(mode="dicts").get("SIMD Extensions", {})
    libm = [" ".join(platform.libc_ver()).strip() or platform.platform()]
    libm += ["SVML"] if settings["USING_SVML"] == "True" else []
    for name in ("GLIBC_TUNABLES", "OPENBLAS_CORETYPE"):
        libm += [os.environ[name]] if os.environ.get(name) else []
    return {
        "cpu": cpu,
        "compiled_for": cpu if settings["CPU_NAME"] == "None" else settings["CPU_NAME"],
        "features": sorted(each[1:] for each in features.split(",") if each.startswith("+")),
        "numpy": [*simd.get("baseline", []), *simd.get("found", [])],
        "libm": libm,
    }
