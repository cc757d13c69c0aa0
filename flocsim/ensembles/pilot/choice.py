"""`[integrator] accuracy = "auto"`: the cheapest setting of each type that is accurate enough.

A pilot runs the replicates of `sample` at a tight reference, then at the loosest tolerance of the
ladder, and at tighter ones by decades until it expects the flips of a setting to stay below
ALLOWED of the sampling error, with CONFIDENCE (`model`). Where explicit steps that are just
stable would cost less, and the study is so long that they are worth their compilation, they climb
the same ladder after a few replicates have shown that they do. The cheaper of the two is taken.
Costs are counted in evaluations of the forces, so that the choice is a function of config and seed.

What is promised is an expectation of few flips among many. What a study's numerical error really
is, its second runs (`check_share`) say afterwards, beside every probability.
"""

import contextlib
import json
import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import attrs

from flocsim.ensembles.collision.draw import MORE_STEPS
from flocsim.ensembles.config.schema import METHODS, Config
from flocsim.ensembles.kernels import study_of
from flocsim.ensembles.pilot.ladder import (
    DECADES,
    REFERENCE,
    RUNGS,
    WEIGHTS,
    Belief,
    Job,
    Ladder,
    Trial,
    at_rung,
    beliefs,
    expected_replicates,
    mean,
    sample_of,
    sampling_half_width,
    scene_length,
    try_out,
)
from flocsim.ensembles.preflight import sphere_pairs
from flocsim.ensembles.storage.identity import identity_of, short
from flocsim.ensembles.study import Study
from flocsim.errors import RangeError
from flocsim.explain import SETTLING, STABLE, all_scales
from flocsim.integrators import DormandPrince54, Implicit
from flocsim.integrators.base import Integrator

ALLOWED = 0.2
"""Flips over the sampling error."""

CONFIDENCE = 0.75
"""With which the rate of flips of what is chosen stays below that."""

PROBE = 10
"""Replicates that show whether explicit steps are worth a try."""

STIFF = 0.8
"""Cost over that of the implicit method beyond which they are not."""

PATIENCE = 3.0
"""Times the implicit method's mean cost that an explicit run may take: more is stiff."""

STAGES = 7
"""Evaluations of an explicit step."""

SAVING = 0.3
"""Share of the cost that explicit steps may save."""

COMPILE = 2.0e7
"""What another engine costs to compile, in evaluations: some 25 s."""

Share = Callable[[Study, Sequence[Job]], list[Trial]]
"""Runs Jobs, on one rank or on all: their Trials in the same order."""


def run_alone(study: Study, jobs: Sequence[Job]) -> list[Trial]:
    """A Share of one process."""
    return [try_out(study, job)[0] for job in jobs]


@attrs.frozen
class Choice:
    """What a pilot has chosen: the Integrator of every type, and the ``record`` that says why.

    The record is what the results file keeps as JSON: ``of`` names the study, ``target`` is the
    rate of flips that was asked for and ``half_width`` the sampling error, ``cost`` all that was
    run [evaluations]; ``types`` has for each type its ``name``, the ``method`` and ``tolerance``
    [m], ``replicates`` of the pilot, its ``reference`` [m], the ``expected`` rate of flips, the
    ``bound`` that it stays below with CONFIDENCE, and what was ``tried``: ``method``,
    ``tolerance`` [m], ``flips`` and mean ``cost`` of each rung.
    """

    methods: dict[str, Integrator]
    record: dict[str, Any]


def adequate(belief: Belief, target: float) -> float | None:
    """The loosest rung whose flips are expected to stay below the target; None for none."""
    return next((rung for rung in RUNGS if belief.bound(rung, CONFIDENCE) <= target), None)


def best_rung(ladder: Ladder, belief: Belief, target: float) -> float:
    """The cheapest of the rungs that are good enough, of those up to the tightest that was run.

    Mostly the loosest, but not where coarse steps fail so often that finer ones are cheaper.
    """
    good = adequate(belief, target) or RUNGS[-1]
    known = [rung for rung in RUNGS if ladder.tried and min(ladder.tried) <= rung <= good]
    return min(known or [good], key=lambda rung: ladder.mean_cost(rung) if known else 0.0)


def first_methods(config: Config) -> dict[str, Integrator]:
    """The methods of a Study before a pilot: the config's, or what stands in for a choice to come.

    On these a pilot runs; each of its trials has a method of its own.
    """
    return dict.fromkeys(config.scene.names, config.integrator.method)


