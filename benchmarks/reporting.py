"""What every benchmark prints: commit, command, machine, versions, and tables."""

import argparse
import os
import platform
import shlex
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import attrs

from flocsim.io.results.run_group import processor
from flocsim.io.terminal import markdown_table

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("numba", "llvmlite", "numpy", "scipy")


def commit():
    """The commit that is measured, "-dirty" where files differ from it."""
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty"]
    return subprocess.run(command, capture_output=True, text=True).stdout.strip() or "unknown"


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


def parser_of(description):
    """The arguments that every benchmark takes: ``--quick`` and ``--markdown``."""
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="less of it, within a minute or so")
    parser.add_argument("--markdown", action="store_true", help="print the tables for docs/")
    return parser


def parse_arguments(description, **more):
    """Arguments of a benchmark: those that all take and its own (name → add_argument)."""
    parser = parser_of(description)
    for name, options in more.items():
        parser.add_argument(f"--{name.replace('_', '-')}", **options)
    return parser.parse_args()


def text_of(value):
    """A cell as text: numbers with three digits."""
    return f"{value:.3g}" if isinstance(value, float) else str(value)


@attrs.define
class Table:
    """Rows under column names, printed as aligned text or as markdown."""

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

    def print(self, markdown=False):
        """Print title and table."""
        print(f"**{self.title}**\n" if markdown else self.title)
        text = markdown_table(self.columns, self.rows) if markdown else self.aligned()
        print(text, end="\n\n", flush=True)
