"""Forces, integrators and shapes of a user's own, from a module beside the config file."""

import inspect
import pickle
import sys

import attrs
import pytest

from flocsim import Sphere
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.config.schema import METHODS, IntegratorConfig
from flocsim.ensembles.diagnose.preflight import check_study
from flocsim.ensembles.storage.identity import differences, identity_of
from flocsim.ensembles.study import Study
from flocsim.errors import KernelError
from flocsim.integrators import VelocityVerlet
from tests.helpers.small_study import load_text, problem_lines

OWN_MODULE = """\
import attrs
import numpy as np
from flocsim import hooks
from flocsim.fields import quantity
from flocsim.forces import CentreForce
from flocsim.geometry.shapes.shape import Shape
from flocsim.integrators import Integrator, VelocityVerlet
from neighbour import SCALE


@attrs.frozen
class Yukawa(CentreForce):
    strength: float = quantity("N", at_least=0.0)
    length: float = quantity("m", above=0.0, default=1e-8)
    power: float = attrs.field(default=1.0, validator=attrs.validators.gt(0.0))

    @staticmethod
    def kernel(pair, strength):
        return SCALE * strength


@attrs.frozen
class NoKernel(CentreForce):
    pass


class Undecorated(CentreForce):
    @staticmethod
    def kernel(pair):
        return 0.0


class Apple:
    pass


@attrs.frozen
class Mine(VelocityVerlet):
    largest_step = 1e-7
    step: float = quantity("s", above=0.0)
    factor: float = quantity("", above=0.0, default=0.5)

    @staticmethod
    def next_step(clock, step, ratio):
        return 1.0 * step


@attrs.frozen
class Stepless(Integrator):
    pass


@attrs.frozen
class Lost(VelocityVerlet):
    @property
    def replaces(self):
        return hooks.no_such_hook


@attrs.frozen
class Backward(VelocityVerlet):
    first_step = -1.0


@attrs.frozen
class Greedy(VelocityVerlet):
    max_steps: int = 3


@attrs.frozen(eq=False)
class Rod(Shape):
    length: float = quantity("m", above=0.0)
    radius: float = quantity("m", above=0.0, default=1e-6)
    points: int = 2

    @property
    def vertices(self):
        x = np.linspace(-0.5, 0.5, self.points) * self.length
        return np.column_stack([x, 0.0 * x])

    @property
    def core(self):
        return self.vertices

    @property
    def area(self):
        return 2.0 * self.length * self.radius + np.pi * self.radius**2

    @property
    def second_moment(self):
        return self.area * self.length**2 / 12.0

    def scaled(self, factor):
        return Rod(self.length * factor, self.radius * factor, self.points)


@attrs.frozen(eq=False)
class Stiff(Rod):
    def scaled(self, factor):
        return self


@attrs.frozen(eq=False)
class Hollow(Rod):
    area = 0.0


@attrs.frozen(eq=False)
class Broken(Rod):
    @property
    def vertices(self):
        raise IndexError("no such\\npoint")
"""


def forget(*names):
    for name in names:
        sys.modules.pop(name, None)


@pytest.fixture
def own_module(tmp_path):
    """A folder with a module of classes and its neighbour, forgotten afterwards."""
    path = list(sys.path)
    (tmp_path / "own.py").write_text(OWN_MODULE)
    (tmp_path / "neighbour.py").write_text("SCALE = 2.0\n")
    yield tmp_path / "own.py"
    assert sys.path == path
    forget("own", "neighbour")


OWN = '[bodies]\nsurface_density = 2\n[forces.own]\nclass = "{}"\n{}\n[forces.gravity]\n'


def test_a_force_of_ones_own(tmp_path, own_module):
    config = load_text(tmp_path, OWN.format("own:Yukawa", 'strength = "2 pN"\npower = 2'))
    assert config.force_names == ("gravity", "own")
    force = config.forces[1]
    assert (force.strength, force.length, force.power) == (2e-12, 1e-8, 2.0)
    assert force.kernel(None, 3.0) == 6.0
    assert pickle.loads(pickle.dumps(force)) == force
    assert "class Yukawa" in inspect.getsource(type(force))


def test_a_module_is_run_again_once_it_is_edited(tmp_path, own_module, monkeypatch):
    # Python's own cache would take an edit within a second, of the same length, for the old file.
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    text = OWN.format("own:Yukawa", "strength = 1")
    first, second = load_text(tmp_path, text), load_text(tmp_path, text)
    assert type(first.forces[1]) is type(second.forces[1])
    own_module.write_text(OWN_MODULE.replace("SCALE * strength", "9.000 * strength"))
    assert load_text(tmp_path, text).forces[1].kernel(None, 1.0) == 9.0


