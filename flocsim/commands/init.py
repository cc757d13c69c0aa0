"""`flocsim init`: write a commented example of a config file, for each kind of study."""

import os
import re
import shlex
from argparse import ArgumentParser, Namespace
from pathlib import Path

from flocsim.commands import add_overwrite
from flocsim.errors import UsageError
from flocsim.io.files import write_file
from flocsim.io.outputs import check_outputs

TEMPLATES = Path(__file__).with_name("templates")
"""The folder of what is written: NAME.toml of each kind, and force.py."""

KINDS = {
    "study": "all keys, commented",
    "spheres": "spheres alone",
    "paper": "the conditions of Tang et al. (2014)",
    "clay": "flocs of clay in the sea, at their measured sizes and real weight",
    "measured": "flocs at their measured sizes",
    "pictures": "flocs fitted to pictures",
    "force": "a force of your own, with its module",
    "sweep": "several values of a key",
    "swarm": "many bodies in a box",
    "kernel": "collision kernels for population balances",
    "brownian": "two bodies brought together by thermal motion",
}
"""What there is to begin with: {name: help}."""

COMMANDS = {"swarm": "swarm", "kernel": "kernel"}
"""What runs it, where that is not `flocsim ensemble`."""


def add_arguments(parser: ArgumentParser) -> None:
    """Write a commented example of a config file, ready to run.

    file: file to write (default: %(default)s)
    --shapes FILE: shape library, written by `flocsim fit`, with the flocs of the study
    """
    kinds = "; ".join(f"{name}: {words}" for name, words in KINDS.items())
    add = parser.add_argument
    add("file", nargs="?", default="study.toml")
    add("--kind", choices=KINDS, default="study", help=f"{kinds} (default: %(default)s)")
    add("--shapes")
    add_overwrite(parser)


def with_shapes(text: str, shapes: Path, folder: Path) -> tuple[str, str]:
    """Return a template with the flocs of a library in the place of its own, and what they are."""
    from flocsim.io.shape_library import read_library

    entries = read_library(shapes)
    counts = sorted(set.intersection(*(set(entry.fits) for entry in entries)) - {1})
    before, head, section = text.partition("[shapes]\n")
    section, gap, after = section.partition("\n\n")
    [old] = re.findall(r"(?m)^vertices = \[(.*)\]", section)
    if old == "1" or not counts:
        raise UsageError(f"--shapes {shapes}: this study, or this library, has spheres only")
    # Where the study has one number, the nearest of the library.
    nearest = [min(counts, key=lambda count: abs(count - int(old.split(",")[0])))]
    counts = [1, *counts] if "," in old else nearest
    # Comments on the lines that are replaced no longer hold.
    kept = re.sub(r"(?m)^(# )?(source|file|vertices) = .*\n?", "", section)
    path = Path(os.path.relpath(shapes, folder)).as_posix()
    new = f'source = "library"\nfile = "{path}"\nvertices = {counts}\n{kept}'.rstrip("\n")
    return f"{before}{head}{new}{gap}{after}", f" with {len(entries)} flocs of {shapes}"


def run(args: Namespace) -> int:
    """Write the file; returns the exit code. UsageError if it exists and is not to be replaced."""
    if args.kind == "pictures" and args.shapes is None:
        raise UsageError(
            "--kind pictures needs --shapes FILE, your flocs as `flocsim fit` wrote them"
        )
    rule, path = args.overwrite, Path(args.file)
    module = re.sub(r"\W", "_", f"{path.stem}_force")
    module = f"_{module}" if module[0].isdigit() else module
    names = {"{module}": module, "{file}": path.name, "{stem}": path.stem}
    text = (TEMPLATES / f"{args.kind}.toml").read_text("utf-8")
    for name, word in names.items():
        text = text.replace(name, word)
    source = ""
    if args.shapes is not None:
        text, source = with_shapes(text, Path(args.shapes), path.parent)
    files = {path: text}
    if args.kind == "force":
        files[path.with_name(f"{module}.py")] = (TEMPLATES / "force.py").read_text("utf-8")
    check_outputs(files, rule, [])
    for each, content in files.items():
        write_file(each, content.encode(), rule)
    wrote = " and ".join(map(str, files))
    command = COMMANDS.get(args.kind, "ensemble")
    print(f"wrote {wrote}{source}; run it with: flocsim {command} {shlex.quote(args.file)}")
    return 0
