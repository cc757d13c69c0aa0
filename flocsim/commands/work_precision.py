"""`flocsim work-precision cfg.toml`: flips against CPU time of a study, for every tolerance.

Some replicates of every collision type are run by both adaptive methods over five decades of
tolerance, and compared with a much tighter reference. A tolerance has its meaning against the
lengths of a scene: 1e-6 m is a spheroradius of `tang2014`, so the ladder of tolerances begins at
the smallest length of the outlines, rounded to a decade. With `--replicate 17`, error against run
time of one collision.
"""

import math
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import attrs
import numpy as np

import flocsim.arrays as at
from flocsim.commands.check import HEADER, Case, Checker, line_of
from flocsim.commands.trajectory import add_replicate, select
from flocsim.ensembles.collision.draw import MORE_STEPS
from flocsim.ensembles.collision.pairings import pairings_of
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.kind import study_of
from flocsim.ensembles.pairs.opened import one_count_study, with_one_count
from flocsim.ensembles.pilot.trials import (
    Job,
    Task,
    Trial,
    expected_replicates,
    is_flip,
    sample_of,
    try_out,
)
from flocsim.ensembles.preflight import check_study, inputs_of
from flocsim.ensembles.study import Study
from flocsim.errors import UsageError
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from flocsim.integrators.base import Integrator
from flocsim.io.confidence import Z, wilson
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule
from flocsim.io.plots.style import (
    Figure,
    checked_format,
    drawing,
    save,
    set_log_axis,
    type_titles,
)
from flocsim.io.results.run_group import source_line
from flocsim.io.results.schema import OUTCOMES, UNKNOWN
from flocsim.io.terminal import tell
from flocsim.run import Run

TIGHTEST = 1e-13
"""Tolerance [m] of the reference."""

TOLERANCES = (1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)

STEP_COUNTS = (1_000, 10_000, 100_000)
"""Numbers of equal steps that VelocityVerlet makes of the collision."""

MOST_STEPS = 1_000_000
"""Steps after which a method counts as having failed."""

DECADES = (1.0, 1e-1, 1e-2, 1e-3, 1e-4)
"""Tolerances of the ladder over the scene's length."""

REFERENCE = 1e-6
"""Tolerance of the runs that the ladder is compared with, over the scene's length."""

CORE = 0.25
"""Length of an equivalent sphere, which has no spheroradius, over r_eq."""

ALLOWED = 0.2
"""Share of flips over the sampling error up to which a setting is recommended."""

COUNT = 60
"""Replicates of each type, where nothing else is asked for."""

PATIENCE = 20
"""Times the mean steps of the implicit method's reference that an explicit run may take."""

LADDER_HEADER = (
    f"{'method':<18}{'tolerance':>11}{'flips':>7}{'[%]':>7}{'95 %':>14}"
    f"{'d_c error [m]':>17}{'of 90 %':>10}{'CPU [ms]':>10}{'undecided':>11}"
)

COLOURS = {"Implicit": "#0072B2", "DormandPrince54": "#D55E00"}
MARKERS = {"Implicit": "o", "DormandPrince54": "^"}


DESCRIPTION = (
    "Run some replicates of a study by both adaptive methods over five decades of tolerance, and "
    "print how many outcomes flip, the error of d_c, and the CPU time. With --replicate: run one "
    "replicate by every integrator over six decades of tolerance, and print its error against the "
    "reference at the time when the first of the two is decided."
)


def scene_length(study: Study, condition: int) -> float:
    """Return the length [m], a power of ten, at which the ladder of a collision type begins."""
    shapes = study.config.shapes
    length = CORE * min(pairings_of(study.config, study.flocs)[condition].radii)
    if max(shapes.vertices) > 1 and shapes.size == "own":
        measured = [each.radius for floc in study.flocs for each in floc.shapes.values()]
        length = min(length, float(np.median(measured)))
    elif max(shapes.vertices) > 1 and shapes.own is None:
        length = min(length, shapes.radius)
    return float(f"1e{round(math.log10(length))}")


def sampling_error(config: Config) -> float:
    """Return half of Wilson's 95 % interval of a probability of ½ that the study will have."""
    return 0.5 * Z / math.sqrt(expected_replicates(config) + Z * Z)


class Rung(NamedTuple):
    """A method at a tolerance [m]: ``flips`` of so many ``runs``, Wilson's interval of their
    share, median and 90 % quantile of the error of d_c [m], CPU time of a replicate [ms], and how
    many came to no outcome."""

    method: str
    tolerance: float
    runs: int
    flips: int
    low: float
    high: float
    median: float
    most: float
    cpu: float
    undecided: int


