"""The tests as they would go on other kinds of processor.

    python -m benchmarks.faults.other_cpus [--quick] [--markdown] [tests …]

numpy and the C library choose their code by the processor, and numba compiles for it. Each setting
takes something away that this one has: numpy's code for AVX-512, then for AVX2 and fused
multiply-add too; the C library's; the compiler's for anything newer than a plain x86-64; and one
lets it use all that there is, where engines are for any processor of their kind. A run of all the
tests takes long, as each setting compiles all scenes anew where numba is concerned; name files or
folders to run only these. The code is 1 where a test failed.
"""

import os
import re
import subprocess
import sys
import tempfile

from benchmarks.reporting import ROOT, Table, begin

QUICK = ["tests/commands/test_trajectory.py", "tests/ensembles/collision", "tests/geometry"]
"""What crosses from numpy to compiled code most."""


def numpy_features():
    """What numpy found here and can do without: [AVX-512 and its kin], [all]."""
    from numpy._core import _multiarray_umath as umath

    found = [name for name in umath.__cpu_dispatch__ if umath.__cpu_features__.get(name)]
    return [name for name in found if "AVX512" in name or name == "X86_V4"], found


def settings():
    """{setting in words: environment variables}, those only that take something away here."""
    wide, every = numpy_features()
    chosen = {"as it is": {}}
    if wide:
        chosen["numpy without AVX-512"] = {"NPY_DISABLE_CPU_FEATURES": " ".join(wide)}
    if every:
        chosen["numpy without AVX2, FMA"] = {"NPY_DISABLE_CPU_FEATURES": " ".join(every)}
    if sys.platform == "linux":
        without = "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4"
        chosen["C library without AVX2, FMA"] = {"GLIBC_TUNABLES": without}
    chosen["linear algebra of Haswell"] = {"OPENBLAS_CORETYPE": "Haswell"}
    chosen["linear algebra of Prescott"] = {"OPENBLAS_CORETYPE": "Prescott"}
    import llvmlite.binding as llvm

    plain = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    chosen["engines for a plain processor"] = plain
    chosen["engines for this very processor"] = {"NUMBA_CPU_NAME": llvm.get_host_cpu_name()}
    return chosen


def outcome(variables, cache, tests):
    """(passed, failed, seconds) of pytest under these variables; failures go to stderr."""
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests]
    environment = {**os.environ, "FLOCSIM_CACHE": cache, **variables}
    done = subprocess.run(words, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
    last = done.stdout.strip().rpartition("\n")[2]
    if done.returncode != 0:
        print(done.stdout[-20_000:], file=sys.stderr)
    counts = {word: int(number) for number, word in re.findall(r"(\d+) (\w+)", last)}
    failed = counts.get("failed", 0) + counts.get("error", 0) + counts.get("errors", 0)
    seconds = re.search(r"in ([\d.]+)s", last)
    if done.returncode not in (0, 1) or seconds is None:
        raise RuntimeError(f"pytest ended with exit code {done.returncode}")
    return counts.get("passed", 0), failed, float(seconds[1])


def main():
    """Print the table."""
    tests = "tests", {"nargs": "*", "help": "files or folders of tests, default: all"}
    arguments = begin(__doc__, tests, packages=("pytest",))
    tests = arguments.tests or (QUICK if arguments.quick else [])
    table = Table("The tests by setting", ("setting", "passed", "failed", "s"))
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, variables) in enumerate(settings().items()):
            # What numba compiles is the same under all settings but its own.
            cache = f"{folder}/{number if 'NUMBA_CPU_NAME' in variables else 0}"
            table.add(name, *outcome(variables, cache, tests))
    table.print()
    return 1 if any(row[2] != "0" for row in table.rows) else 0


if __name__ == "__main__":
    sys.exit(main())
