"""`flocsim work-precision cfg.toml`: flips against CPU time of a study, for every tolerance.

With `--replicate 17`, error against run time of one collision (the other is
`flocsim.commands.precision.ladder`).
"""

import math
from argparse import Namespace
from typing import Any

import attrs

from flocsim.commands import SUMMARIES
from flocsim.commands.precision import ladder
from flocsim.commands.precision.judged import HEADER, Case, Checker, line_of
from flocsim.commands.trajectory import add_replicate, select
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.pairs.replicates import one_count_study, with_one_count
from flocsim.ensembles.preflight import check_study
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from flocsim.integrators.base import Integrator
from flocsim.io.results.schema import OUTCOMES

TIGHTEST = 1e-13
"""Tolerance [m] of the reference."""

TOLERANCES = (1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)

STEP_COUNTS = (1_000, 10_000, 100_000)
"""Numbers of equal steps that VelocityVerlet makes of the collision."""

MOST_STEPS = 1_000_000
"""Steps after which a method counts as having failed."""


def add_parser(subparsers: Any) -> None:
    parser = subparsers.add_parser(
        "work-precision",
        help=SUMMARIES["work-precision"],
        description="Run some replicates of a study by every method and tolerance that "
        'accuracy = "auto" may choose, and print how many outcomes flip, the error of d_c, and '
        "the CPU time. With "
        "--replicate: run one replicate by every integrator over six decades of tolerance, and "
        "print its error against the reference at the time when the first of the two is decided.",
    )
    add_replicate(parser)
    ladder.add_arguments(parser)
    parser.set_defaults(run=run, frames=2, replicate=None)
    return parser


def methods(duration: float) -> list[Integrator]:
    """The methods of all runs of a collision that takes so long [s]."""
    found: list[Integrator] = [
        method(tolerance) for method in (Implicit, DormandPrince54) for tolerance in TOLERANCES
    ]
    return found + [VelocityVerlet(duration / count) for count in STEP_COUNTS]


def run(args: Namespace) -> int:
    """Run the methods, print the table; the exit code."""
    if args.replicate is None:
        return ladder.run(args)
    ladder.refuse_arguments(args)
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
