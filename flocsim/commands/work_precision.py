"""`flocsim work-precision cfg.toml`: error and flips against CPU time of a study, by tolerance."""

import math
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from itertools import islice, product
from typing import NamedTuple

import numpy as np

from flocsim.commands import add_overwrite, add_settings
from flocsim.ensembles.config.loader import load_config, settings_in
from flocsim.ensembles.diagnose.accuracy import Bench, Task, number, setting_of, table_line
from flocsim.ensembles.diagnose.pilot import expected_replicates, sample_of
from flocsim.ensembles.diagnose.preflight import check_study, inputs_of
from flocsim.ensembles.kind import study_of
from flocsim.ensembles.study import Study
from flocsim.integrators import DormandPrince54, Implicit
from flocsim.integrators.base import Integrator
from flocsim.io.arguments import whole
from flocsim.io.confidence import Z, wilson
from flocsim.io.outputs import check_outputs
from flocsim.io.plots.accuracy import error_against_time
from flocsim.io.plots.style import FIGURE_ENDINGS, save
from flocsim.io.results.run_group import source_line

DECADES = 6
"""Of the tolerance; the reference has a tenth of the tightest."""

CORE = 0.25
"""Length of an equivalent sphere, which has no spheroradius, over r_eq."""

COUNT = 60
"""Replicates of each type, by default."""

PATIENCE = 20
"""Steps of an explicit run at most, over those of the references."""

COLUMNS = {
    "method": -18, "setting": 11, "flips": 7, "[%]": 7, "95 %": 14, "error [m]": 11,
    "of 90 %": 10, "stated [m]": 12, "steps": 9, "CPU [ms]": 10, "undecided": 11,
}  # fmt: skip


def add_arguments(parser: ArgumentParser) -> None:
    """Run some replicates of a study by both adaptive methods over six decades of tolerance. Print
    how many outcomes flip, the error relative to a ten times tighter reference when the first of
    the two runs ends, and the CPU time. Tolerances start at the smallest length of the outlines,
    rounded to a decade: at 1e-6 m, the spheroradius, for tang2014. Choose conditions by --set, as
    in --set 'scene.types=["III"]' --set shapes.vertices=[16].

    config: config file (TOML)
    --count K: replicates of each type (default: %(default)s)
    --output FIGURE: also draw the error against the CPU time: .png, .pdf or .svg
    """
    add = parser.add_argument
    add("config")
    add("--count", type=whole, default=COUNT)
    add("-o", "--output")
    add_settings(parser)
    add_overwrite(parser)


class Rung(NamedTuple):
    """A method at one setting: its line of the table, and its point of the figure."""

    method: str
    line: str
    point: tuple[float, float]


def climb(study: Study, tasks: Sequence[Task]) -> Iterator[Rung]:
    """Run replicates of a collision type by every method at every tolerance, the loosest first."""
    shapes = [
        shape for place, replicate in tasks
        for shape in study.draw(*place, replicate).encounter.shapes
    ]  # fmt: skip
    least = min(min(each.radius, CORE * each.equivalent_radius) for each in shapes)
    length = round(math.log10(least))
    tolerances = [float(f"1e{length - decade}") for decade in range(DECADES)]
    bench = Bench(study, Implicit(0.1 * tolerances[-1]))
    # An explicit run that takes many times the steps of its reference is stopped.
    references = [bench.reference(task) for task in tasks]
    patience = int(PATIENCE * np.mean([run.steps for run, _ in references]))
    for tolerance in tolerances:
        yield rung(bench, tasks, Implicit(tolerance))
    for tolerance in tolerances:
        yield rung(bench, tasks, DormandPrince54(tolerance), patience)


def rung(
    bench: Bench, tasks: Sequence[Task], method: Integrator, budget: int | None = None
) -> Rung:
    """Run replicates by a method."""
    found = [bench.compare(task, method, budget) for task in tasks]
    flips = sum(each.flipped for each in found)
    low, high = (100.0 * float(end) for end in wilson(flips, len(found)))

    def quantile(name: str, share: float = 0.5) -> float:
        known = [value for each in found if math.isfinite(value := getattr(each, name))]
        return float(np.quantile(known or [math.nan], share))

    name, error = type(method).__name__, quantile("error")
    cpu = 1e3 * float(np.mean([each.cpu for each in found]))
    cells = [
        name, setting_of(method), flips, f"{100.0 * flips / len(found):.2f}",
        f"[{low:.2g}, {high:.2g}]", number(error), number(quantile("error", 0.9)),
        number(quantile("stated")), f"{quantile('steps'):.0f}",
        number(cpu, ".2f"), sum(bool(each.why) for each in found),
    ]  # fmt: skip
    return Rung(name, table_line(COLUMNS, cells), (cpu, error))


def run(args: Namespace) -> int:
    """Run the ladders of all types and print them; the exit code."""
    config, rule = load_config(args.config, settings_in(args.settings)), args.overwrite
    check_study(config)
    if args.output:
        sources = inputs_of(config, args.config)
        check_outputs([args.output], rule, sources, endings=FIGURE_ENDINGS)
    study = study_of(config)
    ladders: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for condition, name in enumerate(config.scene.names):
        places = [*product([condition], config.shapes.vertices, config.scene.delta)]
        tasks = list(islice(sample_of(config, places), args.count))
        about = f"{len(tasks)} replicates over all N and delta"
        print(f"\ntype {name}, {about}\n{table_line(COLUMNS)}")
        lines = ladders.setdefault(name, {})
        for each in climb(study, tasks):
            lines.setdefault(each.method, []).append(each.point)
            print(each.line)
    # Half of Wilson's 95 % interval of a probability of ½.
    error = 50.0 * Z / math.sqrt(expected_replicates(config) + Z * Z)
    print(f"\nCompare flips with the sampling error of the study, {error:.2g} %.")
    if args.output:
        save(error_against_time(ladders), args.output, rule, source_line(study.source))
        print(args.output)
    return 0
