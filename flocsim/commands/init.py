"""`flocsim init`: write a commented example of a config file, for each kind of study."""

import math
import os
import re
from argparse import ArgumentParser, Namespace
from decimal import Decimal
from pathlib import Path
from typing import Any

from flocsim.errors import UsageError
from flocsim.io.files import write_file
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule

DEFAULT_FILE = "study.toml"

TEMPLATES = Path(__file__).with_name("templates")
"""The folder of what is written: NAME.toml of each kind, and force.py."""

KINDS = {
    "study": "all keys, commented",
    "spheres": "spheres alone",
    "paper": "the conditions of Tang et al. (2014)",
    "measured": "flocs at their measured sizes",
    "pictures": "flocs fitted to pictures",
    "force": "a force of your own, with its module",
    "sweep": "several values of a key",
    "swarm": "many bodies in a box",
    "kernel": "rates for population balances",
    "brownian": "two bodies brought together by thermal motion",
}
"""What there is to begin with: {name: help}."""

COMMANDS = {"swarm": "swarm", "kernel": "kernel"}
"""What runs it, where that is not `flocsim ensemble`."""


DESCRIPTION = "Write a commented example of a config file, ready to run."


def add_arguments(parser: ArgumentParser) -> None:
    kinds = "; ".join(f"{name}: {words}" for name, words in KINDS.items())
    parser.add_argument(
        "file", nargs="?", default=DEFAULT_FILE, help=f"file to write (default: {DEFAULT_FILE})"
    )
    parser.add_argument(
        "--kind", choices=KINDS, default="study", help=f"{kinds} (default: %(default)s)"
    )
    parser.add_argument(
        "--shapes", metavar="FILE", help="shape library of `flocsim fit` whose flocs the study has"
    )
    parser.add_argument("--overwrite", action="store_true", help=OVERWRITE_HELP)


HEADER = re.compile(r"(?:# )?\[([\w.]+)\]")
VALUE = re.compile(r"# (\w+) = \S.*?(?: +(#.*))?")

PREFIXES = ("", "m", "u", "n", "p", "f", "a", "z")


def value_with_unit(value: Any, unit: str) -> str:
    """Return a preset's value as a config writes it, e.g. "0.98 nm"; the number stays exact."""
    from flocsim.ensembles.config.toml_text import value_text

    if not unit or not isinstance(value, float):
        return value_text(value, ())
    # A number from 0.1 to 100 where a prefix makes it one; energies are known without.
    thousands = 0 if unit == "J" else max(-math.floor((math.log10(value) + 1.0) / 3.0), 0)
    number = format(Decimal(repr(value)).scaleb(3 * thousands), "f")
    if "." in number:
        number = number.rstrip("0").rstrip(".")
    number = number if thousands else format(value, "g")
    return f'"{number} {PREFIXES[thousands]}{unit}"'


def with_values_of_preset(text: str) -> str:
    """Return a template whose commented values are those of the preset that it names."""
    from flocsim.ensembles.config.presets import PRESETS
    from flocsim.ensembles.config.schema import FORCES, TABLES, keys_of

    preset = PRESETS[re.search(r'^preset = "(.+?)"', text, re.MULTILINE)[1]]  # type: ignore[index]
    classes = TABLES | {f"forces.{name}": each for name, each in FORCES.items()}
    tables = preset | {f"forces.{name}": each for name, each in preset["forces"].items()}
    lines, table = text.split("\n"), ""
    for number, line in enumerate(lines):
        if header := HEADER.match(line):
            table = header[1]
        found = VALUE.fullmatch(line)
        if found and found[1] in tables.get(table, {}):
            unit = keys_of(classes[table])[found[1]].metadata.get("unit", "")
            new = f"# {found[1]} = {value_with_unit(tables[table][found[1]], unit)}"
            column = found.start(2) - 1 if found[2] else 0
            lines[number] = f"{new.ljust(column)} {found[2] or ''}".rstrip()
    return "\n".join(lines)


def with_shapes(text: str, shapes: Path, folder: Path) -> tuple[str, str]:
    """Return a template with the flocs of a library in the place of its own, and what they are."""
    from flocsim.io.shape_library import read_library

    entries = read_library(shapes)
    counts = sorted(set.intersection(*(set(entry.fits) for entry in entries)) - {1})
    before, _, section = text.partition("[shapes]\n")
    section, gap, after = section.partition("\n\n")
    old = re.search(r"^vertices = \[(.*)\]", section, re.MULTILINE)
    if old is None or old[1] == "1" or not counts:
        raise UsageError(
            f"--shapes {shapes}: this kind of study, or this library, has spheres only"
        )
    if "," in old[1]:
        counts = [1, *counts]
    else:  # one number: the one of the library that is nearest
        counts = [min(counts, key=lambda count: abs(count - int(old[1])))]
    # Comments on the lines that were replaced no longer hold.
    kept = [
        line
        for line in section.split("\n")
        if not re.match(r"(# )?(source|file|vertices) = ", line)
    ]
    path = Path(os.path.relpath(shapes, folder)).as_posix()
    rows = ['source = "library"', f'file = "{path}"', f"vertices = {counts}", *kept]
    return f"{before}[shapes]\n" + "\n".join(
        rows
    ) + gap + after, f"{len(entries)} flocs of {shapes}"


def run(args: Namespace) -> int:
    """Write the file; returns the exit code. UsageError if it exists and is not to be replaced."""
    if args.kind == "pictures" and args.shapes is None:
        raise UsageError(
            "--kind pictures needs the flocs of your pictures: fit them with `flocsim fit "
            "PICTURES… -o shapes.h5`, and add --shapes shapes.h5"
        )
    rule, path = data_rule(args.overwrite), Path(args.file)
    module = re.sub(r"\W", "_", f"{path.stem}_force")
    module = f"_{module}" if module[0].isdigit() else module
    names = {"{module}": module, "{file}": path.name, "{stem}": path.stem}
    text = (TEMPLATES / f"{args.kind}.toml").read_text("utf-8")
    for name, word in names.items():
        text = text.replace(name, word)
    text = with_values_of_preset(text)
    grown = "grown by flocsim" if 'source = "synthetic"' in text else "spheres"
    source = "those included in flocsim" if 'file = "synthetic"' in text else grown
    if args.shapes is not None:
        text, source = with_shapes(text, Path(args.shapes), path.parent)
    files = {path: text}
    if args.kind == "force":
        files[path.with_name(f"{module}.py")] = (TEMPLATES / "force.py").read_text("utf-8")
    check_outputs([Output(each, rule) for each in files], [])
    for each, content in files.items():
        write_file(each, content.encode(), rule)
    wrote = " and ".join(map(str, files))
    command = COMMANDS.get(args.kind, "ensemble")
    print(f"wrote {wrote}; shapes: {source}; run it with: flocsim {command} {args.file}")
    return 0