def sampling_error(config: Config) -> float:
    """The sampling error of a condition that the study will have: half an interval at Pr = ½."""
    return sampling_half_width(expected_replicates(config))


def choose(study: Study, share: Share = run_alone) -> Choice:
    """The Choice for a Study that was made with `first_methods`; ``share`` runs its Jobs."""
    config = study.config
    half_width = sampling_error(config)
    target = ALLOWED * half_width
    ladders = implicit_ladders(study, share, target)
    climb(study, ladders, share, target)
    explicit = explicit_ladders(study, ladders, share, target)
    climb(study, explicit, share, target)
    methods, types = settled(config, ladders, explicit, target)
    runs = [trials for each in [*ladders, *explicit] for trials in each.tried.values()]
    runs += [each.exact for each in ladders]
    cost = sum(each.cost for trials in runs for each in trials)
    record = {
        "of": key_of(study), "target": target, "half_width": half_width, "cost": cost,
        "types": types,
    }  # fmt: skip
    return Choice(methods, json.loads(json.dumps(record)))


def settled(
    config: Config, ladders: Sequence[Ladder], explicit: Sequence[Ladder], target: float
) -> tuple[dict[str, Integrator], list[dict]]:
    """({type: Integrator}, what the record has of each) of what has been tried.

    ``ladders`` of the implicit method, one for each type, and ``explicit`` ones of some.
    """
    blank = beliefs([each.seen() for each in ladders])
    least = {
        each.condition: each.mean_cost(best_rung(each, belief, target))
        for each, belief in zip(ladders, blank, strict=True)
        if each.tried
    }
    # What is too stiff for explicit steps runs out of them: that would pass for flips.
    explicit = [
        each for each in explicit if min(map(each.cost, each.tried)) < least[each.condition]
    ]
    known = beliefs([each.seen() for each in [*ladders, *explicit]])
    tail = zip(explicit, known[len(ladders) :], strict=True)
    others = {each.condition: (each, belief) for each, belief in tail}
    methods: dict[str, Integrator] = {}
    types: list[dict] = []
    for ladder, belief in zip(ladders, known, strict=False):
        name = config.scene.names[ladder.condition]
        taken = cheaper((ladder, belief), others.get(ladder.condition), target)
        tried = tried_of(ladder)
        if ladder.condition in others:
            tried += tried_of(others[ladder.condition][0])
        methods[name], facts = described(taken, target)
        types.append({"name": name, **facts, "tried": tried})
    return methods, types


def implicit_ladders(study, share, target):
    """The Ladder of every type, its replicates run at the reference."""
    config = study.config
    steps = MORE_STEPS * config.integrator.max_steps
    [blank] = beliefs([[]])
    reference = REFERENCE * (adequate(blank, target) or RUNGS[-1])
    ladders = []
    for condition, tasks in enumerate(sample_of(config)):
        length = scene_length(config, condition, study.flocs)
        ladders.append(Ladder(condition, Implicit(), length, tasks, reference, [], {},
                              config.integrator.max_steps))  # fmt: skip
    jobs = [
        Job(task, at_rung(each.method, reference * each.length), steps)
        for each in ladders
        for task in each.tasks
    ]
    found = iter(share(study, jobs) if jobs else [])
    for each in ladders:
        each.exact = [next(found) for _ in each.tasks]
    return ladders


def climb(study, ladders, share, target):
    """Run decade after decade of the ladders until of each one is expected to be good enough."""
    left = [each for each in ladders if each.tasks]
    for rung in DECADES:
        jobs = [job for each in left for job in each.jobs(rung)]
        if not jobs:
            return
        found = iter(share(study, jobs))
        for each in left:
            each.tried[rung] = [next(found) for _ in each.tasks]
        known = beliefs([each.seen() for each in ladders])
        rungs = [adequate(belief, target) for belief in known]
        left = [
            each
            for each, good in zip(ladders, rungs, strict=True)
            if each in left and (good is None or good < rung or each.is_dear())
        ]


