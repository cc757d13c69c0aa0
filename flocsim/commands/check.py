"""`flocsim check study.toml`: whether a study's own scene is computed right, at its extremes."""

import itertools
import math
from argparse import ArgumentParser, Namespace
from collections import Counter
from typing import Any

import attrs

from flocsim.commands import add_settings
from flocsim.ensembles.collision.draw import TIGHTER, exact_method
from flocsim.ensembles.config.loader import load_config, settings_in
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.diagnose.accuracy import (
    Bench,
    Comparison,
    ending,
    number,
    setting_of,
    table_line,
)
from flocsim.ensembles.diagnose.preflight import check_study
from flocsim.ensembles.kind import flocs_of, study_of
from flocsim.errors import ConfigError
from flocsim.forces import Contact
from flocsim.integrators import Implicit
from flocsim.integrators.amplification import MOST_AMPLIFIED
from flocsim.integrators.base import Integrator
from flocsim.io.arguments import whole
from flocsim.io.results.schema import AGGREGATED, CLASSES, OUTCOMES
from flocsim.io.terminal import tell

COUNT = 2
"""Replicates of each combination of ends, by default."""

DECADE = 10.0
"""Default ends of the stiffness: a tenth of the config's, and ten times as much."""

TIGHTEST = 1e-14
"""Least tolerance of references [m]: beyond lies rounding."""

CLOSE = 1e-2
"""Error over the smaller r_eq up to which a method without a tolerance is right."""

RIGHT, STATED, WRONG = "right", "within its stated error", "failed"

DEPARTED = frozenset(CLASSES) - frozenset(AGGREGATED)
"""Classes of collisions that end apart."""

COLUMNS = {
    "type": -12, "N": 5, "k_n or Y": 11, "method": 18, "setting": 11, "delta": 7, "repl.": 6,
    "steps": 8, "CPU [ms]": 10, "error [m]": 11, "stated [m]": 12, "  verdict": -1,
}  # fmt: skip


def add_arguments(parser: ArgumentParser) -> None:
    """Run some replicates of a study at the extremes of its sizes, numbers of vertices, contact
    stiffness and tolerance, each combination by itself, compare them with runs at a hundredth of
    the tightest tolerance, and print how far each is off, and whether that is within what it
    states. Nothing is written. Exit code 0 if all are right or within their stated error, 1
    otherwise.

    --count K: replicates of each combination (default: %(default)s)
    """
    parser.add_argument("config", help="config file (TOML)")
    parser.add_argument("--count", type=whole, default=COUNT)
    add_settings(parser)


def of_extremes(config: Config) -> Config:
    """Return the config with its smallest and its largest pair, its least and its largest N."""
    given, vertices = config.scene.given, config.shapes.vertices
    order = sorted(range(len(given)), key=lambda k: sum(given[k][1]))
    scene: Any = config.scene
    scene = scene.only(sorted({order[0], order[-1]}) if order else [])
    shapes = attrs.evolve(config.shapes, vertices=tuple(sorted({min(vertices), max(vertices)})))
    return attrs.evolve(config, scene=scene, shapes=shapes)


def stiff(config: Config, stiffness: float) -> Config:
    """Return the config with another k_n [N/m] or young [Pa], k_t in proportion."""
    law = contact_of(config)
    if law is None:
        return config
    key = law.stiffness_key[0]
    changed: dict[str, Any] = {key: stiffness}
    if law.k_t is not None:
        changed["k_t"] = law.k_t * stiffness / getattr(law, key)
    made: Any = attrs.evolve(law, **changed)
    forces = tuple(made if force is law else force for force in config.forces)
    return attrs.evolve(config, forces=forces)


def contact_of(config: Config) -> Contact | None:
    """Return the contact law that has a stiffness; None where there is none."""
    return next((force for force in config.forces if isinstance(force, Contact)), None)


def stiffnesses(config: Config) -> tuple[float, ...]:
    """Return a tenth of k_n [N/m] or young [Pa], unless that is refused, and ten times as much.

    NaN stands for a law without a stiffness.
    """
    law = contact_of(config)
    if law is None:
        return (math.nan,)
    now = getattr(law, law.stiffness_key[0])
    try:
        check_study(stiff(config, now / DECADE))
    except ConfigError:
        return now, now * DECADE
    return now / DECADE, now * DECADE


