"""What of the processor, of numba's settings and of the libraries decides what is computed."""

import functools
import os
import platform
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

PACKAGES = "numba", "llvmlite", "numpy", "scipy", "shapely", "flocsim"

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


def compiled_for() -> tuple[str, ...]:
    """What of the machine the machine code that numba makes depends on."""
    import llvmlite.binding as llvm

    settings = numba_settings()
    named = settings["CPU_NAME"], settings["CPU_FEATURES"], os.environ.get("NUMBA_ENABLE_AVX", "")
    native = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    more = CONFIG_FILE.read_text("utf-8", "replace") if CONFIG_FILE.exists() else ""
    return llvm.get_process_triple(), *native, *named, more


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
