"""Whether accuracy = "auto" keeps its promise: few flips, at the least cost, the pilot included.

    python -m benchmarks.accuracy.auto [--quick] [--replicates 1000] [--sample 150] [--studies …]

For each study: the pilot's choice, then ``--sample`` random replicates of each type (others than
the pilot's) at what it chose, at every fixed tolerance of the ladder and at a reference a hundred
times tighter than the tightest, one setting after the other on each replicate, so that their CPU
times are of one moment. A setting is adequate if it flips no more than a fifth of the sampling
error of ``--replicates``; of the settings that are, the cheapest is what auto should have found.
What the pilot took is spread over the replicates of the study. Goal: cost at most 1.3 times.
The rates of flips are of a sample, and have intervals themselves: they are printed.
"""

import time
from pathlib import Path
from tempfile import TemporaryDirectory

import attrs
import numpy as np

from benchmarks.reporting import Table, parser_of, print_heading
from flocsim.ensembles.collision.draw import MORE_STEPS
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.pilot.choice import (
    ALLOWED,
    REFERENCE,
    choose,
    first_methods,
    sampling_error,
)
from flocsim.ensembles.pilot.ladder import (
    DECADES,
    Job,
    at_rung,
    is_flip,
    sample_of,
    scene_length,
    try_out,
)
from flocsim.ensembles.study import Study
from flocsim.integrators import Implicit
from flocsim.io.confidence import wilson
from flocsim.io.results.run_group import choice_lines

STUDIES = {
    "tang2014 I": 'preset = "tang2014"\n[scene]\ntypes = ["I"]',
    "tang2014 II": 'preset = "tang2014"\n[scene]\ntypes = ["II"]',
    "tang2014 III": 'preset = "tang2014"\n[scene]\ntypes = ["III"]',
    "si III": 'preset = "si"\n[scene]\ntypes = ["III"]',
    "surface-gap repulsion": 'preset = "si"\n[forces.double_layer]\npotential = "30 mV"\n'
    'debye_length = "30 nm"\n[scene]\ntypes = ["I"]',
}
"""Name of a study → its config, but for shapes and numbers."""

GOAL = 1.3


def config_of(text, arguments):
    """The Config of a study."""
    over = {
        "seed": arguments.seed,
        "replicates": arguments.replicates,
        "shapes": {"vertices": arguments.vertices, "pool": 40},
        "integrator": {"accuracy": "auto"},
    }
    with TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(text + "\n", "utf-8")
        return load_config(path, over)


def timed(study, job):
    """(Trial, CPU time [s])."""
    began = time.process_time()
    found = try_out(study, job)[0]
    return found, time.process_time() - began


def settings_of(config, condition, auto):
    """{name: Integrator} of all that is run: the choice, the ladder, and what is exact."""
    length = scene_length(config, condition)
    fixed = [at_rung(Implicit(), rung * length) for rung in DECADES]
    exact = at_rung(Implicit(), REFERENCE * DECADES[-1] * length)
    return {"auto": auto} | {f"{each.tolerance:.0e} m": each for each in fixed} | {"exact": exact}


def measure(study, choice, condition, arguments):
    """{setting: (flips, CPU time of a replicate [s])} of a type."""
    config = study.config
    name = config.scene.names[condition]
    settings = settings_of(config, condition, choice.methods[name])
    steps = config.integrator.max_steps
    pilot = len(sample_of(config)[condition])
    tasks = sample_of(config, pilot + arguments.sample)[condition][pilot:]
    flips, cpu = dict.fromkeys(settings, 0), dict.fromkeys(settings, 0.0)
    for task in tasks:
        exact, _ = timed(study, Job(task, settings["exact"], MORE_STEPS * steps))
        for setting, method in settings.items():
            if setting != "exact":
                found, seconds = timed(study, Job(task, method, steps))
                flips[setting] += is_flip(found, exact)
                cpu[setting] += seconds
    del flips["exact"], cpu["exact"]
    return {each: (flips[each], cpu[each] / len(tasks)) for each in flips}, len(tasks)


def make_ready(study):
    """What a study needs at any setting, and shares with its pilot: compiled code, and shapes."""
    for kind in study.kinds:
        study.run(*kind, study.config.scene.delta[0], 0)
    for task in (task for tasks in sample_of(study.config) for task in tasks):
        study.draw(*task)


