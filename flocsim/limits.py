"""What the system allows a process: too little memory is told before it hangs or crashes a library.

Imports nothing of flocsim and nothing slow: it has to be asked before numpy is loaded.
"""

import os
import sys

LOADING = 700 * 10**6
"""Address space [bytes] for Python, numpy, numba and their libraries, with a study's data."""

COMPILING = 1500 * 10**6
"""The same while an engine is compiled."""

BLAS_THREADS = "OPENBLAS_NUM_THREADS"

FAILED = 70


def address_space() -> float:
    """Bytes of address space that this process may take (`ulimit -v`); infinite without a limit."""
    try:
        import resource
    except ImportError:
        return float("inf")  # Windows
    least, _ = resource.getrlimit(resource.RLIMIT_AS)
    return float("inf") if least == resource.RLIM_INFINITY else least


def is_limited() -> bool:
    return address_space() < float("inf")


def lacking(needed: float, work: str) -> str:
    """One line where the address space will not do for some work; "" where it does."""
    found = address_space()
    if found >= needed:
        return ""
    return (
        f"the address space is limited to {found / 1e6:.0f} MB, and {work} takes "
        f"{needed / 1e6:.0f} MB: raise the limit (ulimit -v, or the batch system's)"
    )


def check_memory() -> None:
    """End the process in one line where its libraries could not be loaded.

    OpenBLAS spins without end where it gets no memory for its threads, each of which asks for some
    hundred MB of addresses; under a limit it gets one thread, unless the user has chosen.
    """
    if not is_limited():
        return
    os.environ.setdefault(BLAS_THREADS, "1")
    if text := lacking(LOADING, "loading flocsim"):
        print(f"flocsim: {text}", file=sys.stderr)
        sys.exit(FAILED)
