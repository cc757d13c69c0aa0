"""What forces between outlines cost: an evaluation at touch, what is made once a shape, a study.

    python -m benchmarks.speed.outlines [--pairs 8] [--replicates 20]

evaluates force and torque of pairs of rough flocs, r_eq of some 5 and 16 µm, 1 nm apart at random
poses, in a compiled loop: van der Waals forces (d_min 1 nm), double layers of 0.98 µm, which are
thick beside corners of 1 µm, and of 1 nm, which are thin, each alone and the first two together.
Goals for both: 1 µs at N = 16, 3 µs at N = 64. And it runs replicates of all three types at δ = .5,
N = 16, with both forces by the outlines and as the preset has them, without and with the resistance
of the water between the bodies: how many a second, CPU time without what is made once a shape. Goal
for their ratio: .4.
"""

import time
from itertools import product

import numpy as np

from benchmarks.reporting import EXAMPLES, Table, begin
from flocsim import Body, System
from flocsim.compiler.composer import compose
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.study import Study
from flocsim.forces import DoubleLayer, VanDerWaals
from flocsim.geometry.contact import charges
from flocsim.integrators.rhs.outline_sum import outline_forces_at
from flocsim.state.work import work_of
from tests.integrators.rhs.test_outline_sum import at_gap, rough

GOALS = {16: 1.0, 64: 3.0}
PULL = VanDerWaals(1e-20, law="outline")
THICK, THIN = (DoubleLayer(debye_length=each, law="outline") for each in (0.98e-6, 1e-9))
FORCES = {
    "van der Waals": (PULL,), "double layer, thick": (THICK,), "double layer, thin": (THIN,),
    "both, thick": (PULL, THICK),
}  # fmt: skip

ZONES = {"tang2014": 5.925e-6, "clay": 1e-8, "si": 1e-8}
"""{preset: D_0 [m]}, which divides outcomes and moves with the law where it follows from it."""


def many(scene, work, x, y, angle, count):
    """The sum of so many forces, so that none is left out."""
    total = 0.0
    for k in range(count):
        fx, _, _, _ = outline_forces_at(scene, work, 0.0, 1, 0, x, y, angle + 1e-15 * k, 0.0)
        total += fx
    return total


def cost(one, other, pose, forces, count):
    """Of an evaluation [µs], the least of five CPU times."""
    bodies = [Body(other, density=1100.0), Body(one, pose[:2], pose[2], density=1100.0)]
    system = System(bodies, forces)
    scene = system.scene()
    work = work_of(scene, *system.motion())
    fillings = {**system.compiled_calls, **system.fillings()}
    entry = compose(many, fillings)
    given = [float(each) for each in pose]
    entry(scene, work, *given, 1)
    spent = []
    for _ in range(5):
        start = time.process_time()
        entry(scene, work, *given, count)
        spent.append(time.process_time() - start)
    return 1e6 * min(spent) / count


def study_of(preset, law, film, replicates):
    """A Study of all types, compiled."""
    forces = {"van_der_waals": law, "double_layer": law} | ({"lubrication": {}} if film else {})
    config = load_config(EXAMPLES / "quickstart.toml", {
        "preset": preset, "seed": 1, "replicates": replicates, "forces": forces,
        "zone": {"distance": ZONES[preset]}, "shapes": {"vertices": [16]},
        "scene": {"types": ["I", "II", "III"], "delta": [0.5]}, "integrator": {"check_share": 0.0},
    })  # fmt: skip
    study = Study(config)
    study.compile(study.kinds)
    return study


def run_all(study, replicates):
    """(CPU seconds, steps) of all its replicates."""
    spent, steps = 0.0, 0
    for condition, replicate in product(range(3), range(replicates)):
        _ = study.draw(condition, 16, 0.5, replicate).encounter.scene
        began = time.process_time()
        row = study.run(condition, 16, 0.5, replicate)
        spent += time.process_time() - began
        steps += row["steps"]
    return spent, steps


def print_studies(replicates):
    """The table of studies."""
    table = Table("Replicates a second, N = 16",
                  ("preset", "water between", "as it is", "outlines", "ratio", "steps", "outlines")
                  )  # fmt: skip
    for preset, film in product(ZONES, (False, True)):
        whole = [run_all(study_of(preset, law, film, replicates), replicates)
                 for law in ({}, {"law": "outline"})]  # fmt: skip
        count = 3 * replicates
        (plain, steps), (along, more) = whole
        table.add(preset, "yes" if film else "no", count / plain, count / along, plain / along,
                  steps / count, more / count)  # fmt: skip
    table.print()


def main():
    """Print all tables."""
    args = begin(__doc__, pairs=8, replicates=20)
    pairs, count = (2, 500) if args.quick else (args.pairs, 2000)
    table = Table("A force evaluation at touch, median of pairs",
                  ("N", "forces", "µs", "least", "most", "over the goal"))  # fmt: skip
    made = Table("Made once a shape, r_eq of some 16 µm, 1/κ = 0.98 µm",
                 ("N", "charges", "ms", "nodes", "ms"))  # fmt: skip
    for n, goal in GOALS.items():
        found, rng = {name: [] for name in FORCES}, np.random.default_rng(n)
        for seed in range(pairs):
            one, other = rough(n, 5e-6, seed), rough(n, 16e-6, 50 + seed)
            pose = at_gap(one, other, 1e-9, *rng.uniform(0.0, 6.28, 2))
            for name, forces in FORCES.items():
                found[name].append(cost(one, other, pose, forces, count))
        for name, each in found.items():
            middle = float(np.median(each))
            table.add(n, name, middle, min(each), max(each), middle / goal)
        shape, times = rough(n, 16e-6, 99), [time.perf_counter()]
        known = charges.charges_of_shape(shape, THICK.kappa)
        times.append(time.perf_counter())
        nodes = charges.field_of_shape(shape, THICK.kappa).field
        times.append(time.perf_counter())
        spent = 1e3 * np.diff(times)
        made.add(n, len(known), float(spent[0]), len(nodes), float(spent[1]))
    table.print()
    made.print()
    print_studies(2 if args.quick else args.replicates)


if __name__ == "__main__":
    main()
