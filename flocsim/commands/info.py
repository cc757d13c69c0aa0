"""`flocsim info`: what a results file holds, for a person to read."""

import math
import sys
import tomllib

from flocsim.errors import FileError


def add_parser(subparsers):
    """Add the subcommand to argparse's ``subparsers``."""
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
    return parser


def run(args):
    """Print the description, or the config; returns the exit code."""
    from flocsim.io.results import read_results
    from flocsim.io.shape_library import is_library

    if not args.config and is_library(args.results):
        print(describe_library(args.results))
        return 0
    results = read_results(args.results)
    if args.config:
        sys.stdout.write(config_text(args.results, results))
    else:
        print(describe(args.results, results))
    return 0


def describe_library(path):
    """A shape library as text: its flocs, how they were fitted, their errors."""
    from flocsim.io.fit_report import format_errors
    from flocsim.io.shape_library import read_library, read_settings

    entries = read_library(path)
    images = sorted({entry.image for entry in entries})
    sizes = [1e6 * entry.equivalent_radius * entry.pixel_size for entry in entries]
    facts = [
        ("shapes", f"{len(entries)} of {len(images)} pictures"),
        ("r_eq", f"{min(sizes):.3g} to {max(sizes):.3g} µm"),
        *((name.replace("_", " "), str(value)) for name, value in read_settings(path).items()),
    ]
    lines = [f"{name:<14} {value}" for name, value in facts]
    return "\n".join([f"{path}: a shape library", "", *lines, "", format_errors(entries)])


def config_text(path, results):
    """The config as it was given; FileError if the file has none."""
    if not results.run.get("config"):
        raise FileError(f"{path} holds no config: it was not written by flocsim ensemble")
    return results.run["config"]


def describe(path, results):
    """The whole description as text."""
    from flocsim.ensembles.report import format_table

    facts = conditions(results) + outcomes(results) + origin(results)
    width = max(len(name) for name, _ in facts)
    lines = [f"{path}: results of a collision ensemble", ""]
    lines += [f"{name:<{width}}  {value}" for name, value in facts]
    table = format_table(results.types, results.vertices, results.delta, results.probabilities)
    return "\n".join([*lines, "", table])


def conditions(results):
    """(name, value) of what was simulated."""
    count = results.replicates["outcome"].shape[-1]
    vertices = (f"{n} (sphere)" if n == 1 else str(n) for n in results.vertices)
    return [
        ("preset", preset(results.run)),
        ("types", ", ".join(results.types)),
        ("vertices", ", ".join(vertices)),
        ("delta / delta_max", ", ".join(f"{share:g}" for share in results.delta)),
        ("replicates", f"{count} in each of {math.prod(results.shape)} conditions"),
    ]


def preset(run):
    """The preset's name: stored by itself, or in the config."""
    if "preset" in run:
        return run["preset"]
    try:
        return tomllib.loads(run.get("config", "")).get("preset", "none named")
    except tomllib.TOMLDecodeError:
        return "unknown, the config cannot be read"


def outcomes(results):
    """(name, value) of what came out, all conditions together."""
    import numpy as np

    from flocsim.io.results import OUTCOMES

    data = results.replicates
    found = np.bincount(data["outcome"].ravel(), minlength=len(OUTCOMES))
    rows = [("outcomes", ", ".join(f"{n} {w}" for w, n in zip(OUTCOMES, found, strict=True)))]
    reasons = np.bincount(data["failure"].ravel(), minlength=len(results.failures))
    named = list(zip(results.failures, reasons, strict=True))[1:]
    if any(number for _, number in named):
        rows.append(("reasons", ", ".join(f"{n} {w}" for w, n in named if n)))
    if data["steps"].size:
        steps, rejected = data["steps"], data["rejected"]
        rows.append(
            (
                "steps",
                f"{np.median(steps):g} in the median replicate, {steps.max()} at most; "
                f"{rejected.sum()} of {(steps + rejected).sum()} rejected",
            )
        )
    return rows


def origin(results):
    """(name, value) of all that the group ``run`` knows, but for the config's text."""
    return [
        (name.replace("_", " "), readable(name, value))
        for name, value in results.run.items()
        if name not in ("config", "preset") and value != ""
    ]


def readable(name, value):
    """A value for a person: times with their unit."""
    if isinstance(value, float):
        return f"{value:.6g} s" if "time" in name else f"{value:.6g}"
    return str(value)
