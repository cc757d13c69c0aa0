"""What of the processor and of the libraries decides the last digits of a result."""

import os
import platform
import sys
from importlib import metadata
from typing import Any

PACKAGES = "numba", "llvmlite", "numpy", "scipy", "shapely", "flocsim"


def versions() -> dict[str, str]:
    """{"version of numpy": "2.4"} and so on."""
    found = {"version of Python": sys.version}
    for name in PACKAGES:
        try:
            found[f"version of {name}"] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[f"version of {name}"] = "none that is installed"
    return found


def cpu_kind() -> dict:
    """The kind of CPU of this process, as JSON can hold it; two that are equal give equal rows.

    ``cpu``: LLVM's name of the machine's; ``compiled_for`` and ``features``: what numba makes code
    for, NUMBA_CPU_NAME and NUMBA_CPU_FEATURES heeded; ``numpy``: the instructions that numpy uses,
    NPY_DISABLE_CPU_FEATURES heeded; ``libm``: the C library, which computes exp and log; what
    was set for it and for the linear algebra.
    """
    import llvmlite.binding as llvm
    import numba
    import numpy

    config: Any = numba.config
    cpu, native = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    named = config.CPU_FEATURES
    features = (native if named is None else named).split(",")
    simd = numpy.show_config(mode="dicts").get("SIMD Extensions", {})
    libm = [" ".join(platform.libc_ver()).strip() or platform.platform()]
    libm += ["SVML"] if config.USING_SVML else []
    for name in ("GLIBC_TUNABLES", "OPENBLAS_CORETYPE"):
        libm += [os.environ[name]] if os.environ.get(name) else []
    return {
        "cpu": cpu,
        "compiled_for": config.CPU_NAME or cpu,
        "features": sorted(each[1:] for each in features if each.startswith("+")),
        "numpy": [*simd.get("baseline", []), *simd.get("found", [])],
        "libm": libm,
    }
