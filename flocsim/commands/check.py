"""`flocsim check study.toml`: whether a study's own scene is computed right, at its extremes.

Some replicates of the study are run at the ends of its sizes, its numbers of vertices, its contact
stiffness and its tolerance, each combination by itself, and held against runs at a hundred times
tighter a tolerance than the tightest. Nothing is written.
"""

import itertools
import math
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Sequence
from typing import Any

import attrs

from flocsim.commands.judged import (
    HEADER,
    RIGHT,
    STATED,
    WRONG,
    Case,
    Checker,
    law_of,
    line_of,
    stiff,
)
from flocsim.ensembles.collision.checking import TIGHTER, exact_method
from flocsim.ensembles.collision.flocs import Floc
from flocsim.ensembles.config.loader import load_config, nested, parse_setting
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.pilot.ladder import RUNGS, at_rung, scene_length
from flocsim.ensembles.preflight import check_study, measured_flocs
from flocsim.errors import ConfigError, UsageError
from flocsim.fields import read_number
from flocsim.integrators import Implicit
from flocsim.integrators.base import Integrator
from flocsim.io.terminal import tell

COUNT = 2
"""Replicates of each combination of ends, where nothing else is asked for."""

DECADE = 10.0
"""Ends of the stiffness, over and under that of the config, where none are stated."""

TIGHTEST = 1e-14
"""Tolerance [m] of references at the least: beyond lies rounding."""


DESCRIPTION = (
    "Run some replicates of a study at the extremes of its sizes, numbers of "
    "vertices, contact stiffness and tolerance, compare them with runs at a much tighter "
    "tolerance, and print each result. Exit code 0 if all are right or within their "
    "stated error, 1 otherwise."
)