def verdict_on(found: Comparison, method: Integrator) -> tuple[str, str]:
    """Return (RIGHT, STATED or WRONG, why it is wrong) of a run by a method."""
    if found.why:
        return WRONG, found.why
    row, exact = found.row, found.exact
    right = method.tolerance
    if not math.isfinite(right):
        right = CLOSE * min(row["r_i"], row["r_j"])
    if found.flipped:
        most = max(right, found.stated) + found.slack
        if found.error <= most and is_close_call(row, exact, most):
            return STATED, f"{ending(row)}, and the reference {ending(exact)}, within the error"
        return WRONG, f"{ending(row)}, and the reference {ending(exact)}"
    if found.error <= right:
        return RIGHT, ""
    if found.error <= found.stated:
        return STATED, ""
    return WRONG, f"off by {found.error:.3g} m, the reference by at most {found.slack:.2g} m"


def is_close_call(row: dict, exact: dict, most: float) -> bool:
    """Return True if two outcomes may differ by an error of at most ``most`` [m].

    One run just grazes what the other misses, or the collision is at the zone's border D_0.
    """
    one, two = OUTCOMES[row["outcome"]], OUTCOMES[exact["outcome"]]
    if "missed" in (one, two):
        return DEPARTED.issuperset({one, two} - {"missed"})
    alike = (one in AGGREGATED) == (two in AGGREGATED)
    return alike and abs(row["d_c_collision"] - exact["d_c_collision"]) <= most


def run(args: Namespace) -> int:
    """Run all cases and print the table; 0 where all are right or within their stated error."""
    config = load_config(args.config, settings_in(args.settings))
    check_study(config)
    config = of_extremes(config)
    method = config.integrator.method
    methods = [method, *filter(None, [exact_method(method)])]
    tightest = methods[-1].tolerance
    exact = Implicit(max(TIGHTER * (tightest if math.isfinite(tightest) else 1e-9), TIGHTEST))
    tell(
        "runs at the extremes of sizes, N, stiffness and tolerance, compared with Implicit at "
        f"{exact.tolerance:.0e} m\nerror: largest of any point of an outline, at the time when the "
        f"first of the two is decided\n\n{table_line(COLUMNS)}"
    )
    verdicts: Counter[str] = Counter()
    flocs, deltas = flocs_of(config), config.scene.delta
    for stiffness in stiffnesses(config):
        bench = Bench(study_of(stiff(config, stiffness), flocs), exact)
        places = itertools.product(
            range(len(config.scene.names)), config.shapes.vertices, range(args.count)
        )
        for turn, (condition, n, _) in enumerate(places):
            # Other displacements and other random numbers each time, as far as there are any.
            task = (condition, n, deltas[turn % len(deltas)]), turn % config.replicates
            for each in methods:
                found = bench.compare(task, each)
                verdict, why = verdict_on(found, each)
                verdicts[verdict] += 1
                if verdict == WRONG and found.exact:
                    until = float(min(found.row["t_end"], found.exact["t_end"]))
                    if (factor := bench.amplification(task, until)) > MOST_AMPLIFIED:
                        why += f"; the motion amplifies a perturbation {factor:.2g} times"
                tell(table_line(COLUMNS, [
                    config.scene.names[condition], n,
                    "as given" if math.isnan(stiffness) else f"{stiffness:g}",
                    type(each).__name__, setting_of(each), f"{task[0][2]:.3g}", task[1],
                    found.steps or "-", number(1e3 * found.cpu, ".2f"), number(found.error),
                    number(found.stated), f"  {verdict}{': ' * bool(why)}{why}",
                ]))  # fmt: skip
    tell(
        f"\n{verdicts[RIGHT]} {RIGHT} (within the tolerance), {verdicts[STATED]} {STATED}, "
        f"{verdicts[WRONG]} {WRONG}"
    )
    return 1 if verdicts[WRONG] else 0