def add_arguments(parser: ArgumentParser) -> None:
    add_replicate(parser)
    add = parser.add_argument
    add("--count", type=int, metavar="K",
        help=f"without --replicate: replicates of each type (default: {COUNT})")  # fmt: skip
    add("-o", "--output", nargs="+", default=[], metavar="FILE",
        help="without --replicate: also draw it, as .png, .pdf or .svg")  # fmt: skip
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)
    parser.set_defaults(frames=2, replicate=None)


def methods(duration: float) -> list[Integrator]:
    """The methods of all runs of a collision that takes so long [s]."""
    found: list[Integrator] = [
        method(tolerance) for method in (Implicit, DormandPrince54) for tolerance in TOLERANCES
    ]
    return found + [VelocityVerlet(duration / count) for count in STEP_COUNTS]


def at_rung(method: type[Implicit] | type[DormandPrince54], tolerance: float) -> Integrator:
    """Return the method with that tolerance [m], to as many digits as a person would write."""
    return method(float(f"{tolerance:.6g}"))


def run(args: Namespace) -> int:
    """Run the methods, print the table; the exit code."""
    if args.replicate is None:
        return run_ladder(args)
    for name, given in (("--count", args.count is not None), ("--output", args.output)):
        if given:
            raise UsageError(f"{name} is for the whole study: leave out either it or --replicate")
    config = load_config(args.config)
    place = select(config, args)
    check_study(config)
    found = one_count_study(config, place[1]).run(*place, args.replicate)
    assert found is not None
    print(
        f"type {config.scene.names[place[0]]}, N = {place[1]}, delta = {place[2]:g}, replicate "
        f"{args.replicate}: {OUTCOMES[found['outcome']]} after {1e3 * found['t_end']:.4g} ms\n"
        "error: largest of any point of an outline, at the time when it or Implicit at "
        f"{TIGHTEST:.0e} m is decided first, compared with the latter\n\n{HEADER}"
    )
    most = attrs.evolve(config.integrator, max_steps=MOST_STEPS)
    checker = Checker(attrs.evolve(with_one_count(config, place[1]), integrator=most))
    for method in methods(found["t_end"]):
        case = Case(place[0], place[1], math.nan, method, place[2], args.replicate)
        print(line_of(config, case, checker.judge(case, TIGHTEST)), flush=True)
    return 0


def part_of(config: Config, args: Namespace) -> Config:
    """The config with the type, N and δ alone that were named."""
    place, vertices, delta = select(config, args)
    scene: Any = config.scene
    if args.type is not None:
        scene = scene.only([place])
    if len(scene.delta) > 1 and args.delta is not None:
        scene = attrs.evolve(scene, delta=(delta,))
    if args.vertices is not None:
        config = with_one_count(config, vertices)
    return attrs.evolve(config, scene=scene)


class End(NamedTuple):
    """How a Job has ended: when [s], behind how many steps, and d_c [m] then."""

    job: Job
    time: float
    steps: int
    distance: float


def measured(study: Study, job: Job) -> tuple[Trial, End | None]:
    """Run a replicate; return (Trial, how it ended), None for one that raised."""
    trial, run = try_out(study, job)
    return trial, None if run is None else End(job, run.time, run.steps, centre_distance(run))


def centre_distance(run: Run) -> float:
    """d_c [m] now."""
    x, y = run.work.motion[at.NOW, 1, :2] - run.work.motion[at.NOW, 0, :2]
    return math.hypot(x, y)


def distance_at(study: Study, end: End, instant: float) -> float:
    """d_c [m] at a time of a replicate that has ended, run anew until then: steps may be so long
    that nothing less tells what is between two."""
    if instant == end.time:
        return end.distance
    draw = study.draw(*end.job.task)
    driver = study.driver(draw.encounter, end.job.integrator)
    run = draw.begin(driver, end.job.max_steps, integrator=end.job.integrator)
    run.clock[at.HORIZON], run.clock[at.UNTIL] = run.clock[at.UNTIL], instant
    run.to_end()
    return centre_distance(run)