def add_arguments(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("config", help="config file (TOML)")
    add("--stiffness", nargs=2, metavar=("LOW", "HIGH"),
        help="extremes of forces.contact.k_n, e.g. '1 N/m' '1e3 N/m' (default: a decade below and "
        "above that of the config)")  # fmt: skip
    add("--size", nargs=2, metavar=("LOW", "HIGH"),
        help="extremes of the approaching body's radius, e.g. '1 um' '50 um', in pairs of the "
        "same size ratio as the first of the config (default: its smallest and its largest "
        "pair); for measured flocs: only those between these radii")  # fmt: skip
    add("--tolerance", nargs=2, metavar=("LOW", "HIGH"),
        help="extremes of the tolerance, e.g. '1e-11 m' '1e-7 m' (default: that of the study and "
        'of its second runs; with accuracy = "auto": all that may be chosen)')  # fmt: skip
    add("--count", type=int, default=COUNT, metavar="K",
        help=f"replicates of each combination (default: {COUNT})")  # fmt: skip
    add("--set", action="append", default=[], metavar="KEY=VALUE", dest="settings",
        help="override any value of the config, as in flocsim ensemble; may be "
        "repeated")  # fmt: skip


def ends(option: str, given: list[str] | None, unit: str) -> tuple[float, float] | None:
    """Two values of an option, the smaller one first; None where it is not given."""
    if given is None:
        return None
    try:
        low, high = (read_number(word, unit) for word in given)
    except (ValueError, ConfigError) as error:
        raise UsageError(f"{option}: {error}") from None
    if not 0.0 < low < high < math.inf:
        raise UsageError(f"{option} must be two values above 0, LOW and HIGH, found {low:g} "
                         f"and {high:g}")  # fmt: skip
    return low, high


def sized(config: Config, sizes: tuple[float, float] | None) -> Config:
    """The config with its smallest and its largest pair alone, or with pairs of these sizes [m]."""
    scene = config.scene
    if sizes is not None:
        if scene.is_measured:
            low, high = sizes
            scene = attrs.evolve(scene, min_radius=low, max_radius=high)
            return attrs.evolve(config, scene=scene)
        _, (radius_i, radius_j) = scene.given[0]
        ratio = radius_i / radius_j
        pairs = tuple((float(f"{ratio * size:.3g}"), size) for size in sizes)
        return attrs.evolve(config, scene=attrs.evolve(scene, pairs=pairs))
    order = sorted(range(len(scene.given)), key=lambda k: sum(scene.given[k][1]))
    ends = sorted({order[0], order[-1]}) if order else []
    return attrs.evolve(config, scene=scene.only(ends))


def stiffnesses(config: Config, given: tuple[float, float] | None) -> list[float]:
    """The ends of the stiffness [N/m]; where they are not stated, none that preflight refuses."""
    law = law_of(config)
    if law is None:
        if given is not None:
            raise UsageError(
                "--stiffness needs forces.contact, which the config does not have: leave it out"
            )
        return [math.nan]
    if given is not None:
        return list(given)
    try:
        check_study(stiff(config, law.k_n / DECADE))
    except ConfigError:
        return [law.k_n, law.k_n * DECADE]
    return [law.k_n / DECADE, law.k_n * DECADE]


def methods(
    config: Config, condition: int, given: tuple[float, float] | None,
    flocs: Sequence[Floc] | None = None,
) -> list[Integrator]:  # fmt: skip
    """The method of a type at the ends of its tolerance, the loosest first."""
    integrator = config.integrator
    method = integrator.method
    if given is not None:
        if not math.isfinite(method.tolerance) or exact_method(method) is None:
            raise UsageError(
                f"the method {integrator.label} has no tolerance: leave --tolerance out"
            )
        low, high = given
        made: Any = method
        return [attrs.evolve(made, tolerance=each) for each in (high, low)]
    if integrator.is_chosen:
        length = scene_length(config, condition, flocs)
        return [at_rung(Implicit(), rung * length) for rung in (RUNGS[0], RUNGS[-1])]
    exact = exact_method(method)
    return [method] if exact is None else [method, exact]


def cases_of(config: Config, args: Namespace) -> Iterator[Case]:
    """All runs, one tolerance beside the other."""
    stated = ends("--stiffness", args.stiffness, "N/m")
    tolerances = ends("--tolerance", args.tolerance, "m")
    counts = sorted({min(config.shapes.vertices), max(config.shapes.vertices)})
    places, flocs = range(len(config.scene.names)), measured_flocs(config)
    number = itertools.count()
    for place, vertices, k_n in itertools.product(places, counts, stiffnesses(config, stated)):
        for _ in range(args.count):
            # Other displacements and other random numbers each time, as far as there are any.
            at = next(number)
            delta = config.scene.delta[at % len(config.scene.delta)]
            for method in methods(config, place, tolerances, flocs):
                yield Case(place, vertices, k_n, method, delta, at % config.replicates)


def run(args: Namespace) -> int:
    """Run all cases and print the table; 0 where all are right or within their stated error."""
    if not args.count >= 1:
        raise UsageError(f"--count must be at least 1, found {args.count}")
    config = load_config(args.config, nested(map(parse_setting, args.settings)))
    check_study(config)
    config = sized(config, ends("--size", args.size, "m"))
    cases = list(cases_of(config, args))
    settings = [each.method.tolerance for each in cases if math.isfinite(each.method.tolerance)]
    reference = max(TIGHTER * min(settings, default=1e-9), TIGHTEST)
    tell(
        f"{len(cases)} runs at the extremes of sizes, N, stiffness and tolerance, compared with "
        "Implicit at "
        f"{reference:.0e} m\nerror: largest of any point of an outline, at the time when the first "
        f"of the two is decided\n\n{HEADER}"
    )
    checker = Checker(config)
    kinds = []
    for case in cases:
        verdict = checker.judge(case, reference)
        kinds.append(verdict.kind)
        tell(line_of(config, case, verdict))
    right, stated, wrong = (kinds.count(kind) for kind in (RIGHT, STATED, WRONG))
    tell(f"\n{right} {RIGHT} (within the tolerance), {stated} {STATED}, {wrong} {WRONG}")
    return 1 if wrong else 0
