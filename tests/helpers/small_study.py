"""A small study that needs just two compiled scenes, a config file with every kind of entry, and
how tests load such files and run the commands on them."""

import subprocess
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.study import Study
from flocsim.errors import ConfigError
from flocsim.geometry.shapes.cores import Part
from flocsim.io.shape_library import ShapeEntry, StoredFit, write_library
from tests.helpers.waiting import PATIENCE

SMALL = """\
preset = "tang2014"
seed = 1
replicates = 3
[scene]
types = ["I", "III"]
delta = [0.0, 1.0]
[shapes]
vertices = [1, 4, 16]
pool = 2
[output]
file = "small.h5"
"""

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

ROOT = Path(__file__).resolve().parents[2]
BESIDE_PYTHON = Path(sys.executable).parent


def problems(errors):
    """The lines on stderr but for warnings and for what is compiled."""
    said = ("flocsim: warning: ", "flocsim: first run: compiling ")
    return [line for line in errors.splitlines() if not line.startswith(said)]


def write_small(folder, text=SMALL, name="small.toml", **changes):
    """A config file in the folder; ``changes`` replace whole "key = value" lines by key."""
    lines = text.splitlines()
    for key, value in changes.items():
        places = [k for k, line in enumerate(lines) if line.startswith(f"{key} =")]
        lines[places[0]] = f"{key} = {value}"
    path = folder / name
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


def small_config(folder, overrides=None):
    """The small study's Config with nested overrides."""
    return load_config(write_small(folder), overrides)


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


@cache
def grown(seed, vertices, pool):
    """The flocs of a study with these settings, fitted once for all tests."""
    from flocsim.ensembles.collision.flocs import load_flocs
    from flocsim.ensembles.config.schema import ShapesConfig

    return load_flocs(ShapesConfig(vertices=vertices, pool=pool), seed)


def small_study(folder, overrides=None):
    """The Study of the small config with overrides; its flocs are shared between tests."""
    config = small_config(folder, overrides)
    shapes = config.shapes
    polygons = any(n > 1 for n in shapes.vertices)
    flocs = grown(config.seed, shapes.vertices, shapes.pool) if polygons else []
    return Study(config, flocs=flocs)


def write_star_library(path, vertices=(4,), ratios=(8.0, 16.0, 24.0)):
    """A shape library of one star per size-to-spheroradius ratio, fitted at these N."""
    entries = [
        ShapeEntry(
            f"star {ratio:g}", "stars.png", 1e-6, (0.0, 0.0), 100, ratio, 1.0,
            {count: star_fit(count, ratio) for count in vertices},
        )
        for ratio in ratios
    ]  # fmt: skip
    write_library(path, entries)


def star_fit(count, ratio):
    """A star of ``count`` vertices around a spheroradius of 1 um."""
    angles = 2.0 * np.pi * np.arange(count) / count
    rays = ratio * 1e-6 * np.where(np.arange(count) % 2, 0.7, 1.0)
    core = (rays * np.array([np.cos(angles), np.sin(angles)])).T
    return StoredFit((Part((core,), 1e-6),), 3.0)


def mpirun():
    """The launcher beside this Python; the test is skipped where it or mpi4py is missing."""
    pytest.importorskip("mpi4py", reason="needs flocsim[mpi]")
    launcher = BESIDE_PYTHON / "mpirun"
    if not launcher.exists():
        pytest.skip(f"there is no {launcher}: install flocsim[mpi]")
    return str(launcher)


@cache
def launcher_kind():
    """Whose launcher it is: "MPICH", "Open MPI" or "Intel"."""
    said = subprocess.run([mpirun(), "--version"], capture_output=True, text=True).stdout
    return next((name for name in ("Open MPI", "Intel") if name in said), "MPICH")


def command(*words, ranks=None, module="flocsim.ensemble"):
    """The words of a command line of flocsim, under mpirun where ``ranks`` are given."""
    launch = [] if ranks is None else [mpirun(), "-n", str(ranks)]
    return [*launch, sys.executable, "-m", module, *map(str, words)]


def run_command(folder, *words, ranks=None, module="flocsim.ensemble", **options):
    """Run a command in the folder; the finished process with its output as text."""
    return subprocess.run(
        command(*words, ranks=ranks, module=module),
        cwd=folder, capture_output=True, text=True, timeout=PATIENCE, **options,
    )  # fmt: skip