def climb(study: Study, condition: int, tasks: Sequence[Task]) -> Iterator[Rung]:
    """Run the whole ladder of a collision type: both methods, from the loosest rung."""
    length = scene_length(study, condition)
    budget = study.config.integrator.max_steps
    exact = at_rung(Implicit, REFERENCE * length)
    references = [measured(study, Job(task, exact, MORE_STEPS * budget)) for task in tasks]
    steps = np.mean([end.steps for _, end in references if end is not None] or [1])
    for method in (Implicit, DormandPrince54):
        most = budget if method is Implicit else int(PATIENCE * steps)
        # Compiled, or loaded, before the first is timed.
        measured(study, Job(tasks[0], at_rung(method, length), most))
        for rung in DECADES:
            made = at_rung(method, rung * length)
            found = [measured(study, Job(task, made, most)) for task in tasks]
            yield rung_of(study, made, found, references)


def apart(study: Study, end: End | None, exact: End | None) -> float:
    """By how much d_c of two runs differs [m] at the last time that both have; NaN for none."""
    if end is None or exact is None:
        return math.nan
    instant = min(end.time, exact.time)
    return abs(distance_at(study, end, instant) - distance_at(study, exact, instant))


def rung_of(
    study: Study,
    method: Integrator,
    found: Sequence[tuple[Trial, End | None]],
    references: Sequence[tuple[Trial, End | None]],
) -> Rung:
    """Compare the replicates of a rung with their references."""
    pairs = list(zip(found, references, strict=True))
    flips = sum(is_flip(trial, exact) for (trial, _), (exact, _) in pairs)
    distances = np.array([apart(study, end, exact) for (_, end), (_, exact) in pairs])
    low, high = (float(end) for end in wilson(flips, len(found)))
    known = distances[np.isfinite(distances)]
    median, most = np.quantile(known, [0.5, 0.9]) if len(known) else (math.nan, math.nan)
    undecided = sum(OUTCOMES[trial.outcome] in UNKNOWN for trial, _ in found)
    cpu = 1e3 * sum(trial.cpu for trial, _ in found) / len(found)
    return Rung(
        type(method).__name__, method.tolerance, len(found), flips, low, high, float(median),
        float(most), cpu, undecided,
    )  # fmt: skip


def recommended(rungs: Sequence[Rung], target: float) -> Rung | None:
    """Return the cheapest rung of which no larger share flips than ``target``; None for none."""
    good = [each for each in rungs if each.flips <= target * each.runs]
    return min(good, key=lambda each: each.cpu, default=None)


def rung_line(rung: Rung) -> str:
    interval = f"[{100.0 * rung.low:.2g}, {100.0 * rung.high:.2g}]"
    return (
        f"{rung.method:<18}{f'{rung.tolerance:.0e} m':>11}{rung.flips:>7}"
        f"{100.0 * rung.flips / rung.runs:>7.2f}{interval:>14}{rung.median:>17.1e}"
        f"{rung.most:>10.1e}{rung.cpu:>10.2f}{rung.undecided:>11}"
    )


