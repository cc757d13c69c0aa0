"""A valid config file with every kind of entry, and how tests load texts."""

import pytest

from flocsim.ensembles.config.loader import load_config
from flocsim.errors import ConfigError

VALID = """\
preset = "tang2014"
seed = 3
replicates = 20

[scene]
types = ["I", "III"]
delta = [
    0.0,  # head-on
    0.5,
]
delta_max = "radius"
receiver = "fixed"
start_gap = "2 um"
escape_gap = 4e-6
rest_time = "auto"
time_limit = "5 s"

[shapes]
source = "synthetic"
vertices = [1, 4]
radius = "1 um"
pool = 5
fractal_dimension = 1.7
primary_particles = 40

[bodies]
density = "2.65 g/cm^3"
depth = "10 um"

[fluid]
viscosity = "0.89 mPa s"
density = 997
buoyancy = true
velocity = [0.0, 1e-4]

[forces]
drag.rotational = false
contact = { k_n = "10 N/m", friction = 0.3 }

[forces.van_der_waals]
hamaker = "1e-20 J"
gap = "surface"

[zone]
distance = "5 um"

[integrator]
name = "implicit"
tolerance = "1 nm"
max_steps = 1000
step = 1e-6

[output]
file = "out.h5"
"""


def load_text(folder, text, overrides=None):
    """The Config of a file study.toml in the folder with this text."""
    path = folder / "study.toml"
    path.write_text(text, "utf-8")
    return load_config(path, overrides)


def problem_lines(folder, text, overrides=None):
    """The lines of the ConfigError that the text raises, without the folder."""
    with pytest.raises(ConfigError) as caught:
        load_text(folder, text, overrides)
    return str(caught.value).replace(f"{folder}/", "").split("\n")