FORCE = (OWN, "strength = 1")
METHOD = ('preset = "tang2014"\n[integrator]\nclass = "{}"\n{}\n', "step = 1")
SHAPES = ('preset = "tang2014"\n[shapes]\nclass = "{}"\n{}\n', "length = 1")


@pytest.mark.parametrize(
    ("table", "name", "more", "said"),
    [
        (
            FORCE,
            "own:Yukawa",
            "strength = '3 kg'",
            "5: forces.own.strength must be a force such as",
        ),
        (FORCE, "own:Yukawa", "strength = -1", "5: forces.own.strength must be a finite number at"),
        (FORCE, "own:Yukawa", "&power = -1", "3: forces.own: 'power' must be > 0.0: -1.0"),
        (FORCE, "own:Yukawa", "&power = '1 m'", "declares no unit: see flocsim.fields"),
        (FORCE, "own:Yukawa", "&power = true", "must be a finite number in SI units, found True"),
        (FORCE, "own:Yukawa", "", "3: forces.own: needs strength"),
        (FORCE, "own:Yukawe", "", "has no 'Yukawe' (did you mean 'Yukawa'?)"),
        (FORCE, "own:Apple", "", "is not a subclass of flocsim.forces"),
        (FORCE, "own:SCALE", "", "is not a subclass of flocsim.forces"),
        (FORCE, "own:NoKernel", "", "does not define kernel"),
        (FORCE, "own:Undecorated", "", "is not decorated: put @attrs.frozen"),
        (FORCE, "own.sub:A", "", "there is no module 'own.sub'"),
        (METHOD, "own:Mine", "", "2: integrator: needs step"),
        (METHOD, "own:Mine", "&max_steps = 0.5", "5: integrator.max_steps must be an integer"),
        (METHOD, "own:Mine", "&faktor = 1", "unknown key (did you mean 'factor'?); known: step"),
        (METHOD, "own:Mine", "&tolerance = 1", "tolerance: unknown key; known: step, factor"),
        (METHOD, "own:Mine", "&name = 'implicit'", "5: integrator.name: excludes class, which"),
        (METHOD, "own:Rod", "", "is not a subclass of flocsim.integrators"),
        (METHOD, "own:Stepless", "", "does not define attempt, next_step"),
        (METHOD, "own:Lost", "", "module 'flocsim.hooks' has no attribute 'no_such_hook'"),
        (METHOD, "own:Backward", "", "first_step must be a number above 0, found -1.0"),
        (METHOD, "own:Greedy", "", "max_steps is a key of flocsim's own"),
        (METHOD, "own", "", "must be 'module:Class', found 'own'"),
        (SHAPES, "own:Rod", "&raduis = 1", "did you mean 'radius'?"),
        (SHAPES, "own:Rod", "&source = 'library'", "5: shapes.source: excludes class, which"),
        (SHAPES, "own:Rod", "&pool = 3", "5: shapes.pool: unknown key; known: length, radius, "),
        (SHAPES, "own:Rod", "&vertices = [1, 4]", "5: shapes.vertices may be 1, the sphere, and 2"),
        (SHAPES, "own:Rod", "&points = 1", "2: shapes: one core point is a sphere: leave class"),
        (SHAPES, "own:Rod", "&points = -1", "2: shapes: Number of samples, -1, must be non-neg"),
        (SHAPES, "own:Stiff", "&", "scaled(2.0) must return a shape of four times the area"),
        (SHAPES, "own:Hollow", "&", "2: shapes: area must be a finite number above 0, found 0.0"),
        (SHAPES, "own:Broken", "&", "2: shapes: no such point"),
        (SHAPES, "own:Mine", "", "is not a subclass of flocsim.geometry.shapes.shape.Shape"),
    ],
)
def test_a_class_of_ones_own_that_is_wrong(tmp_path, own_module, table, name, more, said):
    """``&`` stands for the parameter that the class needs."""
    text, needed = table
    [line] = problem_lines(tmp_path, text.format(name, more.replace("&", f"{needed}\n")))
    assert said in line


def test_types_of_fields_need_not_be_importable(tmp_path, own_module):
    text = OWN_MODULE.replace("power: float", "tail: Nowhere = ()\n    power: float")
    own_module.write_text(f"from __future__ import annotations\n{text}")
    more = "strength = 1\ntail = [1, 2.5]\npower = 2"
    force = load_text(tmp_path, OWN.format("own:Yukawa", more)).forces[1]
    assert (force.tail, force.power) == ((1.0, 2.5), 2.0)


