"""The tests that start ranks, under launchers and MPI libraries of other kinds than the usual one.

    python -m benchmarks.faults.launchers [--quick] [--markdown] [--only openmpi intel mpich]
                                          [--folder F]

*openmpi*: the system's; on Debian `apt-get install openmpi-bin libopenmpi-dev` beforehand. *intel*:
the wheel impi-rt. *mpich*: the wheel beside this Python, as usual. For each, an environment is made
in a folder (``--folder`` keeps it), with mpi4py of its own (for Open MPI compiled against it), and
all else from here. As in a container, root may start ranks, and more of them than processors.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
import xml.etree.ElementTree as ET
from pathlib import Path

import attrs

from benchmarks.reporting import Table, begin
from tests.helpers.jobs import BESIDE_PYTHON

ROOT = Path(__file__).resolve().parents[2]
TESTS = ["tests/ensembles/parallel", "tests/ensembles/storage/test_faults.py"]
QUICK = ["tests/ensembles/parallel/test_mpi.py"]


@attrs.frozen
class Kind:
    """A kind of MPI: what pip installs, its launcher where pip does not bring it, variables."""

    packages: tuple[str, ...]
    launcher: str | None = None
    variables: dict[str, str] = attrs.Factory(dict)


KINDS = {
    "openmpi": Kind(
        ("--no-binary=mpi4py", "mpi4py"),
        "/usr/bin/mpirun.openmpi",
        {
            "OMPI_ALLOW_RUN_AS_ROOT": "1",
            "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
            "OMPI_MCA_rmaps_base_oversubscribe": "1",  # of version 4
            "OMPI_MCA_orte_execute_quiet": "1",  # else mpirun explains exit codes at length
            "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",  # of version 5
        },
    ),
    "intel": Kind(("mpi4py", "impi-rt"), None, {"I_MPI_FABRICS": "shm"}),
    "mpich": Kind(()),
}


def make_environment(folder, kind):
    """The folder of the programs of an environment with an MPI of this kind; made if missing."""
    if not kind.packages:
        return BESIDE_PYTHON
    place = folder / "bin"
    if not (place / "mpirun").exists():
        if kind.launcher and not Path(kind.launcher).exists():
            raise SystemExit(f"there is no {kind.launcher}: see {__file__}")
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        install = [place / "python", "-m", "pip", "install", "-q", *kind.packages]
        # Its one large file takes minutes to optimise, which nobody here needs.
        subprocess.run(install, check=True, env=os.environ | {"CFLAGS": "-O0"})
        ask = "import sysconfig; print(sysconfig.get_path('purelib'))"
        own = subprocess.run([place / "python", "-c", ask], capture_output=True, text=True)
        beyond = f"{sysconfig.get_path('purelib')}\n{ROOT}\n"
        Path(own.stdout.strip(), "flocsim.pth").write_text(beyond)
        if kind.launcher:
            (place / "mpirun").symlink_to(kind.launcher)
    return place


def run_tests(place, kind, tests):
    """({what: how many tests}, library, seconds, names of those that failed)."""
    # Intel's mpirun looks for its helpers in PATH.
    env = os.environ | kind.variables | {"PATH": f"{place}:{os.environ['PATH']}"}
    ask = "from mpi4py import MPI; print(MPI.Get_library_version())"
    found = subprocess.run([place / "python", "-c", ask], capture_output=True, text=True, env=env)
    library = " ".join(found.stdout.replace("\0", "").split())[:40] or found.stderr[-200:]
    with tempfile.TemporaryDirectory() as name:
        report = Path(name, "report.xml")
        began = time.monotonic()
        words = [place / "python", "-m", "pytest", "-q", f"--junitxml={report}", *tests]
        subprocess.run(words, cwd=ROOT, env=env, stdout=sys.stderr)
        seconds = time.monotonic() - began
        suite = ET.parse(report).getroot().find("testsuite")
    counts = {what: int(suite.get(what)) for what in ("tests", "failures", "errors", "skipped")}
    failed = [
        each.get("name") for each in suite.iter("testcase")
        if each.find("failure") is not None or each.find("error") is not None
    ]  # fmt: skip
    return counts, library, seconds, failed


def main():
    """Print the table; exit code 1 if a test has failed."""
    arguments = begin(
        __doc__, packages=("h5py", "mpi4py", "mpich"), folder={"type": Path},
        only={"nargs": "+", "default": list(KINDS), "choices": list(KINDS)},
    )  # fmt: skip
    folder = arguments.folder or Path(tempfile.mkdtemp())
    columns = ("MPI", "library", "tests", "failed", "skipped", "s")
    table, failed = Table("Tests under other launchers", columns), []
    try:
        for name in arguments.only:
            kind = KINDS[name]
            place = make_environment(folder.absolute() / name, kind)
            counts, library, seconds, names = run_tests(
                place, kind, QUICK if arguments.quick else TESTS
            )
            wrong = counts["failures"] + counts["errors"]
            table.add(name, library, counts["tests"], wrong, counts["skipped"], seconds)
            failed += [f"{name}: {each}" for each in names]
    finally:
        if arguments.folder is None:
            shutil.rmtree(folder)
    table.print()
    print(*failed, sep="\n")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