def draw_ladders(
    panels: Mapping[str, Sequence[Rung]], chosen: Mapping[str, tuple[str, float]], target: float
) -> Figure:
    """A column for each type: flips above, error of d_c below, against CPU time.

    ``chosen`` has (method, tolerance) of what is recommended for a type, which gets a ring if it
    was run; ``target`` is the share of flips that is asked for.
    """
    with drawing(2.5 * len(panels) + 0.8, 4.8) as figure:
        rows = figure.subplots(2, len(panels), squeeze=False, sharex="col", sharey="row")
        titles = type_titles(list(panels))
        for place, (name, rungs) in enumerate(panels.items()):
            draw_flips(rows[0, place], rungs, chosen.get(name), target)
            draw_errors(rows[1, place], rungs, chosen.get(name))
            rows[0, place].set_title(titles[place])
            rows[1, place].set_xlabel("CPU time of a replicate [ms]")
        rows[0, 0].set_ylabel("outcomes that flip [%]")
        rows[1, 0].set_ylabel("error of $d_c$ [m], bar to 90 %")
        handles, labels = rows[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure


def by_method(rungs):
    """{method: its rungs, from the loosest}."""
    methods = dict.fromkeys(rung.method for rung in rungs)
    return {
        name: sorted((r for r in rungs if r.method == name), key=lambda r: -r.tolerance)
        for name in methods
    }


def draw_flips(axes, rungs, chosen, target):
    """Shares with their intervals; where nothing flipped, an arrow down from the interval's end."""
    for name, line in by_method(rungs).items():
        seen = [each for each in line if each.flips]
        colour = COLOURS[name]
        shares = np.array([[each.low, each.flips / each.runs, each.high] for each in seen])
        low, share, high = 100.0 * shares.reshape(-1, 3).T
        axes.errorbar(
            [each.cpu for each in seen], share, [share - low, high - share], color=colour,
            marker=MARKERS[name], linewidth=1.0, elinewidth=0.6, label=name,
        )  # fmt: skip
        none = [each for each in line if not each.flips]
        ends = [100.0 * each.high for each in none]
        axes.errorbar(
            [each.cpu for each in none], ends, 0.45 * np.array(ends), uplims=True, linestyle="none",
            color=colour, marker="_", elinewidth=0.6,
        )  # fmt: skip
        heights = [100.0 * (each.flips / each.runs or each.high) for each in line]
        say_tolerances(axes, line, heights, (0,))
        ring(axes, line, heights, chosen)
    axes.axhline(100.0 * target, color="0.5", linestyle="--", linewidth=0.8,
                 label="a fifth of the sampling error")  # fmt: skip
    axes.set_yscale("log")
    set_time_axis(axes)


def draw_errors(axes, rungs, chosen):
    for name, line in by_method(rungs).items():
        cpu = [each.cpu for each in line]
        # What agrees to the last digit has no place on this axis.
        median = np.array([max(each.median, 1e-18) for each in line])
        upper = np.array([max(each.most - each.median, 0.0) for each in line])
        axes.errorbar(
            cpu, median, [np.zeros(len(line)), upper], color=COLOURS[name], marker=MARKERS[name],
            linewidth=1.0, elinewidth=0.6,
        )  # fmt: skip
        say_tolerances(axes, line, median, (0, len(line) - 1))
        ring(axes, line, median, chosen)
    axes.set_yscale("log")
    set_time_axis(axes)


def set_time_axis(axes):
    """Logarithmic, with room for the words beside the outermost points."""
    axes.set_xscale("log")
    axes.margins(x=0.12)
    set_log_axis(axes.xaxis)


def say_tolerances(axes, line, heights, places):
    """The tolerances of some rungs of a line beside their markers."""
    for place in places:
        if math.isfinite(heights[place]):
            down = place > 0 and line[place].method != "Implicit"
            axes.annotate(
                f"{line[place].tolerance:.0e} m".replace("e-0", "e-"),
                (line[place].cpu, heights[place]), xytext=(4, -10 if down else 4),
                textcoords="offset points", fontsize=6.0, color=COLOURS[line[place].method],
            )  # fmt: skip


def ring(axes, line, heights, chosen):
    """A ring around what is recommended; between two rungs there is nothing to mark."""
    for each, height in zip(line, heights, strict=True):
        if chosen is not None and (each.method, each.tolerance) == tuple(chosen):
            axes.plot(each.cpu, height, "o", markersize=11, markerfacecolor="none",
                      markeredgecolor="0.2", markeredgewidth=0.9)  # fmt: skip


def run_ladder(args: Namespace) -> int:
    """Climb the ladders of all types, print them, say what is best, draw; the exit code."""
    config = load_config(args.config)
    if args.count is not None and not args.count >= 1:
        raise UsageError(f"--count must be at least 1, found {args.count}")
    config = part_of(config, args)
    check_study(config)
    for path in args.output:
        checked_format(path)
    rule = data_rule(args.overwrite)
    check_outputs([Output(path, rule) for path in args.output], inputs_of(config, args.config))
    study = study_of(config)
    target = ALLOWED * sampling_error(config)
    panels: dict[str, list[Rung]] = {}
    for condition, tasks in enumerate(sample_of(config, args.count or COUNT)):
        name = config.scene.names[condition]
        tell(f"\ntype {name}, {len(tasks)} replicates over all N and delta\n{LADDER_HEADER}")
        panels[name] = []
        for rung in climb(study, condition, tasks):
            panels[name].append(rung)
            tell(rung_line(rung))
    tell(
        f"\nwith {config.replicates} replicates the sampling error is "
        f"{100.0 * sampling_error(config):.2g} %; the cheapest setting of which at most a fifth of "
        "it flips:"
    )
    chosen = {}
    for name, rungs in panels.items():
        best = recommended(rungs, target)
        if best is None:
            tell(f"  {name}: none of these")
            continue
        chosen[name] = (best.method, best.tolerance)
        tell(
            f"  {name}: {best.method}, tolerance = {best.tolerance:g}: {best.flips} of {best.runs} "
            f"flip, so at most {100.0 * best.high:.2g} % (95 %)"
        )
    if args.output:
        figure = draw_ladders(panels, chosen, target)
        for path in args.output:
            save(figure, path, rule, source_line(study.source))
            tell(path)
    return 0
