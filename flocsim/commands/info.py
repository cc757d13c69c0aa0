"""`flocsim info`: what a results file holds, for a person to read."""

import json
import math
import sys
from argparse import Namespace
from typing import Any

from flocsim.ensembles.collision.failures import describe_note
from flocsim.ensembles.config.toml_text import parse
from flocsim.ensembles.pilot.choice import choice_lines
from flocsim.ensembles.report import checked_line, format_table
from flocsim.ensembles.storage.cpu_kind import describe_kind
from flocsim.ensembles.storage.stored_json import stored
from flocsim.errors import ConfigError, FileError, visible
from flocsim.io.results.file import OUTCOMES, read_overview, read_results
from flocsim.io.results.schema import BONDS
from flocsim.io.shapes.fit_report import format_errors
from flocsim.io.shapes.library import is_library, read_library, read_settings

APART = ("config", "preset", "identity", "failed", "overrides", "history", "cpus", "accuracy",
         "warnings", "settling")  # fmt: skip
"""What the group ``run`` holds besides what is printed as it is."""

MOST_FAILURES = 10


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser(
        "info",
        help="describe a results file",
        description="Print what a results file holds: conditions, counts, probabilities with "
        "95 % intervals, and where it came from.",
    )
    parser.add_argument("results", help="results file that flocsim ensemble wrote")
    parser.add_argument(
        "--config", action="store_true", help="print only the config that it was run with"
    )
    parser.set_defaults(run=run)


def run(args: Namespace) -> int:
    if not args.config and is_library(args.results):
        print(library_text(args.results))
        return 0
    if not args.config:
        print(results_text(args.results, *read_overview(args.results)))
        return 0
    results = read_results(args.results, replicates=False)
    if results.run.get("config"):
        sys.stdout.write(str(results.run["config"]))
    else:
        raise FileError(f"{args.results} holds no config: it was not written by flocsim ensemble")
    return 0


def library_text(path):
    entries = read_library(path)
    images = sorted({entry.image for entry in entries})
    sizes = [1e6 * entry.equivalent_radius * entry.pixel_size for entry in entries]
    facts = [
        ("shapes", f"{len(entries)} of {len(images)} pictures"),
        ("r_eq", f"{min(sizes):.3g} to {max(sizes):.3g} µm"),
        *(
            (name.replace("_", " "), visible(str(value), ""))
            for name, value in read_settings(path).items()
        ),
    ]
    lines = [f"{name:<14} {value}" for name, value in facts]
    return "\n".join([f"{path}: a shape library", "", *lines, "", format_errors(entries)])


def results_text(path, results, totals):
    try:
        facts = conditions(results) + sizes(results, totals) + outcomes(results, totals)
        facts += [("numerical error", checked_line(results) or "unknown: none was run again")]
        if choice := stored(results.run, "accuracy"):
            facts += [("accuracy", visible(line, "")) for line in choice_lines(choice)]
        facts += settling(results.run) + origin(results.run)
        doubts = [visible(line, "") for line in stored(results.run, "warnings")]
        notes = stored(results.run, "failed")
    except ValueError as error:
        raise FileError(f"{path} holds no readable results: {error}; run it again") from error
    width = max(len(name) for name, _ in facts)
    lines = [f"{path}: results of a collision ensemble", ""]
    lines += [f"{name:<{width}}  {value}" for name, value in facts]
    if doubts:
        lines += ["", *(f"warning: {line}" for line in doubts)]
    if notes:
        shown = [visible(describe_note(note), keep="") for note in notes[:MOST_FAILURES]]
        lines += ["", *(f"failed: {note}" for note in shown)]
    if len(notes) > MOST_FAILURES:
        lines.append(f"and {len(notes) - MOST_FAILURES} more in run/failed")
    table = format_table(results.types, results.vertices, results.delta, results.probabilities)
    return "\n".join([*lines, "", table])


def conditions(results):
    """[(name, value)] of what was simulated."""
    vertices = (f"{n} (sphere)" if n == 1 else str(n) for n in results.vertices)
    facts = [
        ("preset", preset(results.run)),
        ("types", ", ".join(results.types)),
        ("vertices", ", ".join(vertices)),
        ("delta / delta_max", ", ".join(f"{share:g}" for share in results.delta)),
        ("replicates", f"{results.count} in each of {math.prod(results.shape)} conditions"),
    ]
    over = stored(results.run, "overrides")
    return [*facts, ("over the config", json.dumps(over))] if over else facts


def sizes(results, totals):
    """[(name, value)] of the radii of the types, and between which values the replicates were."""
    known = [
        f"{visible(name, '')}: {1e6 * i:.4g}, {1e6 * j:.4g}"
        for name, i, j in zip(
            results.types, results.radii["r_i"], results.radii["r_j"], strict=True
        )
        if i > 0.0 and j > 0.0
    ]
    facts = [("r_i, r_j [um]", "; ".join(known))] if known else []
    units = {"r_i": 1e6, "r_j": 1e6, "D_0": 1e6, "d_c_over_D_0": 1.0}
    words = {name: f"{name} [um]" for name in units} | {"d_c_over_D_0": "d_c/D_0 at touch"}
    for name, (low, high) in totals.spans.items():
        low, high = units[name] * low, units[name] * high
        if f"{low:.4g}" != f"{high:.4g}":
            facts.append((words[name], f"{low:.4g} to {high:.4g} in the replicates"))
    return facts


def preset(run):
    if "preset" in run:
        return run["preset"] or "none named"
    try:
        return str(parse("config", str(run.get("config", ""))).get("preset", "none named"))
    except ConfigError:
        return "unknown, the config cannot be read"


def outcomes(results, totals):
    """(name, value) of what came out, all conditions together."""
    found = zip(OUTCOMES, totals.outcomes, strict=True)
    rows = [("outcomes", ", ".join(f"{n} {word}" for word, n in found))]
    bonds = zip(
        BONDS, results.probabilities["n_bond"].reshape(-1, len(BONDS)).sum(axis=0), strict=True
    )
    rows.append(("bonds", ", ".join(f"{n} {word}" for word, n in bonds)))
    named = list(zip(results.failures, totals.failures, strict=True))[1:]
    if any(number for _, number in named):
        rows.append(("reasons", ", ".join(f"{n} {w}" for w, n in named if n)))
    if totals.count:
        steps = f"{totals.steps / totals.count:.4g} in the mean replicate, {totals.most_steps} at "
        steps += f"most; {totals.rejected} of {totals.steps + totals.rejected} rejected"
        rows.append(("steps", steps))
    return rows


def settling(run):
    """[(name, value)] of the bodies at their terminal speeds, a line for each collision type."""
    types: dict[str, list[str]] = {}
    for each in stored(run, "settling"):
        number = f"{visible(each['body'], '')} Re {each['reynolds']:.2g} St {each['stokes']:.2g}"
        types.setdefault(visible(each["type"], ""), []).append(number)
    return [("settling", f"{name}: {', '.join(numbers)}") for name, numbers in types.items()]


def origin(run):
    """[(name, value)] of all that the group ``run`` knows and a person wants to."""
    facts = []
    for name, value in run.items():
        if name in APART or value == "":
            continue
        if isinstance(value, float):
            value = f"{value:.6g} s" if "time" in name else f"{value:.6g}"
        facts.append((visible(name.replace("_", " "), ""), visible(str(value), "")))
    kinds = stored(run, "cpus")
    names = [describe_kind(kind, [each for each in kinds if each != kind]) for kind in kinds]
    return [*facts, ("kind of CPU", "; ".join(names))] if names else facts
