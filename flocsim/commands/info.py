"""`flocsim info`: what a results file holds, for a person to read."""

import json
import math
import sys
from argparse import Namespace
from collections import Counter
from typing import Any

import attrs
import numpy as np

from flocsim.commands import SUMMARIES
from flocsim.ensembles.config.consent import read_sources
from flocsim.ensembles.config.toml_text import parse
from flocsim.ensembles.estimates.strengths import table_of as strength_table
from flocsim.ensembles.report import (
    MOST_UNDECIDED,
    change_lines,
    checked_line,
    efficiency_lines,
    format_table,
    graze_lines,
    kernel_lines,
    touch_lines,
    undecided_line,
)
from flocsim.ensembles.storage.cpu_kind import describe_kind
from flocsim.ensembles.storage.stored_json import stored
from flocsim.errors import ConfigError, FileError, visible
from flocsim.io.contents import (
    LIBRARY,
    READERS,
    RESULTS,
    STRENGTH,
    SWARM,
    SWEEP,
    TRAJECTORY,
    content_of,
)
from flocsim.io.journal.journal import journal_of
from flocsim.io.results import strength_file, swarm_file
from flocsim.io.results.events import ENDS_COUNTED, ends_of
from flocsim.io.results.file import OUTCOMES, Totals, read_overview
from flocsim.io.results.run_words import (
    choice_lines,
    class_words,
    describe_note,
    sphere_words,
    water_words,
)
from flocsim.io.results.schema import BONDS, Results
from flocsim.io.results.swarm_file import table_of
from flocsim.io.shapes.fit_report import format_errors
from flocsim.io.shapes.library import read_settings
from flocsim.io.terminal import aligned
from flocsim.io.trajectory import centre_distance

APART = ("config", "preset", "identity", "failed", "overrides", "history", "cpus", "accuracy",
         "warnings", "trial", "modules", "settling", "size_classes", "equivalent_spheres",
         MOST_UNDECIDED)  # fmt: skip
"""What the group ``run`` holds besides what is printed as it is."""

MOST_FAILURES = 10


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser(
        "info",
        help=SUMMARIES["info"],
        description="Print what a file holds: conditions, counts, probabilities with 95 % "
        "intervals, and where it came from. Of a study that still runs or was interrupted, its "
        "replicates so far, without touching it.",
    )
    parser.add_argument("results", help="file that flocsim wrote, or is to write")
    parser.add_argument(
        "--config", action="store_true", help="print only the config that it was run with"
    )
    parser.add_argument(
        "--modules", action="store_true",
        help="print only the modules of one's own that it was run with",
    )  # fmt: skip
    parser.add_argument(
        "--water", action="store_true",
        help="print only how often the equivalent spheres of a study of pairs or rates touch, with "
        "the water that they push at each other and without, a second or two for each pair; of a "
        "shape library how fast its flocs sink and turn",
    )  # fmt: skip
    parser.set_defaults(run=run)


def run(args: Namespace) -> int:
    journal = journal_of(args.results)
    if journal is not None:
        if args.config or args.modules or args.water:
            raise FileError(f"{journal} holds no config: it is of a run that has not ended")
        # All kinds of studies, and the engine with them, are wanted here alone.
        from flocsim.ensembles.unfinished import read_unfinished

        print(unfinished_text(read_unfinished(journal)))
        return 0
    if args.water:
        print("\n".join(water_lines(args.results)))
        return 0
    if not (args.config or args.modules):
        print(text_of(args.results))
        return 0
    _, results = content_of(args.results, (RESULTS, SWARM))
    print_kept(args, results.run)
    return 0


def water_lines(path):
    """What slow flow makes of the equivalent spheres of a study, or of the flocs of a library."""
    from flocsim.ensembles.studies.opened import open_results
    from flocsim.hydrodynamics import prism_drag

    kind, entries = content_of(path, (RESULTS, LIBRARY), READERS | {RESULTS: read_overview})
    if kind == RESULTS:
        return [water_words(each) for each in open_results(path).in_water()]
    rows = [("floc", "sinks", "at least", "turns", "B", "+- %")]
    for entry in entries:
        count = max(entry.fits)
        drag = prism_drag(entry.fits[count].shape.outline())
        rows.append((
            visible(entry.floc_id, ""), *(f"{each:.3f}" for each in drag.mobility),
            f"{drag.turning:.3f}", f"{drag.elongation:.3f}", f"{100.0 * drag.error:.1f}",
        ))  # fmt: skip
    heading = (
        f"prisms of {len(entries)} outlines, 4/3 r_eq deep: how fast they sink, at most and at "
        "least, and turn, over their equivalent spheres; B, by which a strain turns them, over "
        "that of a line"
    )
    return [heading, *aligned(rows)]