def test_a_misspelt_parameter_is_unknown_and_the_right_one_missing(tmp_path, own_module):
    assert problem_lines(tmp_path, OWN.format("own:Yukawa", "strenght = 1")) == [
        "study.toml:3: forces.own: needs strength",
        "study.toml:5: forces.own.strenght: unknown key (did you mean 'strength'?); "
        "known: strength, length, power",
    ]


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("\n1/0\n", "own.py:2: ZeroDivisionError: division by zero"),
        ("x = (\n", "SyntaxError: '(' was never closed (own.py, line 1)"),
        ("import sys\nsys.exit('bye\\nbye')\n", "own.py:2: SystemExit: bye bye"),
        ("import no_such_thing\n", "own.py:1: ModuleNotFoundError: No module named 'no_such"),
        ("import json\njson.loads('{')\n", "own.py:2: JSONDecodeError"),
        ("x = '\0'", "own"),
        ("def f():\n    f()\nf()\n", "RecursionError"),
    ],
)
def test_a_module_that_raises_names_its_line(tmp_path, own_module, source, said):
    own_module.write_text(source)
    [line] = problem_lines(tmp_path, OWN.format("own:Yukawa", ""))
    assert "forces.own.class: importing module 'own' failed: " in line
    assert said in line
    assert "own" not in sys.modules


def test_a_module_may_not_replace_one_of_pythons(tmp_path, own_module):
    own_module.with_name("json.py").write_text(OWN_MODULE)
    before = sys.modules["json"]
    [line] = problem_lines(tmp_path, OWN.format("json:Yukawa", ""))
    assert "json/__init__.py) has no 'Yukawa'" in line
    assert sys.modules["json"] is before


def test_two_configs_may_have_modules_of_the_same_name(tmp_path, own_module):
    folder = tmp_path / "other"
    folder.mkdir()
    (folder / "own.py").write_text(OWN_MODULE.replace("SCALE * strength", "0.5 * strength"))
    (folder / "neighbour.py").write_bytes(own_module.with_name("neighbour.py").read_bytes())
    text = OWN.format("own:Yukawa", "strength = 1")
    (folder / "study.toml").write_text(text)
    kernels = [
        load_text(tmp_path, text).forces[1].kernel,
        load_config(folder / "study.toml").forces[1].kernel,
    ]
    assert [kernel(None, 1.0) for kernel in kernels] == [2.0, 0.5]


def test_an_integrator_of_ones_own(tmp_path, own_module):
    text = METHOD[0].format("own:Mine", 'step = "10 ns"\nfactor = 2\nmax_steps = 7')
    options = load_text(tmp_path, text).integrator
    assert (options.name, options.label, options.max_steps) == (None, "own:Mine", 7)
    assert (options.method.step, options.method.factor) == (1e-8, 2.0)
    assert attrs.evolve(options, max_steps=8).method is options.method
    assert pickle.loads(pickle.dumps(options)) == options


@pytest.mark.parametrize("name", METHODS)
def test_a_name_makes_flocsims_own_integrator(name):
    made = IntegratorConfig(name=name, tolerance=1e-8, step=1e-7).method
    assert type(made) is METHODS[name]
    assert 1e-8 in attrs.astuple(made) or made == VelocityVerlet(1e-7)


def test_a_shape_of_ones_own(tmp_path, own_module):
    shapes = load_text(tmp_path, SHAPES[0].format("own:Rod", 'length = "6 um"')).shapes
    assert (shapes.source, shapes.label, shapes.vertices) == (None, "own:Rod", (2,))
    assert (shapes.own.length, shapes.own.radius) == (6e-6, 1e-6)
    text = SHAPES[0].format("own:Rod", "length = 1e-6\npoints = 3\nvertices = [1, 3]")
    shapes = load_text(tmp_path, text).shapes
    assert shapes.vertices == (1, 3)
    assert attrs.evolve(shapes, vertices=(1,)).own is shapes.own


def test_a_shape_of_ones_own_is_scaled_to_the_bodies(tmp_path, own_module):
    config = load_text(
        tmp_path, SHAPES[0].format("own:Rod", "length = 6\nradius = 1\nvertices = [1, 2]")
    )
    check_study(config)
    study = Study(config)
    [floc] = study.flocs
    assert (floc.name, list(floc.shapes)) == ("own:Rod", [2])
    for condition, (_, radii) in enumerate(config.scene.given):
        pair = study.encounter(condition, 2, [0.1, 0.2, 0.3, 0.4])
        assert [shape.equivalent_radius for shape in pair.shapes] == pytest.approx(radii)
        assert [s.length / s.radius for s in pair.shapes] == pytest.approx([6.0, 6.0])
        spheres = study.encounter(condition, 1, [0.1, 0.2, 0.3, 0.4])
        assert all(isinstance(shape, Sphere) for shape in spheres.shapes)


