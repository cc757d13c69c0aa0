"""The schema: its objects, the presets, the example and the page of all keys."""

import math

import attrs
import pytest

from flocsim.__main__ import main
from flocsim.body import Body
from flocsim.ensembles.collision.start import attraction_ratio
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.config.pair_scene import TYPES, PairScene
from flocsim.ensembles.config.schema import (
    FORCES,
    PRESETS,
    BodiesConfig,
    IntegratorConfig,
    ShapesConfig,
    ZoneConfig,
)
from flocsim.ensembles.diagnose.preflight import check_study
from flocsim.errors import UsageError
from flocsim.geometry.shapes.shape import Sphere
from tests.helpers.small_study import load_text, write_star_library

UNASKED = {"lubrication", "thermal", "hydrodynamics"}
"""Forces that no preset has."""


def load_preset(folder, name, more=""):
    return load_text(folder, f'preset = "{name}"\n{more}')


def force_of(config, name):
    return config.forces[config.force_names.index(name)]


def zone_number(config):
    """S = H_A κ/(24π ε0 ε_r φ²); there are roots up to 4/e²."""
    return attraction_ratio(force_of(config, "van_der_waals"), force_of(config, "double_layer"))


def test_conditions_are_named_by_type_or_by_radii():
    assert PairScene(types=("III", "I")).given == (
        ("III", (4.62e-6, 4.95e-6)),
        ("I", (16.41e-6, 23.02e-6)),
    )
    pairs = ((16.41e-6, 23.02e-6), (1e-6, 100e-6))
    assert PairScene(pairs=pairs).given == (
        ("16.41um-23.02um", pairs[0]),
        ("1um-100um", pairs[1]),
    )
    assert PairScene(pairs=pairs).names == ("16.41um-23.02um", "1um-100um")
    assert PairScene().names == ("I", "II", "III")


def test_size_classes_are_named_by_their_quantile_or_by_their_radii():
    def names(classes):
        return PairScene(pairs="measured", classes=classes).names

    assert names(1) == ("measured",)
    assert names(2) == ("q1-q1", "q1-q2", "q2-q2")
    assert names((10e-6,)) == ("to10um-to10um", "to10um-from10um", "from10um-from10um")
    assert names((1e-5, 2e-5))[3:] == (
        "10to20um-10to20um", "10to20um-from20um", "from20um-from20um",
    )  # fmt: skip
    assert PairScene(pairs="measured").weight == "number"
    assert PairScene().weight is PairScene().classes is None


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ({"pairs": "measured", "min_radius": 2e-6, "max_radius": 1e-6}, "is not below max_radius"),
        ({"pairs": "measured", "classes": (2e-5, 1e-5)}, "ascending radii .* found 20 um, 10 um"),
        ({"pairs": "measured", "min_radius": 2e-5, "classes": (1e-5,)}, "ascending radii between"),
        ({"pairs": "measured", "classes": 0}, "from 1 to 20"),
        ({"pairs": "meazured"}, "pairs must be 'measured', found"),
    ],
)
def test_what_measured_pairs_cannot_be(words, why):
    with pytest.raises(UsageError, match=why):
        PairScene(**words)


@pytest.mark.parametrize(
    "make",
    [
        lambda: PairScene(delta=(0.5, 0.5)),
        lambda: PairScene(meeting="shear"),
        lambda: ShapesConfig(vertices=(4, 3.0)),
        lambda: ShapesConfig(source="library"),
        lambda: BodiesConfig(surface_density=2.0, density=2650.0),
        lambda: ZoneConfig(root="middle"),
        lambda: IntegratorConfig(step=-1.0),
    ],
)
def test_objects_made_in_python_are_checked_too(make):
    with pytest.raises(UsageError):
        make()


def test_tang2014_has_the_papers_zone_and_weights(tmp_path):
    config = load_preset(tmp_path, "tang2014")
    assert zone_number(config) == pytest.approx(0.086541, rel=1e-4)
    assert config.zone.root == "outer"
    assert config.body_options(Sphere(1e-5)) == {"surface_density": 2.0}
    assert not config.fluid.buoyancy
    contact = force_of(config, "contact")
    assert (contact.k_n, contact.k_t, contact.damping_n) == (20.0, 2.0, "critical")


def test_the_literal_preset_differs_by_its_debye_length_alone(tmp_path):
    config, literal = load_preset(tmp_path, "tang2014"), load_preset(tmp_path, "tang2014-literal")
    assert zone_number(literal) == pytest.approx(1000.0 * zone_number(config))
    layers = [force_of(c, "double_layer") for c in (config, literal)]
    assert attrs.evolve(layers[1], debye_length=0.98e-6) == layers[0]
    others = [[f for f in c.forces if f not in layers] for c in (config, literal)]
    assert others[0] == others[1]
    assert literal.zone == config.zone


def test_si_gives_its_zone_since_there_is_no_root(tmp_path):
    config = load_preset(tmp_path, "si")
    assert zone_number(config) > 4.0 / math.e**2
    assert config.zone == ZoneConfig(distance=1e-8)
    assert config.body_options(Sphere(1e-5)) == {"density": 2650.0, "depth": "sphere"}
    assert {force_of(config, name).gap for name in ("van_der_waals", "double_layer")} == {"surface"}


def test_the_si_zone_ends_where_the_attraction_is_the_weight(tmp_path):
    config = load_preset(tmp_path, "si")
    receiving, falling = TYPES["I"]
    body = Body(Sphere(falling), **config.body_options(Sphere(falling)))
    weight = 9.81 * body.areal_density * math.pi * falling**2 * (1.0 - 997.0 / 2650.0)
    reduced = receiving * falling / (receiving + falling)
    attraction = 4.7e-20 * reduced / (6.0 * config.zone.distance**2)
    assert attraction == pytest.approx(weight, rel=0.1)


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_runs_by_itself_and_can_be_overridden(tmp_path, name):
    wanted = tuple(name for name in FORCES if name not in UNASKED)
    assert load_preset(tmp_path, name).force_names == wanted
    config = load_preset(
        tmp_path, name, "[forces.van_der_waals]\nhamaker = 3e-20\n[zone]\ncentre = 1e-5\n"
    )
    assert force_of(config, "van_der_waals").hamaker == 3e-20
    assert config.zone == ZoneConfig(centre=1e-5)


def test_init_writes_a_study_of_measured_flocs(tmp_path):
    path = tmp_path / "study.toml"
    assert main(["init", str(path), "--kind", "measured"]) == 0
    write_star_library(tmp_path / "shapes.h5", vertices=(4, 16, 64))
    config = load_config(path)
    assert config.scene.is_measured and config.shapes.size == "own"
    check_study(config)
    text = path.read_text().replace("# weight", "weight").replace("# min_radius", "min_radius")
    path.write_text(text.replace("# classes", "classes"))
    scene = load_config(path).scene
    assert (scene.weight, scene.min_radius, len(scene.names)) == ("volume", 5e-6, 6)