def print_kept(args, run):
    """Print the config, the modules, or both, that a file keeps; FileError where it has none."""
    if args.config:
        if not run.get("config"):
            raise FileError(
                f"{args.results} holds no config: it was not written by flocsim ensemble"
            )
        sys.stdout.write(str(run["config"]))
    if args.modules:
        try:
            modules = read_sources(run)
        except ValueError as error:
            raise FileError(f"{args.results} holds no readable results: {error}") from error
        if not modules:
            raise FileError(f"{args.results} holds no modules: it was run without, or by a flocsim "
                            "that kept none")  # fmt: skip
        for place, each in modules.items():
            sys.stdout.write(f"# {visible(place, '')}\n{each['source'].rstrip()}\n")


def text_of(path):
    """What a file holds, of whatever kind it is."""
    texts = {
        RESULTS: lambda path, found: results_text(path, *found), SWARM: swarm_text,
        SWEEP: sweep_text, STRENGTH: strength_text, TRAJECTORY: trajectory_text,
        LIBRARY: library_text,
    }  # fmt: skip
    kind, found = content_of(path, texts, READERS | {RESULTS: read_overview})
    return texts[kind](path, found)


def swarm_text(path, results):
    """What a results file of a swarm study holds."""
    facts, came, warnings = swarm_summary(path, results)
    lines = fact_lines([*facts, *came])
    lines += [f"warning: {visible(line, '')}" for line in warnings]
    table = table_of(results)
    return "\n".join([f"{path}: results of a swarm study", "", *lines, "", table])


def swarm_summary(path, results):
    """(facts, origin, warnings) of a results file of swarms; FileError where what it says of its
    run cannot be read."""
    try:
        failed = [f"swarm {note['replicate']}: {note['why']}"
                  for note in stored(results.run, "failed")]  # fmt: skip
        return (
            swarm_facts(results), origin(results.run), [*stored(results.run, "warnings"), *failed]
        )  # fmt: skip
    except ValueError as error:
        raise FileError(f"{path} holds no readable results of a swarm: {error}") from error


def swarm_facts(results):
    """[(name, value)] of swarms, also of those that still run."""
    bodies, ends = results.groups["bodies"], results.groups["ends"]
    free = bodies["floc"][0] != swarm_file.WALL
    radii = 1e6 * bodies["r_eq"][:, free]
    width, height = 1e6 * bodies["box"].mean(axis=0)
    return [
        ("swarms", f"{len(radii)} of {np.count_nonzero(free)} bodies, "
         f"{int(ends['finished'].sum())} came to their end"),
        ("r_eq [um]", f"{radii.min():.4g} to {radii.max():.4g}, median {np.median(radii):.4g}"),
        ("box [um]", f"{width:.5g} x {height:.5g}"),
        ("steps", f"{ends['steps'].sum()} of islands, {ends['body_steps'].sum()} of bodies, "
         f"{ends['rejected'].sum()} rejected"),
    ]  # fmt: skip


def library_text(path, entries):
    images = sorted({entry.image for entry in entries})
    sizes = [1e6 * entry.measured_radius for entry in entries]
    facts = [
        ("shapes", f"{len(entries)} of {len(images)} pictures"),
        ("r_eq", f"{min(sizes):.3g} to {max(sizes):.3g} µm"),
        *(
            [("outlines", "as cut, and at both ends of their bands (--band)")]
            if all(entry.is_banded for entry in entries)
            else []
        ),
        *((name.replace("_", " "), str(value)) for name, value in read_settings(path).items()),
    ]
    heading = f"{path}: a shape library"
    return "\n".join([heading, "", *fact_lines(facts), "", format_errors(entries)])


@attrs.frozen
class Summary:
    """What a results file says of its study: ``facts`` and ``origin`` as [(name, value)], warnings,
    and the replicates that failed, a line each."""

    facts: list[tuple[str, str]]
    origin: list[tuple[str, str]]
    warnings: list[str]
    failed: list[str]


def summary(path: str, results: Results, totals: Totals) -> Summary:
    """The Summary of a results file; FileError where what it says of its run cannot be read."""
    run = results.run
    try:
        facts = conditions(results) + sizes(results, totals) + outcomes(results, totals)
        facts += [("numerical error", checked_line(results) or "unknown: none was run again")]
        facts += [("", line) for line in change_lines(results)]
        if choice := stored(run, "accuracy"):
            facts += [("accuracy", line) for line in choice_lines(choice)]
        warnings = [str(line) for line in stored(run, "warnings")]
        warnings += filter(None, [undecided_line(results)])
        failed = [describe_note(note) for note in stored(run, "failed")]
        facts += settling(run) + thermal(run)
        facts += [("touched", line) for line in touch_lines(results)]
        return Summary(facts, origin(run), warnings, failed)
    except ValueError as error:
        raise FileError(f"{path} holds no readable results: {error}; run it again") from error


