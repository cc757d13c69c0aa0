"""`flocsim check study.toml`: whether a study's own scene is computed right, at its extremes.

Some replicates of the study are run at the ends of its sizes, its numbers of vertices, its contact
stiffness and its tolerance, each combination by itself, and held against runs at a hundred times
tighter a tolerance than the tightest: by how much each is off, and whether that is within what it
states. Nothing is written. Of this table of runs `flocsim work-precision --replicate` has one, too.
"""

import itertools
import math
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import attrs
import numpy as np

import flocsim.arrays as at
from flocsim.ensembles.collision.draw import FAILURES, TIGHTER, Draw, exact_method
from flocsim.ensembles.config.loader import load_config, nested, parse_setting
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.kind import flocs_of, study_of
from flocsim.ensembles.preflight import check_study
from flocsim.ensembles.study import Study
from flocsim.errors import ConfigError, FlocsimError, UsageError
from flocsim.fields import read_number
from flocsim.forces import Contact
from flocsim.integrators import Implicit
from flocsim.integrators.amplification import MOST_AMPLIFIED, end_distance, nudge_of, nudged
from flocsim.integrators.base import Integrator
from flocsim.io.results.schema import AGGREGATED, CLASSES, OUTCOMES
from flocsim.io.terminal import tell
from flocsim.run import Run

COUNT = 2
"""Replicates of each combination of ends, where nothing else is asked for."""

DECADE = 10.0
"""Ends of the stiffness, over and under that of the config, where none are stated."""

TIGHTEST = 1e-14
"""Tolerance [m] of references at the least: beyond lies rounding."""

MORE_STEPS = 20
"""Times the step budget of the config for a reference."""

CLOSE = 1e-2
"""Error over the smaller r_eq that is right of methods that have no tolerance and state no
error."""

RIGHT, STATED, WRONG = "right", "within its stated error", "failed"

DEPARTED = frozenset(CLASSES) - frozenset(AGGREGATED)
"""Classes of collisions that end apart."""

HEADER = (
    f"{'type':<12}{'N':>5}{'k_n or Y':>11}{'method':>18}{'setting':>11}{'delta':>7}{'repl.':>6}"
    f"{'steps':>8}{'CPU [ms]':>10}{'error [m]':>11}{'stated [m]':>12}  verdict"
)

DESCRIPTION = (
    "Run some replicates of a study at the extremes of its sizes, numbers of "
    "vertices, contact stiffness and tolerance, compare them with runs at a much tighter "
    "tolerance, and print each result. Exit code 0 if all are right or within their "
    "stated error, 1 otherwise."
)


class Case(NamedTuple):
    """One run: place of the type, N, stiffness [N/m] (NaN: the config's law), method, share of
    δ_max, replicate."""

    condition: int
    vertices: int
    stiffness: float
    method: Integrator
    delta: float
    replicate: int


class Verdict(NamedTuple):
    """What came of a Case: steps, CPU time [s], error and stated error [m] (NaN: none), RIGHT,
    STATED or WRONG, and why it is wrong."""

    steps: int
    time: float
    error: float
    stated: float
    kind: str
    why: str = ""


def add_arguments(parser: ArgumentParser) -> None:
    add = parser.add_argument
    add("config", help="config file (TOML)")
    add("--stiffness", nargs=2, metavar=("LOW", "HIGH"),
        help="extremes of forces.contact.k_n, e.g. '1 N/m' '1e3 N/m', or of young, e.g. '1 kPa' "
        "'1 MPa', where the config has that (default: a decade below and above it)")  # fmt: skip
    add("--size", nargs=2, metavar=("LOW", "HIGH"),
        help="extremes of the approaching body's radius, e.g. '1 um' '50 um', in pairs of the "
        "same size ratio as the first of the config (default: its smallest and its largest "
        "pair); for measured flocs: only those between these radii")  # fmt: skip
    add("--tolerance", nargs=2, metavar=("LOW", "HIGH"),
        help="extremes of the tolerance, e.g. '1e-11 m' '1e-7 m' (default: that of the study and "
        'of its second runs)')  # fmt: skip
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


def stiffnesses(config: Config, given: list[str] | None) -> list[float]:
    """The ends of k_n [N/m] or young [Pa]; where they are not stated, none that preflight
    refuses."""
    law = law_of(config)
    if law is None:
        if given is not None:
            raise UsageError(
                "--stiffness needs forces.contact, which the config does not have: leave it out"
            )
        return [math.nan]
    key, unit = law.stiffness_key
    if (stated := ends("--stiffness", given, unit)) is not None:
        return list(stated)
    now = getattr(law, key)
    try:
        check_study(stiff(config, now / DECADE))
    except ConfigError:
        return [now, now * DECADE]
    return [now / DECADE, now * DECADE]


