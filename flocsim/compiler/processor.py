"""What of the processor, of numba's settings and of the libraries decides what is computed."""

import contextlib
import functools
import os
import platform
import sys
from importlib import metadata
from typing import Any

PACKAGES = "numba", "llvmlite", "numpy", "scipy", "shapely", "flocsim"

# The processor that engines are compiled for, where the one at hand can do all that it can: others
# can then use the same code, and what is not a loop over many numbers is no slower
# (benchmarks/speed/processors.py).
BASELINE = "x86-64-v3"

# What the baseline can do more than any x86-64, as LLVM writes it.
OF_BASELINE = (
    "+avx,+avx2,+bmi,+bmi2,+cx16,+f16c,+fma,+lzcnt,+movbe,+popcnt,+sahf,+sse3,+sse4.1,+sse4.2,"
    "+ssse3,+xsave"
)

# What may be set in the environment that changes machine code.
SETTINGS = (
    "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_BOUNDSCHECK", "NUMBA_DISABLE_INTEL_SVML",
    "NUMBA_OPT",
)  # fmt: skip

# Intel's library of functions on vectors, which LLVM uses where numba finds it.
SVML = {"linux": "libsvml.so", "darwin": "libsvml.dylib"}


@functools.cache
def versions() -> dict[str, str]:
    """Return {"version of numpy": "2.4"} and so on."""
    found = {"version of Python": sys.version}
    for name in PACKAGES:
        try:
            found[f"version of {name}"] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[f"version of {name}"] = "none that is installed"
    return found


@functools.cache
def has_svml() -> bool:
    """Return True if loops over many numbers may call Intel's library."""
    import llvmlite.binding as llvm

    if os.environ.get("NUMBA_DISABLE_INTEL_SVML", "0") == "0":
        with contextlib.suppress(RuntimeError):
            llvm.load_library_permanently(SVML.get(sys.platform, "svml_dispmd"))
            return llvm.targets.has_svml()
    return False


@functools.cache
def target(loops: bool = False) -> tuple[str, str]:
    """Return LLVM's name of the processor to compile for, and its features: what is set, the
    baseline, or this very processor; the latter also for ``loops`` over many numbers."""
    import llvmlite.binding as llvm

    name, features = (os.environ.get(each, "") for each in SETTINGS[:2])
    known = llvm.get_host_cpu_features().flatten()
    if name or features:
        return name or llvm.get_host_cpu_name(), features
    if loops or not set(OF_BASELINE.split(",")) <= set(known.split(",")):
        return llvm.get_host_cpu_name(), known
    return BASELINE, ""


def compiled_for(loops: bool = False) -> str:
    """Return what of the machine the machine code of a function depends on."""
    import llvmlite.binding as llvm

    settings = [os.environ.get(each) for each in SETTINGS]
    return repr((llvm.get_process_triple(), target(loops), settings, loops and has_svml()))


def cpu_kind() -> dict:
    """Return the kind of CPU of this process, as JSON can hold it; two that are equal give equal
    rows.

    ``cpu``: LLVM's name of the machine's; ``compiled_for`` and ``features``: what code is made for;
    ``numpy``: the instructions that numpy uses, NPY_DISABLE_CPU_FEATURES heeded; ``libm``: the C
    library, which computes exp and log; what was set for it and for the linear algebra.
    """
    import llvmlite.binding as llvm
    import numpy

    name, features = target(loops=True)
    simd: Any = numpy.show_config(mode="dicts").get("SIMD Extensions", {})
    libm = [" ".join(platform.libc_ver()).strip() or platform.platform()]
    libm += ["SVML"] if has_svml() else []
    for each in ("GLIBC_TUNABLES", "OPENBLAS_CORETYPE"):
        libm += [os.environ[each]] if os.environ.get(each) else []
    return {
        "cpu": llvm.get_host_cpu_name(),
        "compiled_for": name,
        "features": sorted(each[1:] for each in features.split(",") if each.startswith("+")),
        "numpy": [*simd.get("baseline", []), *simd.get("found", [])],
        "libm": libm,
    }
