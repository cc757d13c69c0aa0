"""What every benchmark prints: commit, command, machine, versions, and tables."""

import argparse
import os
import platform
import shlex
import subprocess
import sys
import tempfile
import time
from importlib import metadata
from pathlib import Path

import attrs

from flocsim.io.results.run_group import processor
from flocsim.io.terminal import markdown_table

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
PACKAGES = ("numba", "llvmlite", "numpy", "scipy")


def commit():
    """The last commit that changed the package, "-dirty" where its files differ from that."""

    def git(*words):
        command = ["git", "-C", str(ROOT), *words, "--", "flocsim"]
        return subprocess.run(command, capture_output=True, text=True).stdout.strip()

    last = git("log", "-1", "--format=%h") or "unknown"
    return last + "-dirty" * bool(git("status", "--porcelain", "--untracked-files=no"))


def installed(packages):
    """Versions of packages, "not installed" where there are none."""
    for name in packages:
        try:
            yield f"{name} {metadata.version(name)}"
        except metadata.PackageNotFoundError:
            yield f"{name} not installed"


def print_heading(packages=(), used="one used"):
    """Print commit, command, machine and versions; ``packages`` are named beside the usual."""
    name = sys.modules["__main__"].__spec__.name
    print(f"commit {commit()}: python -m {name} {shlex.join(sys.argv[1:])}".rstrip())
    versions = ", ".join(installed([*PACKAGES, *packages]))
    print(f"{processor()}, {os.cpu_count()} cores, {used}; Python {platform.python_version()}")
    print(f"{versions}\n", flush=True)


def begin(description, *arguments, packages=(), used="one used", **options):
    """Parse the command line of a benchmark, print its heading, and return its options.

    Every benchmark takes ``--quick`` and ``--markdown``. ``arguments`` are positional ones, in
    pairs of name and options of `add_argument`; ``options`` {name: default value, whose type the
    words have, or a dictionary for `add_argument`}.
    """
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="less of it, within a minute or so")
    parser.add_argument("--markdown", action="store_true", help="print the tables for the pages")
    for name, about in arguments:
        parser.add_argument(name, **about)
    for name, default in options.items():
        about = default if isinstance(default, dict) else described(default)
        parser.add_argument(f"--{name.replace('_', '-')}", **about)
    found = parser.parse_args()
    Table.as_markdown = found.markdown
    print_heading(packages, used)
    return found


def described(default):
    """Return the options of `add_argument` for a value of this type, or for several."""
    if isinstance(default, bool):
        return {"action": "store_true"}
    if isinstance(default, list | tuple):
        return {"nargs": "+", "type": type(default[0]), "default": list(default)}
    return {"type": type(default), "default": default}


def cpu_of(function, *arguments):
    """Return the CPU seconds of this process that a call takes, and what it returns."""
    began = time.process_time()
    found = function(*arguments)
    return time.process_time() - began, found


@attrs.frozen
class Spent:
    """What a process took: CPU and wall time [s], peak memory [MB], and its standard output."""

    cpu: float
    wall: float
    memory: float
    output: str


def spent_by(words, folder=None, **variables):
    """Run a command with more environment variables, and return what it Spent."""
    began = time.perf_counter()
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(
            list(map(str, words)), cwd=folder, env={**os.environ, **variables}, stdout=output
        )
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        wall = time.perf_counter() - began
        if process.returncode != 0:
            raise subprocess.CalledProcessError(process.returncode, words)
        output.seek(0)
        cpu = usage.ru_utime + usage.ru_stime
        return Spent(cpu, wall, usage.ru_maxrss / 1024, output.read())


def text_of(value):
    """A cell as text: numbers with three digits."""
    return f"{value:.3g}" if isinstance(value, float) else str(value)


@attrs.define
class Table:
    """Rows under column names, printed as aligned text or as markdown."""

    as_markdown = False

    title: str
    columns: tuple
    rows: list = attrs.Factory(list)

    def add(self, *cells):
        """Append a row and show it at once on stderr, as a sign of life."""
        self.rows.append([text_of(cell) for cell in cells])
        print("  ".join(self.rows[-1]), file=sys.stderr, flush=True)

    def aligned(self):
        """The table as text in columns of equal width."""
        rows = [list(self.columns), *self.rows]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = (zip(row, widths, strict=True) for row in rows)
        return "\n".join("  ".join(c.ljust(width) for c, width in line).strip() for line in lines)

    def print(self):
        """Print title and table."""
        print(f"**{self.title}**\n" if self.as_markdown else self.title)
        text = markdown_table(self.columns, self.rows) if self.as_markdown else self.aligned()
        print(text, end="\n\n", flush=True)
