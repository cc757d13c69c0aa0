"""On what kind of CPU rows were computed: all that decides their last digits beside the code.

Compiled code is made for the CPU at hand (a fused multiply-add rounds once, where two operations
round twice), numpy and the C library choose among their own variants. On one kind of CPU a
replicate is the same bytes always; between kinds it may differ in its last digits, and a collision
that is close to a decision may end otherwise.
"""

import os
import platform
from collections.abc import Iterator, Sequence
from typing import Any

MOST_FEATURES = 4
"""Features by which a message tells two kinds apart."""


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


def distinct(kinds: Sequence[dict]) -> list[dict]:
    """Each kind once, in the order in which they come."""
    return [kind for place, kind in enumerate(kinds) if kind not in kinds[:place]]


def describe_kind(kind: dict, others: Sequence[dict] = ()) -> str:
    """A kind in words: its name, and what it has that one of the others has not."""
    words = [kind["cpu"]]
    if kind["compiled_for"] != kind["cpu"]:
        words.append(f"compiled for {kind['compiled_for']}")
    for name, title in (("features", ""), ("numpy", "numpy with "), ("libm", "")):
        own = [each for each in kind[name] if any(each not in other[name] for other in others)]
        if own:
            more = ", …" if len(own) > MOST_FEATURES else ""
            words.append(f"{title}{', '.join(own[:MOST_FEATURES])}{more}")
    return words[0] if len(words) == 1 else f"{words[0]} ({'; '.join(words[1:])})"


def mixture_warnings(path: object, found: Sequence[dict], now: Sequence[dict]) -> Iterator[str]:
    """Lines that warn of rows of several kinds in one file.

    ``found``: kinds of the rows that the file at ``path`` has already; ``now``: those of the ranks
    that add to them.
    """
    kinds = distinct([*found, *now])
    names = [describe_kind(kind, [each for each in kinds if each != kind]) for kind in kinds]
    end = "rows of both kinds will stand in one file, and may differ in their last digits"
    if len(now) > 1:
        here = " and ".join(names[kinds.index(kind)] for kind in now)
        yield f"the ranks run on different kinds of CPU, {here}: {end}"
    elif any(kind not in found for kind in now) and found:
        there = " and ".join(names[kinds.index(kind)] for kind in found)
        here = names[kinds.index(now[0])]
        yield f"{path} has rows of another kind of CPU, {there}, and this is {here}: {end}"
