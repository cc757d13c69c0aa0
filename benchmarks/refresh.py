"""Run the benchmarks and put their tables into the pages of docs/evidence/, each between its marks.

    python -m benchmarks.refresh [--pages PAGE …] [--only NAME …] [--quick]

A block ``<!-- NAME: command -->`` … ``<!-- end -->`` holds what the command printed. A block that
was made at this commit stays, unless it is named, so that an interrupted call goes on. The pictures
that some commands need lie in the folder images (docs/images.md lists them).
"""

import argparse
import re
import shlex
import subprocess
import sys
import time

from benchmarks.reporting import ROOT, commit

PAGES = sorted((ROOT / "docs" / "evidence").glob("*.md"))
BLOCK = re.compile(r"(<!-- (\w+): (python [^>]*?) -->\n).*?(<!-- end -->)", re.DOTALL)


def printed(command, quick):
    """What a command prints: heading as code, tables as markdown."""
    words = [sys.executable, *shlex.split(command)[1:], "--markdown"]
    words += ["--quick"] if quick else []
    done = subprocess.run(words, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    heading, tables = done.stdout.split("\n\n", 1)
    return f"\n```\n{heading}\n```\n\n{tables.strip()}\n\n"


def is_fresh(block, quick):
    """Return True if a block was made at this commit, by a full run unless a quick one is meant."""
    return f"commit {commit()}:" in block and (quick or "--quick" not in block)


def refresh(page, only, quick):
    """Make anew the blocks of a page that are not fresh, or those of these names; after each of
    them the page is written."""
    for _, name, command, _ in BLOCK.findall(page.read_text("utf-8")):
        if name not in only if only else is_fresh(block_of(page, name)[0], quick):
            continue
        print(f"{name}: {command}", file=sys.stderr, flush=True)
        began, table = time.monotonic(), printed(command, quick)
        # The page may have been edited meanwhile.
        match = block_of(page, name)
        text = match.string
        block = f"{match[1]}{table}{match[4]}"
        page.write_text(text[: match.start()] + block + text[match.end() :], "utf-8")
        print(f"{name}: {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)


def block_of(page, name):
    """Return the match of the block of a page that has this name."""
    text = page.read_text("utf-8")
    return next(each for each in BLOCK.finditer(text) if each[2] == name)


def main():
    """Refresh the pages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME")
    parser.add_argument("--pages", nargs="+", default=[each.stem for each in PAGES], metavar="PAGE")
    parser.add_argument("--quick", action="store_true")
    arguments = parser.parse_args()
    for page in PAGES:
        if page.stem in arguments.pages:
            refresh(page, arguments.only, arguments.quick)


if __name__ == "__main__":
    main()
