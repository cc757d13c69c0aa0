"""A small study of swarms of discs, whose engine the tests of swarms share."""

from flocsim.ensembles.config.loader import load_any_config

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