def results_text(path, results, totals):
    said = summary(path, results, totals)
    lines = [f"{path}: results of a collision ensemble", "", *fact_lines(said.facts + said.origin)]
    if said.warnings:
        lines += ["", *(f"warning: {visible(line, '')}" for line in said.warnings)]
    if said.failed:
        lines += ["", *(f"failed: {visible(line, '')}" for line in said.failed[:MOST_FAILURES])]
    if len(said.failed) > MOST_FAILURES:
        lines.append(f"and {len(said.failed) - MOST_FAILURES} more in run/failed")
    axes = results.types, results.vertices, results.delta
    table = format_table(*axes, results.probabilities, results.outlines)
    if results.kernel is not None:
        return "\n".join([*lines, "", *kernel_lines(results.kernel)])
    return "\n".join([*lines, *efficiency_block(results), "", table])


def fact_lines(facts):
    """[(name, value)] as aligned lines; what a file says is shown, and steers no terminal."""
    width = max(len(name) for name, _ in facts)
    return [f"{visible(name, ''):<{width}}  {visible(value, '')}" for name, value in facts]


def efficiency_block(results):
    """The efficiencies, if there are any, behind an empty line."""
    lines = efficiency_lines(results)
    return ["", *lines] if lines else []


def trajectory_text(path, found):
    """What a trajectory file holds."""
    moved = np.hypot(*np.moveaxis(np.diff(found.position[:, :, :2], axis=0), 2, 0)).sum(axis=0)
    facts = [
        ("time", f"{found.t[0]:.6g} to {found.t[-1]:.6g} s, {len(found.t)} states"),
        *((f"body {number}", f"N = {len(shape.vertices)}, r_eq {1e6 * shape.equivalent_radius:.4g} "
           f"µm, moved {1e6 * way:.4g} µm")
          for number, (shape, way) in enumerate(zip(found.shapes, moved, strict=True))),
    ]  # fmt: skip
    if len(found.shapes) == 2:
        apart = 1e6 * centre_distance(found.position)
        facts.append(
            ("centre distance", f"{apart[0]:.4g} µm at first, {apart.min():.4g} at least, "
             f"{apart[-1]:.4g} at last")
        )  # fmt: skip
    for name, value in found.facts.items():
        if name != "config":
            told = f"{value:.6g}" if isinstance(value, float) else str(value)
            facts.append((name.replace("_", " "), told))
    return "\n".join([f"{path}: a trajectory", "", *fact_lines(facts)])


def sweep_text(path, found):
    """What the joined file of a sweep holds: Pr[A] at every value, the mean size of swarms."""
    swept = found.swept
    lines, rest = [f"{path}: a sweep", ""], []
    for name, each in swept.items():
        unit = "" if each.unit == "1" else f" {each.unit}"
        values = ", ".join(visible(shown(value), "") for value in each.values)
        lines.append(f"{visible(each.key, '')} (as {visible(name, '')}): {values}{unit}")
    rows = swarm_sweep_rows(found) if "counts" in found.groups else pair_sweep_rows(found)
    if "counts" not in found.groups:
        rest = graze_lines(found.labelled("probabilities").axes["delta"].values)
    return "\n".join([*lines, "", *aligned(rows), *rest])


def shown(value):
    """A coordinate as text."""
    return f"{value:g}" if isinstance(value, float) else str(value)


def pair_sweep_rows(found):
    """Outcomes and Pr[A] of every value and condition, heads first."""
    table = found.labelled("probabilities")
    ends = ends_of({name: table.columns[name].values for name in ENDS_COUNTED})
    rows = [(*found.swept, "type", "N", "delta", "n", *ends, "Pr[A]", "[95 %]")]
    axes = [table.axes[name].values.tolist() for name in table.columns["pr_a"].axes]
    columns = [table.columns[name].values for name in ("n_total", "pr_a", "pr_a_low", "pr_a_high")]
    for place in np.ndindex(*columns[0].shape):
        names = [axis[k] for axis, k in zip(axes, place, strict=True)]
        n, value, low, high = (column[place] for column in columns)
        told = (f"{value:.3f}" if value == value else "-",
                f"[{low:.3f}, {high:.3f}]" if high == high else "-")  # fmt: skip
        counts = (str(each[place]) for each in ends.values())
        rows.append((*(visible(shown(each), "") for each in names), str(n), *counts, *told))
    return rows


