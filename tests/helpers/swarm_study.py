"""A small study of swarms of discs, whose engine the tests of swarms share."""

import numpy as np

from flocsim.ensembles.config.loader import load_any_config
from flocsim.io.results.swarm_file import BONDS, CLUSTERS, ENDS, SWARMS, events_of

SWARM = """\
preset = "si"
seed = 4
replicates = 2
[scene]
kind = "swarm"
number = 12
area_fraction = 0.2
radius = "5 um"
spread = 0.2
duration = "0.3 s"
every = "0.1 s"
[shapes]
vertices = [1]
[forces]
van_der_waals = false
double_layer = false
[output]
file = "swarm.h5"
"""


def write_swarm_study(folder, name="swarm.toml", text=SWARM):
    """The config file in a folder; its path."""
    path = folder / name
    path.write_text(text, "utf-8")
    return path


def swarm_config(folder, overrides=None, text=SWARM):
    """The Config of the small swarm study, with nested overrides."""
    return load_any_config(write_swarm_study(folder, text=text), overrides)


def make_swarm_results(replicates=2, times=3, bodies=4):
    """SwarmResults of discs that fall, two of which hold together."""
    rng = np.random.default_rng(1)
    shape = replicates, times
    position = np.zeros((*shape, bodies, 3))
    position[..., :2] = 1e-5 * rng.random((replicates, 1, bodies, 2))
    position[..., 1] -= 1e-6 * np.arange(times)[:, None]
    numbers = ("clusters", "largest", "percolating", "mean_size", "gyration", "porosity",
               "fractal_dimension", "settling", "bonds_certificate", "bonds_hook", "bonds_rest",
               "bonds_touching",
               "removed", "reentered", "median_error", "error")  # fmt: skip
    counts = {name: np.full(shape, 2.0) for name in numbers}
    each = {name: np.full((replicates, bodies), 1e-6) for name in ("r_eq", "spheroradius", "mass")}
    places = np.broadcast_to(np.arange(bodies), (replicates, bodies)).copy()
    groups = {
        "counts": counts | {"n_class": np.full((*shape, 2), 1.0)},
        "snapshots": {
            "position": position, "velocity": np.zeros_like(position),
            "cluster": np.broadcast_to(np.array([0, 0, *range(1, bodies - 1)], "i4"),
                                       (*shape, bodies)).copy(),
        },
        "bodies": each | {
            "floc": np.full((replicates, bodies), -1, "i4"), "first_point": places,
            "point_count": np.ones_like(places), "points": np.zeros((replicates, bodies, 2)),
            "point_part": np.zeros((replicates, bodies), "i4"),
            "point_ring": np.zeros((replicates, bodies), "i4"),
            "point_radius": np.full((replicates, bodies), 1e-6),
            "box": np.full((replicates, 2), 2e-5),
        },
        "bonds": dict(zip(BONDS, np.array([[0, 1, 1, 0, 1], [1, 2, 1, 0, 2]], "i4").T.copy(),
                          strict=True)),
        "clusters": {
            name: np.arange(3).astype(kind) if kind == "f8" else np.array([0, 1, 1], kind)
            for name, (kind, _, _) in CLUSTERS.items()
        },
        "events": events_of(np.zeros((0, 0, 0))),
        "ends": {name: np.ones(replicates, kind) for name, (kind, _, _) in ENDS.items()},
    }  # fmt: skip
    axes = {"time": 0.1 * np.arange(times), "class": [0.0, 1e-5],
            "component": ["x", "y", "angle"], "axis": ["x", "y"]}  # fmt: skip
    run = {"config": SWARM, "seed": 1, "identity": "{}", "warnings": "[]", "wall_time": 1.0,
           "periodic": "xy", "overrides": "{}"}  # fmt: skip
    return SWARMS.stored(groups, axes, run)