def explicit_ladders(study, ladders, share, target):
    """Ladders of explicit steps for the types where they may pay."""
    config = study.config
    cells = len(config.shapes.vertices) * len(config.scene.delta)
    runs = cells * expected_replicates(config)
    known = beliefs([each.seen() for each in ladders])
    candidates, jobs = [], []
    for ladder, belief in zip(ladders, known, strict=True):
        if not ladder.tried:
            continue
        rung = best_rung(ladder, belief, target)
        cost = ladder.mean_cost(rung)
        engines = len({n > 1 for n in config.shapes.vertices})
        if stable_cost(study, ladder) > STIFF * cost or SAVING * runs * cost < COMPILE * engines:
            continue
        steps = int(PATIENCE * cost / (STAGES * WEIGHTS[DormandPrince54])) + 1
        made = attrs.evolve(ladder, method=DormandPrince54(), tried={}, max_steps=steps)
        candidates.append((made, ladder, rung))
        jobs += made.jobs(rung)[:PROBE]
    found = share(study, jobs) if jobs else []
    taken = []
    for place, (made, ladder, rung) in enumerate(candidates):
        probe = found[PROBE * place : PROBE * (place + 1)]
        if mean([each.cost for each in probe]) <= STIFF * probe_cost(ladder, rung):
            taken.append(made)
    return taken


def stable_cost(study, ladder):
    """What explicit steps of the largest size that is stable would cost in the mean replicate.

    Where polygons touch at several points they have to be smaller still: the probe tells.
    """
    name = study.config.scene.names[ladder.condition]
    pair = next(pair for each, pair in sphere_pairs(study.config, study.flocs) if each == name)
    limits = [time for name, time in all_scales(pair.system).items() if name != SETTLING]
    steps = mean([each.time for each in ladder.exact]) / (STABLE * min(limits)) if limits else 0.0
    return STAGES * WEIGHTS[DormandPrince54] * steps


def probe_cost(ladder, rung):
    """What the probe's replicates cost by the implicit method at a rung."""
    at = min(ladder.tried, key=lambda each: abs(math.log(each / rung)))
    part = mean([each.cost for each in ladder.tried[at][:PROBE]])
    return part * ladder.mean_cost(rung) / ladder.mean_cost(at)


def cheaper(first, second, target):
    """Of two (Ladder, Belief) the one whose setting that is good enough costs less."""
    if second is None or adequate(second[1], target) is None:
        return first
    costs = [each[0].mean_cost(best_rung(*each, target)) for each in (first, second)]
    return second if costs[1] < costs[0] else first


def described(taken, target):
    """(the Integrator of a type, its part of the record), from the (Ladder, Belief) it takes."""
    ladder, belief = taken
    rung = best_rung(ladder, belief, target)
    made = at_rung(ladder.method, rung * ladder.length)
    return made, {
        "method": name_of(made),
        "tolerance": made.tolerance,
        "replicates": len(ladder.tasks),
        "reference": at_rung(made, ladder.reference * ladder.length).tolerance,
        "expected": belief.expected(rung),
        "bound": belief.bound(rung, CONFIDENCE),
    }


def tried_of(ladder):
    """What the record has of each rung that was run."""
    return [
        {
            "method": name_of(ladder.method),
            "tolerance": at_rung(ladder.method, rung * ladder.length).tolerance,
            "flips": ladder.flips(rung),
            "cost": ladder.cost(rung),
        }
        for rung in ladder.tried
    ]


def name_of(method):
    return next(name for name, each in METHODS.items() if each is type(method))


def key_of(study: Study) -> str:
    """What a choice is of: all that a pilot's replicates follow from, and which they are."""
    config = study.config
    scene = config.scene
    which = {
        "types": list(scene.names), "delta": list(scene.delta),
        "vertices": list(config.shapes.vertices),
        "replicates": expected_replicates(config),
        "indices": config.replicates, "max_steps": config.integrator.max_steps,
    }  # fmt: skip
    return short(identity_of(study) | which)


def recorded_choice(study: Study, records: Iterable[dict]) -> Choice | None:
    """The Choice of this very study among records that were kept; None where there is none.

    The study was made with `first_methods`. Whoever wrote the records: the methods of one that is
    taken are part of the study's identity.
    """
    key, names = key_of(study), list(study.config.scene.names)
    for record in records:
        chosen = record.get("types", [])
        if record.get("of") == key and [each["name"] for each in chosen] == names:
            with contextlib.suppress(KeyError, RangeError):
                made = [METHODS[each["method"]](each["tolerance"]) for each in chosen]
                return Choice(dict(zip(names, made, strict=True)), record)
    return None


def final_methods(config: Config) -> dict[str, Integrator]:
    """The methods that a study of the config has, a pilot run here where it is to choose them."""
    if not config.integrator.is_chosen:
        return first_methods(config)
    return choose(study_of(config, methods=first_methods(config))).methods
