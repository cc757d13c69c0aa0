"""[bodies] density = {law = "fractal", …}: the looser the larger."""

import numpy as np
import pytest

from flocsim import Sphere
from flocsim.ensembles.collision.mechanisms import make_encounter
from flocsim.errors import ConfigError
from tests.helpers.small_study import load_text

CONFIG = """
preset = "si"
replicates = 1
[scene]
pairs = [["5 um", "100 um"]]
[bodies]
density = {{law = "fractal", primary = "4 um", dimension = {dimension}, solid = "2650 kg/m^3"}}
"""


def test_density_falls_with_size(tmp_path):
    config = load_text(tmp_path, CONFIG.format(dimension=2.1))
    density = config.body_options(Sphere("50 um"))["density"]
    assert density == pytest.approx(997.0 + 1653.0 * (4.0 / 100.0) ** 0.9)


def test_what_is_smaller_than_a_primary_particle_is_solid(tmp_path):
    config = load_text(tmp_path, CONFIG.format(dimension=2.1))
    assert config.body_options(Sphere("1 um"))["density"] == pytest.approx(2650.0)


@pytest.mark.parametrize("dimension", [1.9, 2.1, 2.6])
def test_settling_speeds_grow_as_d_to_the_power_of_n_minus_one(tmp_path, dimension):
    """w = (ρ_p − ρ_w) g D_p^(3 − n) D^(n − 1)/(18 γ), from 10 to 500 µm."""
    config = load_text(tmp_path, CONFIG.format(dimension=dimension))
    for size in np.geomspace(10e-6, 500e-6, 5):
        encounter = make_encounter(config, [Sphere(2e-6), Sphere(0.5 * size)], 1e-8)
        speed = -encounter.settling[1][0][1]
        wanted = 1653.0 * 9.81 * 4e-6 ** (3.0 - dimension) * size ** (dimension - 1.0)
        assert speed == pytest.approx(wanted / (18.0 * 8.9e-4), rel=1e-9)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('{law = "fractal", primary = "4 um", dimension = 2.1}', "needs solid"),
        ('{law = "fractal", primary = "4 um", dimension = 3.5, solid = 2650}', "dimension"),
        ('{law = "fractal", primary = "4 s", dimension = 2.1, solid = 2650}', "primary"),
        ('{law = "fractal", primry = "4 um", dimension = 2.1, solid = 2650}', "primry"),
        ('{law = "fractal", primary = "4 um", dimension = 2.1, solid = 900}', "does not sink"),
        ('{"\\u0001\\u009f" = 1}', "unknown key"),
        ('"heavy"', "must be"),
        ("-5.0", "must be"),
    ],
)
def test_a_wrong_density_is_reported(tmp_path, table, words):
    text = CONFIG.split("density")[0] + f"density = {table}\n"
    with pytest.raises(ConfigError) as caught:
        load_text(tmp_path, text.replace("{{", "{"))
    lines = str(caught.value).splitlines()
    assert words in lines[-1]
    assert all("density" in line and line.isprintable() for line in lines)