def methods(config: Config, given: tuple[float, float] | None) -> list[Integrator]:
    """Return the config's method at the ends of its tolerance, the loosest first."""
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
    exact = exact_method(method)
    return [method] if exact is None else [method, exact]


def cases_of(config: Config, args: Namespace) -> Iterator[Case]:
    """All runs, one tolerance beside the other."""
    tolerances = ends("--tolerance", args.tolerance, "m")
    counts = sorted({min(config.shapes.vertices), max(config.shapes.vertices)})
    places = range(len(config.scene.names))
    number = itertools.count()
    for place, vertices, k_n in itertools.product(
        places, counts, stiffnesses(config, args.stiffness)
    ):
        for _ in range(args.count):
            # Other displacements and other random numbers each time, as far as there are any.
            at = next(number)
            delta = config.scene.delta[at % len(config.scene.delta)]
            for method in methods(config, tolerances):
                yield Case(place, vertices, k_n, method, delta, at % config.replicates)


def law_of(config: Config) -> Contact | None:
    """The contact law that has a stiffness; None where there is none."""
    return next((force for force in config.forces if isinstance(force, Contact)), None)


def stiff(config: Config, stiffness: float) -> Config:
    """The config with another k_n [N/m] or young [Pa], k_t in proportion; as it is for NaN."""
    law = law_of(config)
    if law is None or math.isnan(stiffness):
        return config
    key, _ = law.stiffness_key
    changed: dict[str, Any] = {key: stiffness}
    if law.k_t is not None:
        changed["k_t"] = law.k_t * stiffness / getattr(law, key)
    made = attrs.evolve(law, **changed)
    forces = tuple(made if force is law else force for force in config.forces)
    return attrs.evolve(config, forces=forces)


@attrs.define
class Checker:
    """Runs Cases of a config; the flocs are grown or read once."""

    config: Config
    studies: dict[float, Study] = attrs.Factory(dict)
    flocs: list | None = None
    warm: set = attrs.Factory(set)

    def study(self, stiffness: float) -> Study:
        """The Study with this stiffness; ConfigError where its impacts are too deep."""
        if stiffness not in self.studies:
            config = stiff(self.config, stiffness)
            check_study(config)
            self.flocs = flocs_of(config) if self.flocs is None else self.flocs
            self.studies[stiffness] = study_of(config, self.flocs)
        return self.studies[stiffness]

    def judge(self, case: Case, reference: float) -> Verdict:
        """Run a Case and its reference at a tolerance [m], to the time at which both are there."""
        try:
            study = self.study(case.stiffness)
            draw = study.draw(case.condition, case.vertices, case.delta, case.replicate)
            scene = Scene(study, case, draw)
            kind = case.stiffness, scene.draw.encounter.system.family, type(case.method)
            if kind not in self.warm:  # compiled, or loaded, before it is timed
                scene.run(case.method)
                self.warm.add(kind)
            return judged(scene, Implicit(reference))
        except MemoryError:
            raise
        except Exception as error:  # also of a class of the user's own
            words = f"{type(error).__name__}: {' '.join(str(error).split())}"
            why = str(error) if isinstance(error, FlocsimError) else words
            return Verdict(0, math.nan, math.nan, math.nan, WRONG, why)


@attrs.frozen
class Scene:
    """A replicate that can be run by any method, to any time."""

    study: Study
    case: Case
    draw: Draw

    def run(
        self, method: Integrator, more: int = 1, until: float = math.inf,
        moved: Callable[[Run], None] | None = None,
    ) -> tuple[Run, dict]:  # fmt: skip
        """(Run that has ended, its row); ``moved`` may change the start."""
        made = self.draw.begin(
            self.study.driver(self.draw.encounter, method),
            more * self.study.config.integrator.max_steps, until, integrator=method,
        )  # fmt: skip
        if moved is not None:
            moved(made)
        return made, self.draw.row(made, made.to_end())