def swarm_sweep_rows(found):
    """Clusters at the end at every value, means over swarms, heads first."""
    table = found.labelled("counts")
    rows = [(*found.swept, "swarms", "time [s]", "clusters", "mean size", "settling [mm/s]")]
    axes = [table.axes[name].values.tolist() for name in found.swept]
    names = ("clusters", "mean_size", "settling")
    for place in np.ndindex(*map(len, axes)):
        last = {name: table.columns[name].values[place][:, -1] for name in names}
        clusters, size, settling = (float(swarm_file.mean(last[name])) for name in names)
        keys = (visible(shown(axis[k]), "") for axis, k in zip(axes, place, strict=True))
        rows.append((*keys, str(len(last["clusters"])), shown(float(table.axes["time"].values[-1])),
                     f"{clusters:.1f}", f"{size:.2f}", f"{1e3 * settling:.4g}"))  # fmt: skip
    return rows


def strength_text(path, found):
    """What a file of `flocsim strength` holds, or the journal of a survey so far."""
    told = found.progress if found.complete else f"{found.progress} so far; go on with --resume"
    statuses = Counter(found.column("status").tolist())
    ends = [f"{count} {strength_file.STATUS[code].replace('_', ' ')}"
            for code, count in sorted(statuses.items())]  # fmt: skip
    used = Counter(found.column("tolerance").tolist())
    needed = [f"{count} at {tolerance:g} m" for tolerance, count in sorted(used.items())]
    facts = [("tested", told), ("found", ", ".join(ends)), ("tolerance", ", ".join(needed))]
    for name, value in found.about.items():
        if name not in ("asked", "complete", "cpus"):
            facts.append((name.replace("_", " "), str(value)))
    kind = "strengths of bonds" + ("" if found.complete else ", unfinished")
    table = strength_table(found)
    return "\n".join([f"{path}: {kind}", "", *fact_lines(facts), "", table])


def unfinished_text(found):
    """What a run that has not ended has so far; nothing of it is final."""
    results, last = found.results, found.sessions[-1]
    if found.kind == STRENGTH:
        return strength_text(found.path, results)
    of_swarms = found.kind == SWARM
    facts = swarm_facts(results)[:-1] if of_swarms else so_far(found)
    facts.append(("begun", f"{last['date']} by {last['command']}"))
    if found.unread:
        facts.append(("damaged", f"{found.unread} bytes of {found.noun}, left out"))
    reasons = Counter(str(note["why"]) for note in found.notes)
    lines = [f"{found.path}: {found.progress}", "", *fact_lines(facts)]
    shown = reasons.most_common(MOST_FAILURES)
    lines += [f"failed: {count} times {visible(why, '')}" for why, count in shown]
    if of_swarms:
        return "\n".join([*lines, "", f"{found.progress}:", table_of(results)])
    table = format_table(results.types, results.vertices, results.delta, results.probabilities)
    marked = f"{found.progress}, with 95 % intervals:"
    return "\n".join([*lines, *efficiency_block(results), "", marked, table])


def so_far(found):
    """[(name, value)] of the conditions of a study of pairs that still runs."""
    results = found.results
    planned = f", {found.asked // math.prod(results.shape)} planned" if found.asked else ""
    counts = results.probabilities["n_total"]
    return [
        ("types", ", ".join(results.types)),
        ("vertices", ", ".join(f"{n} (sphere)" if n == 1 else str(n) for n in results.vertices)),
        ("delta / delta_max", ", ".join(f"{share:g}" for share in results.delta)),
        ("replicates", f"{counts.min()} to {counts.max()} in each of {counts.size} conditions"
         f"{planned}"),
        ("numerical error", checked_line(results) or "unknown: none was run again yet"),
    ]  # fmt: skip


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
        f"{name}: {1e6 * i:.4g}, {1e6 * j:.4g}"
        for name, i, j in zip(
            results.types, results.radii["r_i"], results.radii["r_j"], strict=True
        )
        if i > 0.0 and j > 0.0
    ]
    facts = [("r_i, r_j [um]", "; ".join(known))] if known else []
    if classes := class_words(stored(results.run, "size_classes")):
        facts.insert(0, ("size classes", classes.partition(": ")[2]))
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
        number = f"{each['body']} Re {each['reynolds']:.2g} St {each['stokes']:.2g}"
        types.setdefault(each["type"], []).append(number)
    return [("settling", f"{name}: {', '.join(numbers)}") for name, numbers in types.items()]


def thermal(run):
    """[(name, value)] of what integrals say of equivalent spheres, for each type of a brownian
    study."""
    found = stored(run, "equivalent_spheres")
    return [("thermal", f"{each['type']}: {sphere_words(each)}") for each in found]


def origin(run):
    """[(name, value)] of all that the group ``run`` knows and a person wants to."""
    facts = []
    for name, value in run.items():
        if name in APART or value == "":
            continue
        if isinstance(value, float):
            value = f"{value:.6g} s" if "time" in name else f"{value:.6g}"
        facts.append((name.replace("_", " "), str(value)))
    kinds = stored(run, "cpus")
    names = [describe_kind(kind, [each for each in kinds if each != kind]) for kind in kinds]
    return [*facts, ("kind of CPU", "; ".join(names))] if names else facts
