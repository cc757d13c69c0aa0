"""What would call Python out of compiled code is refused, by name and line: it used to hang."""

import builtins

import attrs
import numba
import pytest

from flocsim import Body, Sphere, System
from flocsim.compiler.composer import compile_law, compose
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.diagnose.preflight import check_study
from flocsim.errors import KernelError
from flocsim.forces import CentreForce
from tests.helpers.small_study import SMALL, write_small

say = print


def printing(x):
    y = 2.0 * x
    print(y)
    return y


def printing_by_another_name(x):
    say(x)
    return x


def printing_by_a_module(x):
    builtins.print(x)
    return x


def going_back(x):
    with numba.objmode(y="float64"):
        y = x + 1.0
    return y


def calling(x):
    return printing(x) + 1.0


def hooked(x):
    return x


def with_hook(x):
    return hooked(x)


def raising(x):
    if x < 0.0:
        raise ValueError("below zero")
    return x


def beyond_the_end(x):
    return (1.0, 2.0)[int(x)]


@pytest.mark.parametrize(
    ("function", "named", "words"),
    [
        (printing, printing, "prints, raises"),
        (calling, printing, "prints, raises"),
        (printing_by_another_name, printing_by_another_name, "prints, raises"),
        (printing_by_a_module, printing_by_a_module, "prints, raises"),
        (going_back, going_back, "reads the global 'numba.objmode'"),
        (raising, raising, "prints, raises"),
    ],
)
def test_a_call_of_python_is_refused_by_file_and_line(function, named, words):
    line = named.__code__.co_firstlineno
    with pytest.raises(KernelError, match=rf"\({__file__}:{line}\) {words}"):
        compose(function, {})


def test_a_law_and_what_stands_in_for_a_hook_are_looked_at_too():
    with pytest.raises(KernelError, match="prints, raises"):
        compile_law(printing, "printing", lambda: None)
    compose(with_hook, {}, jit=False)
    with pytest.raises(KernelError, match="prints, raises"):
        compose(with_hook, {hooked: printing})


def test_uncompiled_functions_may_print(capsys):
    assert compose(calling, {}, jit=False)(1.0) == 3.0
    assert capsys.readouterr().out == "2.0\n"


def test_what_raises_by_itself_ends_as_a_kernel_error():
    checked = compose(beyond_the_end, {})
    assert checked(1.0) == 2.0
    with pytest.raises(KernelError, match="a kernel has raised an exception"):
        checked(2.0)


@attrs.frozen
class Loud(CentreForce):
    @staticmethod
    def kernel(pair):
        print(pair.gap)
        return 0.0


def test_a_force_that_prints_is_refused_before_anything_is_compiled():
    system = System([Body(Sphere(5e-6), density=2650.0)] * 2, [Loud()])
    with pytest.raises(KernelError, match=r"Loud\.kernel \(.*\) prints, raises"):
        system.scene()
    assert system.scene(jit=False).laws


LOUD = """\
import attrs
from flocsim.forces import CentreForce


@attrs.frozen
class Loud(CentreForce):
    @staticmethod
    def kernel(pair):
        print(pair.gap)
        return 0.0
"""


def test_a_study_whose_force_prints_is_refused_before_it_begins(tmp_path):
    (tmp_path / "loud.py").write_text(LOUD)
    config = load_config(write_small(tmp_path, SMALL + '[forces.loud]\nclass = "loud:Loud"\n'))
    with pytest.raises(KernelError, match=r"loud\.py:7\) prints, raises"):
        check_study(config)
