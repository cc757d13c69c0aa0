"""A small study of swarms of discs, whose engine the tests of swarms share."""

import numpy as np

from flocsim.ensembles.config.loader import load_any_config
from flocsim.io.results.swarm_file import BONDS, CLUSTERS, GROUPS, SWARMS

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
    lengths = {"replicate": replicates, "time": times, "class": 2, "body": bodies, "component": 3,
               "axis": 2, "point": bodies, "bond": 2, "row": 3, "event": 0}  # fmt: skip
    groups = {
        name: {
            column: np.ones([lengths[axis] for axis in each.axes], each.type)
            for column, each in group.columns.items()
        } for name, group in GROUPS.items()
    }  # fmt: skip
    groups["counts"] = {name: 2.0 * values for name, values in groups["counts"].items()}
    groups["counts"]["n_class"] /= 2.0
    moments, found = groups["snapshots"], groups["bodies"]
    moments["velocity"][:] = moments["position"][:] = 0.0
    rng = np.random.default_rng(1)
    moments["position"][..., :2] = 1e-5 * rng.random((replicates, 1, bodies, 2))
    moments["position"][..., 1] -= 1e-6 * np.arange(times)[:, None]
    moments["cluster"][:] = [0, 0, *range(1, bodies - 1)]
    for name in ("r_eq", "spheroradius", "mass", "point_radius"):
        found[name] *= 1e-6
    found["first_point"][:], found["floc"][:] = np.arange(bodies), -1
    found["box"] *= 2e-5
    for name in ("points", "point_part", "point_ring"):
        found[name][:] = 0
    pairs = np.array([[0, 1, 1, 0, 1], [1, 2, 1, 0, 2]], "i4")
    groups["bonds"] = dict(zip(BONDS, pairs.T.copy(), strict=True))
    for name, (kind, _, _) in CLUSTERS.items():
        groups["clusters"][name] = np.array([0, 1, 2] if kind == "f8" else [0, 1, 1], kind)
    axes = {"time": 0.1 * np.arange(times), "class": [0.0, 1e-5],
            "component": ["x", "y", "angle"], "axis": ["x", "y"]}  # fmt: skip
    run = {"config": SWARM, "seed": 1, "identity": "{}", "warnings": "[]", "wall_time": 1.0,
           "periodic": "xy", "overrides": "{}"}  # fmt: skip
    return SWARMS.stored(groups, axes, run)