def test_a_class_replaces_a_name_from_below_and_the_other_way_round(tmp_path, own_module):
    over = {"integrator": {"class": "own:Mine", "step": 1e-9}}
    text = 'preset = "si"\n[integrator]\nname = "implicit"\n'
    assert load_text(tmp_path, text, over).integrator.label == "own:Mine"
    back = {"integrator": {"name": "velocity_verlet"}}
    text = METHOD[0].format("own:Mine", "step = 1e-9")
    assert load_text(tmp_path, text, back).integrator.method == VelocityVerlet(1e-9)


OWN_STUDY = """\
preset = "tang2014"
[scene]
types = ["III"]
[shapes]
class = "own:Rod"
length = 3
radius = 1
[integrator]
class = "own:Mine"
step = "10 ns"
"""


@pytest.fixture(scope="module")
def first_identity(tmp_path_factory):
    """The identity of OWN_STUDY before anything is edited."""
    folder = tmp_path_factory.mktemp("first")
    (folder / "own.py").write_text(OWN_MODULE)
    (folder / "neighbour.py").write_text("SCALE = 2.0\n")
    try:
        return identity_of(Study(load_text(folder, OWN_STUDY)))
    finally:
        forget("own", "neighbour")


@pytest.mark.parametrize(
    ("edited", "said"),
    [
        ({"/ 12.0": "/ 12.5"}, "the flocs with 2 "),
        (
            {"length * factor": "length * factor * (1.0 if factor > 0.1 else 1.01)"},
            "the flocs with 2 ",
        ),
        (
            {
                "largest_step = 1e-7": "largest_step = 1e-7\n\n    def fresh_clock(self):\n        "
                "clock = VelocityVerlet.fresh_clock(self)\n        clock.step += 1.0\n        "
                "return clock"
            },
            "the initial values of the integrator have changed",
        ),
        ({"1.0 * step": "0.9 * step"}, "the compiled code for polygons has changed"),
        ({"largest_step = 1e-7": "largest_step = 2e-7"}, "integrator.largest_step is 1e-07 in the"),
        ({"default=0.5)": "default=0.6)"}, "integrator.factor is 0.5 in the file, 0.6 now"),
        ({"class Apple": "# nothing that counts\nclass Pear"}, ""),
    ],
)
def test_an_edit_makes_it_another_study(tmp_path, own_module, first_identity, edited, said):
    [(old, new)] = edited.items()
    assert OWN_MODULE.count(old) == 1
    own_module.write_text(OWN_MODULE.replace(old, new))
    found = differences(first_identity, identity_of(Study(load_text(tmp_path, OWN_STUDY))))
    assert bool(found) == bool(said)
    assert all(said in line for line in found[:1])


WITH_HELPER = """\
import attrs
import numba
from flocsim.fields import quantity
from flocsim.forces import CentreForce

FACTOR = 1.0

@numba.{}
def doubled(x):
    return 2.0 * x

@attrs.frozen
class Mine(CentreForce):
    strength: float = quantity("N", above=0.0)

    @staticmethod
    def kernel(pair, strength):
        return doubled(strength) * FACTOR
"""
WITH_HELPER_STUDY = """\
preset = "tang2014"
[shapes]
vertices = [1]
[forces.mine]
class = "own:Mine"
strength = "1 nN"
"""


@pytest.mark.parametrize("edited", [("FACTOR = 1.0", "FACTOR = 2.0"), ("2.0 * x", "3.0 * x")])
def test_a_number_or_a_helper_that_is_edited_makes_it_another_study(tmp_path, own_module, edited):
    found = []
    for old, new in (("", ""), edited):
        own_module.write_text(WITH_HELPER.format("njit").replace(old, new))
        found.append(identity_of(Study(load_text(tmp_path, WITH_HELPER_STUDY))))
    assert "the compiled code for spheres has changed" in differences(*found)[0]


def test_a_helper_that_no_hash_follows_is_refused_with_its_force_before_anything_runs(
    tmp_path, own_module
):
    own_module.write_text(WITH_HELPER.format("vectorize(['f8(f8)'])"))
    said = (
        r"^Mine: kernel Mine.kernel \(.*own\.py:\d+\) reads the global 'doubled', a DUFunc, whose"
    )
    with pytest.raises(KernelError, match=said):
        check_study(load_text(tmp_path, WITH_HELPER_STUDY))


def test_a_parameter_that_is_another_each_time_is_refused(tmp_path, own_module):
    text = WITH_HELPER.format("njit").replace("def kernel(pair, strength)", "def kernel(pair, now)")
    text = text.replace("doubled(strength)", "doubled(now)")
    own_module.write_text(
        text + "\n    @property\n    def now(self):\n        import time\n\n"
        "        return float(time.perf_counter_ns())\n"
    )
    with pytest.raises(KernelError, match=r"Mine: kernel .* asks for 'now', which is .* once and"):
        check_study(load_text(tmp_path, WITH_HELPER_STUDY))