def judged(scene: Scene, exact: Integrator) -> Verdict:
    """The Verdict on a Scene's Case, against a run by the method ``exact``."""
    method = scene.case.method
    _ = scene.draw.encounter.scene
    began = time.process_time()
    found, row = scene.run(method)
    spent = time.process_time() - began
    verdict = partial(Verdict, found.steps + found.rejected, spent)

    def stated_of(run):
        return run.error if math.isfinite(method.tolerance) else math.nan

    if row["failure"]:
        return verdict(math.nan, stated_of(found), WRONG, ending(row))
    reference, other = scene.run(exact, MORE_STEPS)
    if other["failure"]:
        return verdict(math.nan, stated_of(found), WRONG, f"no reference: it ends {ending(other)}")
    until = min(found.time, reference.time)
    # Both are stopped where the first of them was decided.
    if found.time > until:
        found, _ = scene.run(method, until=until)
    elif reference.time > until:
        reference, _ = scene.run(exact, MORE_STEPS, until=until)
    error = end_distance(scene.draw.encounter.system.bodies, place_of(found), place_of(reference))
    stated, right = stated_of(found), allowed(scene)
    if (row["outcome"], row["inside"]) != (other["outcome"], other["inside"]):
        most = max(right, stated) + reference.error
        why = f"{ending(row)}, and the reference {ending(other)}"
        if error <= most and is_close_call(row, other, most):
            return verdict(error, stated, STATED, f"{why}: the difference lies within the error")
    elif error <= right:
        return verdict(error, stated, RIGHT)
    elif error <= stated:
        return verdict(error, stated, STATED)
    elif error <= stated + reference.error:
        own = f"of which {reference.error:.2g} m may be the reference's own"
        why = f"no good reference: off by {error:.3g} m, {own}"
    else:
        times = (
            f"{error / stated:.3g} times its stated error" if stated > 0.0 else "and states none"
        )
        why = f"off by {error:.2g} m, {times}"
    return verdict(error, stated, WRONG, why + remark(scene, reference, exact))


def is_close_call(row: dict, other: dict, most: float) -> bool:
    """Whether two runs that end in different classes differ by nothing that is larger than an
    error [m]: one of them just grazes what the other misses, or the collision is at D_0 itself."""
    one, two = OUTCOMES[row["outcome"]], OUTCOMES[other["outcome"]]
    if "missed" in (one, two):
        return DEPARTED.issuperset({one, two} - {"missed"})
    alike = (one in AGGREGATED) == (two in AGGREGATED)
    return alike and abs(row["d_c_collision"] - other["d_c_collision"]) <= most


def allowed(scene: Scene) -> float:
    """Error [m] that is right: the tolerance, or a share of the smaller radius where there is
    none."""
    if math.isfinite(scene.case.method.tolerance):
        return scene.case.method.tolerance
    return CLOSE * min(shape.equivalent_radius for shape in scene.draw.encounter.shapes)


def ending(row):
    """How a replicate ended, in words."""
    reason = f" ({FAILURES[row['failure']]})" if row["failure"] else ""
    zone = {0: ", outside", 1: ", inside"}.get(row["inside"], "") if not reason else ""
    return f"{OUTCOMES[row['outcome']]}{reason}{zone}"


def place_of(run: Run) -> np.ndarray:
    """Where bodies are (n, 3) [m, m, rad]."""
    return run.work.motion[at.NOW, :, :3]


def remark(scene: Scene, reference: Run, exact: Integrator) -> str:
    """Words on a motion that amplifies whatever is off at its start."""
    factor = amplification(scene, reference, exact)
    if factor <= MOST_AMPLIFIED:
        return ""
    return f"; the motion amplifies a perturbation {factor:.2g} times"


def amplification(scene: Scene, reference: Run, exact: Integrator) -> float:
    """The distance of a nudged companion from the reference, over the nudge, where the first of
    both is decided."""
    bodies = scene.draw.encounter.system.bodies
    nudge = nudge_of(bodies)
    still = [attrs.evolve(body, position=(0.0, 0.0)) for body in bodies]
    shift = np.array([body.position for body in nudged(still, nudge)])

    def move(run):
        run.work.motion[at.NOW, :, :2] += shift

    companion, _ = scene.run(exact, MORE_STEPS, reference.time, move)
    if companion.time < reference.time:
        reference, _ = scene.run(exact, MORE_STEPS, companion.time)
    return end_distance(bodies, place_of(companion), place_of(reference)) / nudge


def line_of(config: Config, case: Case, verdict: Verdict) -> str:
    """A Case and its Verdict as a line of the table."""
    name = config.scene.names[case.condition]
    k_n = "as given" if math.isnan(case.stiffness) else f"{case.stiffness:g}"
    method = case.method
    step = getattr(method, "step", math.nan)
    setting = f"{method.tolerance:.0e} m" if math.isfinite(method.tolerance) else f"{step:.0e} s"
    numbers = [
        "-" if math.isnan(value) else f"{value:.1e}" for value in (verdict.error, verdict.stated)
    ]
    spent = "-" if math.isnan(verdict.time) else f"{1e3 * verdict.time:.2f}"
    why = f": {verdict.why}" if verdict.why else ""
    return (
        f"{name:<12}{case.vertices:>5}{k_n:>11}{type(method).__name__:>18}{setting:>11}{case.delta:>7.3g}"
        f"{case.replicate:>6}{verdict.steps or '-':>8}{spent:>10}{numbers[0]:>11}{numbers[1]:>12}"
        f"  {verdict.kind}{why}"
    )


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
