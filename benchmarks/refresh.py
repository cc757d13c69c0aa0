"""Run the benchmarks and put their tables into the pages of docs/evidence/, each between its marks.

    python -m benchmarks.refresh [--only NAME …] [--quick]

A block ``<!-- NAME: command -->`` … ``<!-- end -->`` holds what the command printed.
"""

import argparse
import re
import shlex
import subprocess
import sys

from benchmarks.reporting import ROOT

PAGES = sorted((ROOT / "docs" / "evidence").glob("*.md"))
BLOCK = re.compile(r"(<!-- (\w+): (python [^>]*?) -->\n).*?(<!-- end -->)", re.DOTALL)


def printed(command, quick):
    """What a command prints: heading as code, tables as markdown."""
    words = [sys.executable, *shlex.split(command)[1:], "--markdown"]
    words += ["--quick"] if quick else []
    done = subprocess.run(words, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    heading, tables = done.stdout.split("\n\n", 1)
    return f"\n```\n{heading}\n```\n\n{tables.strip()}\n\n"


def refreshed(text, only, quick):
    """The page's text with the blocks of these names (all, if none are given) made anew."""

    def replace(match):
        if only and match[2] not in only:
            return match[0]
        print(f"{match[2]}: {match[3]}", file=sys.stderr)
        return f"{match[1]}{printed(match[3], quick)}{match[4]}"

    return BLOCK.sub(replace, text)


def main():
    """Refresh the pages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    for page in PAGES:
        text = refreshed(page.read_text("utf-8"), arguments.only, arguments.quick)
        page.write_text(text, "utf-8")


if __name__ == "__main__":
    main()