def judge(name, text, arguments, table):
    """Run one study and add its lines to the table."""
    config = config_of(text, arguments)
    study = Study(config, methods=first_methods(config))
    make_ready(study)
    began = time.process_time()
    choice = choose(study)
    pilot = time.process_time() - began
    runs = len(config.shapes.vertices) * len(config.scene.delta) * config.replicates
    target = ALLOWED * sampling_error(config)
    print("\n".join(f"{name}: {line}" for line in choice_lines(choice.record)), flush=True)
    # A type each: of several the pilot's time would have to be shared out.
    assert len(config.scene.names) == 1
    found, count = measure(study, choice, 0, arguments)
    share = {setting: flips / count for setting, (flips, _) in found.items()}
    cost = {setting: seconds for setting, (_, seconds) in found.items()}
    cost["auto"] += pilot / runs
    fixed = [setting for setting in found if setting != "auto"]
    good = [setting for setting in fixed if share[setting] <= target]
    best = min(good, key=cost.__getitem__) if good else None
    for setting in found:
        low, high = (100.0 * float(end) for end in wilson(found[setting][0], count))
        label = choice.record["types"][0] if setting == "auto" else None
        shown = f"auto: {label['method']} {label['tolerance']:.0e} m" if label else setting
        ratio = f"{cost[setting] / cost[best]:.2f}" if best else "-"
        verdict = "cheapest adequate" if setting == best else ""
        table.add(
            name, shown, f"{100.0 * share[setting]:.2f} [{low:.2f}, {high:.2f}]",
            100.0 * target, 1e3 * cost[setting], ratio,
            verdict or ("" if share[setting] <= target else "too many flips"),
        )  # fmt: skip
    return 100.0 * pilot / runs / (cost["auto"] - pilot / runs)


def rates(arguments):
    """Replicates per second of one core of all three types at N = 64, second runs included."""
    text = 'preset = "tang2014"\n[scene]\ntypes = ["I", "II", "III"]'
    config = config_of(text, arguments)
    config = attrs.evolve(config, shapes=attrs.evolve(config.shapes, vertices=(64,)))
    study = Study(config, methods=first_methods(config))
    make_ready(study)
    began = time.process_time()
    choice = choose(study)
    pilot = time.process_time() - began
    study = study.by_methods(choice.methods)
    study.compile(study.kinds)
    places, count = study.places, min(arguments.sample, config.replicates)
    for replicate in range(count):
        for place in places:
            study.draw(*place, replicate)
    began = time.process_time()
    for replicate in range(count):
        for place in places:
            study.run(*place, replicate)
    spent = time.process_time() - began
    whole = config.replicates * len(places)
    alone = count * len(places) / spent
    print("\n".join(choice_lines(choice.record)))
    print(
        f"N = 64, types I to III, five delta, {config.replicates} replicates: {alone:.0f}/s of a "
        f"core, second runs included; with the pilot of {pilot:.1f} s in {whole} replicates "
        f"{whole / (whole / alone + pilot):.0f}/s"
    )


def main():
    """Print the table of all studies, and the speed at N = 64."""
    parser = parser_of(__doc__)
    parser.add_argument("--replicates", type=int, default=1000)
    parser.add_argument("--sample", type=int, default=150)
    parser.add_argument("--vertices", type=int, nargs="+", default=[16, 64])
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--studies", nargs="+", choices=STUDIES, default=list(STUDIES))
    arguments = parser.parse_args()
    if arguments.quick:
        arguments.sample, arguments.replicates = 20, 300
    print_heading()
    columns = ("study", "setting", "flips [%], 95 %", "allowed [%]", "CPU [ms]",
               "over the cheapest", "")  # fmt: skip
    table = Table(f'accuracy = "auto" against fixed settings, goal {GOAL} times', columns)
    shares = {name: judge(name, STUDIES[name], arguments, table) for name in arguments.studies}
    table.print(arguments.markdown)
    for name, share in shares.items():
        print(f"{name}: the pilot took {share:.1f} % of what the study takes")
    print(f"largest share of a pilot: {np.max(list(shares.values())):.1f} %")
    rates(arguments)


if __name__ == "__main__":
    main()
