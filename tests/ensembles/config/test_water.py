"""[fluid] temperature, salinity, ionic_strength, and what of the forces follows from them."""

import pytest

from flocsim import Fluid
from flocsim.errors import ConfigError
from tests.helpers.small_study import load_text

OCEAN = 'temperature = "15 degC"\nsalinity = "35 g/kg"'


def loaded(tmp_path, fluid, more="", overrides=None):
    text = f'preset = "si"\nreplicates = 1\n[fluid]\n{fluid}\n{more}'
    return load_text(tmp_path, text, overrides)


def force(config, name):
    return dict(zip(config.force_names, config.forces, strict=True))[name]


def test_water_replaces_what_the_preset_says_of_it(tmp_path):
    config = loaded(tmp_path, OCEAN)
    ocean = Fluid(temperature=288.15, salinity=35.0)
    assert (config.fluid.viscosity, config.fluid.density) == (ocean.viscosity, ocean.density)
    assert config.fluid.buoyancy
    layer = force(config, "double_layer")
    assert (layer.permittivity, layer.debye_length) == (ocean.permittivity, ocean.debye_length)
    assert layer.potential == 15e-3


def test_temperature_alone_leaves_the_debye_length(tmp_path):
    config = loaded(tmp_path, 'temperature = "15 degC"')
    assert force(config, "double_layer").debye_length == 0.98e-9
    assert force(config, "double_layer").permittivity == config.fluid.permittivity


def test_kicks_have_the_temperature_of_the_water(tmp_path):
    config = loaded(tmp_path, 'temperature = "15 degC"', "[forces.thermal]")
    assert force(config, "thermal").temperature == 288.15


def test_a_viscosity_of_ones_own_stays(tmp_path):
    assert loaded(tmp_path, OCEAN + "\nviscosity = 2e-3").fluid.viscosity == 2e-3


@pytest.mark.parametrize(
    ("table", "key", "value"),
    [("double_layer", "debye_length", '"1 nm"'), ("double_layer", "permittivity", "70.0"),
     ("thermal", "temperature", '"20 degC"')],
)  # fmt: skip
def test_what_follows_and_is_given_too_is_refused_with_its_line(tmp_path, table, key, value):
    with pytest.raises(ConfigError, match=rf"\.toml:7: forces\.{table}\.{key}: follows from"):
        loaded(tmp_path, OCEAN, f"[forces.{table}]\n{key} = {value}")


def test_a_sweep_over_salinity_moves_all_that_follows(tmp_path):
    """Over a file that has a viscosity and a Debye length of its own."""
    more = '[forces.double_layer]\ndebye_length = "1 nm"'
    config = loaded(tmp_path, "viscosity = 1e-3", more, {"fluid": {"salinity": 5.0}})
    ocean = Fluid(salinity=5.0)
    assert config.fluid.viscosity == ocean.viscosity
    assert force(config, "double_layer").debye_length == ocean.debye_length


def test_one_salt_replaces_another(tmp_path):
    config = loaded(tmp_path, OCEAN, overrides={"fluid": {"ionic_strength": 10.0}})
    assert config.fluid.salinity is None
    with pytest.raises(ConfigError, match="excludes salinity"):
        loaded(tmp_path, OCEAN + "\nionic_strength = 1.0")


def test_without_a_double_layer_nothing_is_added(tmp_path):
    config = loaded(tmp_path, OCEAN, "[forces]\ndouble_layer = false")
    assert "double_layer" not in config.force_names


def test_unlike_potentials_are_for_pairs(tmp_path):
    layer = '[forces.double_layer]\npotential = ["15 mV", "-40 mV"]'
    assert force(loaded(tmp_path, "", layer), "double_layer").potential == (15e-3, -40e-3)
    swarm = '[scene]\nkind = "swarm"\nnumber = 5\nradius = "5 um"\narea_fraction = 0.1\n'
    with pytest.raises(
        ConfigError,
        match=r"forces\.double_layer\.potential: must be one number in a swarm",
    ):
        loaded(tmp_path, "", layer + "\n" + swarm + "[shapes]\nvertices = [4]")
    with pytest.raises(ConfigError, match=r"double_layer\.potential\[1\] must be an electric"):
        loaded(tmp_path, "", layer.replace("-40 mV", "3 m"))
