"""Forces of a user's own, from a module beside the config file."""

import inspect
import pickle
import sys

import pytest

from flocsim.ensembles.config.loader import load_config
from tests.helpers.small_study import load_text, problem_lines

OWN_FORCE = """\
import attrs
from flocsim.fields import quantity
from flocsim.forces import CentreForce
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
"""


@pytest.fixture
def own_force(tmp_path):
    """A folder with a module of forces and its neighbour, forgotten afterwards."""
    before = set(sys.modules), list(sys.path)
    (tmp_path / "own.py").write_text(OWN_FORCE)
    (tmp_path / "neighbour.py").write_text("SCALE = 2.0\n")
    yield tmp_path / "own.py"
    assert sys.path == before[1]
    for name in set(sys.modules) - before[0]:
        del sys.modules[name]


OWN = '[bodies]\nsurface_density = 2\n[forces.own]\nclass = "{}"\n{}\n[forces.gravity]\n'


def test_a_force_of_ones_own(tmp_path, own_force):
    config = load_text(tmp_path, OWN.format("own:Yukawa", 'strength = "2 pN"\npower = 2'))
    assert config.force_names == ("gravity", "own")
    force = config.forces[1]
    assert (force.strength, force.length, force.power) == (2e-12, 1e-8, 2.0)
    assert force.kernel(None, 3.0) == 6.0
    assert pickle.loads(pickle.dumps(force)) == force
    assert "class Yukawa" in inspect.getsource(type(force))


def test_a_module_is_run_again_once_it_is_edited(tmp_path, own_force, monkeypatch):
    # Python's own cache would take an edit within a second, of the same length, for the old file.
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    text = OWN.format("own:Yukawa", "strength = 1")
    first, second = load_text(tmp_path, text), load_text(tmp_path, text)
    assert type(first.forces[1]) is type(second.forces[1])
    own_force.write_text(OWN_FORCE.replace("SCALE * strength", "9.000 * strength"))
    assert load_text(tmp_path, text).forces[1].kernel(None, 1.0) == 9.0


@pytest.mark.parametrize(
    ("name", "more", "said"),
    [
        (
            "own:Yukawa",
            "strength = '3 kg'",
            "5: forces.own.strength must be a force such as '1 pN'",
        ),
        ("own:Yukawa", "strength = -1", "5: forces.own.strength must be a finite number at least"),
        ("own:Yukawa", "strength = 1\npower = -1", "3: forces.own: 'power' must be > 0.0: -1.0"),
        ("own:Yukawa", "strength = 1\npower = '1 m'", "declares no unit: see flocsim.fields"),
        (
            "own:Yukawa",
            "strength = 1\npower = true",
            "must be a finite number in SI units, found t",
        ),
        ("own:Yukawa", "", "3: forces.own: needs strength"),
        ("own:Yukawe", "", "has no 'Yukawe'; its forces: Yukawa, NoKernel, Undecorated"),
        ("own:Apple", "", "is no force: subclass flocsim.forces.BodyForce"),
        ("own:SCALE", "", "is no force: subclass flocsim.forces.BodyForce"),
        ("own:NoKernel", "", "has no static method `kernel`"),
        ("own:Undecorated", "", "is not decorated: put @attrs.frozen"),
        ("math:pi", "", "is no force"),
        ("own.sub:A", "", "there is no module 'own.sub'"),
    ],
)
def test_a_force_of_ones_own_that_is_wrong(tmp_path, own_force, name, more, said):
    [line] = problem_lines(tmp_path, OWN.format(name, more))
    assert said in line


def test_a_misspelt_parameter_is_unknown_and_the_right_one_missing(tmp_path, own_force):
    assert problem_lines(tmp_path, OWN.format("own:Yukawa", "strenght = 1")) == [
        "study.toml:3: forces.own: needs strength",
        "study.toml:5: forces.own.strenght: unknown key (did you mean 'strength'?); "
        "known: strength, length, power",
    ]


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("\n1/0\n", "own.py:2: ZeroDivisionError: division by zero"),
        ("x = (\n", "own.py:1: '(' was never closed"),
        ("import sys\nsys.exit('bye\\nbye')\n", "own.py:2: SystemExit: bye bye"),
        (
            "import no_such_thing\n",
            "own.py:1: ModuleNotFoundError: No module named 'no_such_thing'",
        ),
        ("import math\n\nmath.sqrt(-1)\n", "own.py:3: ValueError"),
        ("import json\njson.loads('{')\n", "own.py:2: JSONDecodeError"),
        ("x = '\0'", "own"),
        ("def f():\n    f()\nf()\n", "RecursionError"),
    ],
)
def test_a_module_that_raises_names_its_line(tmp_path, own_force, source, said):
    own_force.write_text(source)
    [line] = problem_lines(tmp_path, OWN.format("own:Yukawa", ""))
    assert "forces.own.class: importing module 'own' failed: " in line
    assert said in line
    assert "own" not in sys.modules


def test_a_module_may_not_replace_one_of_pythons(tmp_path, own_force):
    own_force.with_name("json.py").write_text(OWN_FORCE)
    before = sys.modules["json"]
    [line] = problem_lines(tmp_path, OWN.format("json:Yukawa", ""))
    assert "already loaded: rename it" in line
    assert sys.modules["json"] is before


def test_two_configs_may_have_modules_of_the_same_name(tmp_path, own_force):
    folder = tmp_path / "other"
    folder.mkdir()
    (folder / "own.py").write_text(OWN_FORCE.replace("SCALE * strength", "0.5 * strength"))
    text = OWN.format("own:Yukawa", "strength = 1")
    (folder / "study.toml").write_text(text)
    kernels = [
        load_text(tmp_path, text).forces[1].kernel,
        load_config(folder / "study.toml").forces[1].kernel,
    ]
    assert [kernel(None, 1.0) for kernel in kernels] == [2.0, 0.5]
