"""CPU time of one evaluation of the forces by each method that a pilot may choose.

    python -m benchmarks.accuracy.pilot_weights [--quick]

All that a step does besides (Newton's systems, events, lists) is shared out over its evaluations.
The ratio to Implicit is WEIGHTS of flocsim.ensembles.pilot.ladder: a pilot counts, and never takes
the time, so that its choice is the same everywhere. Replicates of tang2014 I and II, in turn.
"""

import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import flocsim.arrays as at
from benchmarks.reporting import Table, parse_arguments, print_heading
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.pilot.ladder import WEIGHTS
from flocsim.ensembles.study import Study

CONFIG = 'preset = "tang2014"\nseed = 3\n[scene]\ntypes = ["I", "II"]\n[shapes]\n'
TOLERANCE = 1e-8
VERTICES = (4, 16, 64)


def study():
    """The study whose replicates are run."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(f"{CONFIG}vertices = {list(VERTICES)}\n", "utf-8")
        return Study(load_config(path))


def spent(made, method, place, replicate):
    """(CPU time [s], evaluations) of a replicate."""
    draw = made.draw(*place, replicate)
    driver = made.driver(draw.encounter, method)
    run = draw.begin(driver, made.config.integrator.max_steps, integrator=method)
    began = time.process_time()
    run.to_end()
    return time.process_time() - began, int(run.work.tally[at.EVALUATIONS])


def main():
    """Print the table."""
    arguments = parse_arguments(__doc__)
    print_heading()
    made, count = study(), 2 if arguments.quick else 20
    methods = [some_class(TOLERANCE) for some_class in WEIGHTS]
    totals = {(type(m).__name__, n): np.zeros(2) for m in methods for n in VERTICES}
    for method in methods:
        spent(made, method, made.places[0], 0)
    for replicate in range(count):
        for place in made.places:
            for method in methods:
                totals[type(method).__name__, place[1]] += spent(made, method, place, replicate)
    table = Table("CPU time of an evaluation", ("N", "method", "[us]", "over Implicit"))
    for n in VERTICES:
        each = {name: total for (name, of), total in totals.items() if of == n}
        first = each["Implicit"][0] / each["Implicit"][1]
        for name, (cpu, evaluations) in each.items():
            table.add(n, name, 1e6 * cpu / evaluations, cpu / evaluations / first)
    table.print(arguments.markdown)


if __name__ == "__main__":
    main()
