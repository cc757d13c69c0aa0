"""`flocsim work-precision cfg.toml`: flips against CPU time of a study, for every tolerance.

With `--replicate 17`, error against run time of one collision (the other is
`flocsim.commands.precision.ladder`).
"""

from argparse import Namespace
from typing import Any

import attrs

from flocsim.commands.precision import ladder
from flocsim.commands.trajectory import add_replicate, select
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.preflight import check_study
from flocsim.ensembles.studies.replicates import one_count_study
from flocsim.errors import FlocsimError
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from flocsim.integrators.amplification import end_distance
from flocsim.io.results.schema import OUTCOMES

TIGHTEST = 1e-13
"""Tolerance [m] of the reference."""

TOLERANCES = (1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)

STEP_COUNTS = (1_000, 10_000, 100_000)
"""Numbers of equal steps that VelocityVerlet makes of the collision."""

MOST_STEPS = 1_000_000
"""Steps after which a method counts as having failed."""

HEADER = f"{'method':<16}{'setting':>11}{'error [m]':>12}{'time [ms]':>12}{'steps':>9}  end"


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser(
        "work-precision",
        help="flips and errors against CPU time, for the methods and tolerances of a config",
        description="Run some replicates of a study by every method and tolerance that "
        'accuracy = "auto" may choose, and print how many outcomes flip, how far d_c is off, and '
        "what it takes. With --replicate: one replicate by every integrator over six decades of "
        "tolerance, to the time at which it is decided, and how far its end is from the reference.",
    )
    add_replicate(parser)
    ladder.add_arguments(parser)
    parser.set_defaults(run=run, frames=2, replicate=None)
    return parser


def methods(duration):
    """(name, setting as text, integrator) of all runs."""
    for method in (Implicit, DormandPrince54):
        for tolerance in TOLERANCES:
            yield method.__name__, f"{tolerance:.0e} m", method(tolerance)
    for count in STEP_COUNTS:
        step = duration / count
        yield "VelocityVerlet", f"{step:.1e} s", VelocityVerlet(step)


def reference(system, duration):
    """The end (n, 3) of the tightest run; FlocsimError where it does not end."""
    found = attrs.evolve(system, integrator=Implicit(TIGHTEST)).run(
        duration, max_steps=MOST_STEPS, record=False
    )
    if found.status.name != "FINISHED":
        raise FlocsimError(f"no reference: {found.status.reason}")
    return found.position[-1]


def row(system, duration, exact, name, setting, integrator):
    """One line of the table; no error is shown for a run that failed."""
    system = attrs.evolve(system, integrator=integrator)
    # The faster of two: the first may have compiled.
    runs = [system.run(duration, max_steps=MOST_STEPS, record=False) for _ in range(2)]
    found = min(runs, key=lambda each: each.wall_time)
    error = "-"
    if found.status.name == "FINISHED":
        error = f"{end_distance(system.bodies, found.position[-1], exact):.1e}"
    time, end = f"{1e3 * found.wall_time:.2f}", found.status.name.lower().replace("_", " ")
    return f"{name:<16}{setting:>11}{error:>12}{time:>12}{found.steps:>9}  {end}"


def replicate(config, place, number):
    """(System where the replicate starts, how long [s] until it is decided, its row)."""
    study = one_count_study(config, place[1])
    found = study.run(*place, number)
    return study.draw(*place, number).system(), float(found["t_end"]), found


def run(args: Namespace) -> int:
    """Run the methods, print the table; the exit code."""
    if args.replicate is None:
        return ladder.run(args)
    ladder.refuse_arguments(args)
    config = load_config(args.config)
    place = select(config, args)
    check_study(config)
    system, duration, found = replicate(config, place, args.replicate)
    exact = reference(system, duration)
    name = config.scene.names[place[0]]
    print(
        f"type {name}, N = {place[1]}, delta = {place[2]:g}, replicate {args.replicate}: "
        f"{OUTCOMES[found['outcome']]} after {1e3 * duration:.4g} ms"
    )
    print(f"error: of any point of an outline, against Implicit at {TIGHTEST:.0e} m\n\n{HEADER}")
    for method in methods(duration):
        print(row(system, duration, exact, *method), flush=True)
    return 0
