"""Nothing that reaches the machine code is missing in its hash: it is told, or refused by name.

Each construct is written twice, with another number in it. Either the hashes differ, or both
versions are refused; and where a version is accepted, it computes what plain Python does.
"""

import re

import pytest

from flocsim import Body, Sphere, System
from flocsim.compiler.composer import compose
from flocsim.compiler.fingerprint import fingerprint
from flocsim.errors import KernelError
from flocsim.forces import Contact

TOLD = {
    "numpy number": "import numpy as np\nK = np.float32(@)\ndef kernel(x):\n    return K * x\n",
    "text": "K = '@'\ndef kernel(x):\n    return x if K == '2' else 2.0 * x\n",
    "tuple": "K = (1.0, (@, 2.0))\ndef kernel(x):\n    return K[1][0] * x\n",
    "constant of the code": "def kernel(x):\n    return @ * x\n",
    "sign of zero": "import math\ndef kernel(x):\n    return math.atan2((@ - 3) * 0.0, -x)\n",
    "set in the code": "def kernel(x):\n    return x if 2 in {@, 7} else 0.0\n",
    "default": "def kernel(x, k=@):\n    return k * x\n",
    "named tuple": (
        "from typing import NamedTuple\nclass P(NamedTuple):\n    k: float\n    m: float = 1.0\n"
        "p = P(@)\ndef kernel(x):\n    return p.k * x\n"
    ),
    "default of a named tuple": (
        "from typing import NamedTuple\nclass P(NamedTuple):\n    k: float\n    m: float = @\n"
        "def kernel(x):\n    return P(x).m * x\n"
    ),
    "helper of a helper": (
        "def inner(x):\n    return @ * x\ndef helper(x):\n    return inner(x)\n"
        "def kernel(x):\n    return helper(x)\n"
    ),
    "global of a nested function": (
        "K = @\ndef kernel(x):\n    def inner(y):\n        return K * y\n    return inner(x)\n"
    ),
    "njit that reads a global": "import numba\nK = @\n@numba.njit(cache=True)\ndef helper(x):\n"
    "    return K * x\ndef kernel(x):\n    return helper(x)\n",
    "module's number": "import beside\ndef kernel(x):\n    return beside.K * x\n",
    "module's plain function": "import beside\ndef kernel(x):\n    return beside.helper(x)\n",
    "module's njit": "import beside\ndef kernel(x):\n    return beside.fast(x)\n",
    "module's function that reads another module": (
        "import beside\ndef kernel(x):\n    return beside.through(x)\n"
    ),
    "module of a module": "import beside\ndef kernel(x):\n    return beside.deeper.K * x\n",
    "star import": "from beside import *\ndef kernel(x):\n    return helper(x) + K\n",
}  # fmt: skip
"""Constructs that a kernel may use; @ is 2 or 3."""

DECORATED = (
    "import numba\n@numba.{}\ndef helper(x):\n    return @ * x\n"
    "def kernel(x):\n    return helper(x)\n"
)

REFUSED = {
    "vectorize": (DECORATED.format("vectorize(['f8(f8)'])"), "'helper', a DUFunc"),
    "objmode": (
        "import numba\ndef helper(x):\n    return @ * x\ndef kernel(x):\n"
        "    with numba.objmode(y='f8'):\n        y = helper(x)\n    return y\n",
        "'numba.objmode', ",
    ),
    "array": (
        "import numpy as np\nK = np.array([@])\ndef kernel(x):\n    return K[0] * x\n",
        "'K', a ndarray that can change",
    ),
    "list": ("K = [@]\ndef kernel(x):\n    return K[0] * x\n", "'K', a list that can change"),
    "typed list": (
        "from numba.typed import List\nK = List([@])\ndef kernel(x):\n    return K[0] * x\n",
        "'K', a List that can change",
    ),
    "class attribute": (
        "class Box:\n    k = @\ndef kernel(x):\n    return Box.k * x\n",
        "'Box', the class Box",
    ),
    "enum": (
        "import enum\nclass Mode(enum.Enum):\n    A = @\n"
        "def kernel(x):\n    return Mode.A.value * x\n",
        "'Mode', the class Mode",
    ),
    "object's attribute": (
        "from types import SimpleNamespace\nbox = SimpleNamespace(k=@)\n"
        "def kernel(x):\n    return box.k * x\n",
        "'box', a SimpleNamespace that can change",
    ),
    "named tuple with more": (
        "from typing import NamedTuple\nclass P(NamedTuple):\n    k: float\nclass Q(P):\n"
        "    def more(self):\n        return @\nq = Q(1.0)\ndef kernel(x):\n    return q.more()\n",
        "'q', a Q that can change|'q', the class Q",
    ),
    "partial": (
        "import functools\ndef f(k, x):\n    return k * x\nhelper = functools.partial(f, @)\n"
        "def kernel(x):\n    return helper(x)\n",
        "'helper', a partial, whose code no hash follows",
    ),
    "wrapped by a decorator": (
        "import functools\ndef twice(f):\n    @functools.wraps(f)\n    def inner(x):\n"
        "        return @ * f(x)\n    return inner\n@twice\ndef helper(x):\n    return x\n"
        "def kernel(x):\n    return helper(x)\n",
        "captures f",
    ),
    "callable object": (
        "class Law:\n    def __call__(self, x):\n        return @ * x\nlaw = Law()\n"
        "def kernel(x):\n    return law(x)\n",
        "'law', a Law, whose code no hash follows",
    ),
    "module as a value": (
        "import beside\ndef kernel(x):\n    m = beside\n    return m.K * x\n",
        "uses the module 'beside' as a value",
    ),
    "module that lacks it": (
        "import beside\ndef kernel(x):\n    return beside.missing * x\n",
        "reads beside.missing, but module beside has no attribute missing",
    ),
    "mutable default": (
        "def kernel(x, k=[@]):\n    return k[0] * x\n",
        "a default argument, a list",
    ),
    "function as default": (
        "def f(x):\n    return @ * x\ndef kernel(x, f=f):\n    return f(x)\n",
        "a default argument, a function",
    ),
    "random": (
        "import random\ndef kernel(x):\n    return @ * random.random()\n",
        "'random.random', which draws random numbers",
    ),
    "file that has the name of one of Python's": (
        "import colorsys\ndef kernel(x):\n    return colorsys.LIST[0] * x\n",
        "'colorsys.LIST', a list that can change",
    ),
}
"""Constructs that no hash follows, and what the refusal says."""


@pytest.mark.parametrize("name", TOLD)
def test_what_is_accepted_has_another_hash_when_it_is_edited(load, name):
    found = {}
    for number in (2, 3, 2):
        kernel = load(TOLD[name], number).kernel
        found.setdefault(number, set()).add(fingerprint(kernel, {}))
    assert len(found[2]) == len(found[3]) == 1 and found[2] != found[3]


@pytest.mark.parametrize("name", REFUSED)
def test_what_no_hash_follows_is_refused_by_file_line_and_name(load, name):
    text, words = REFUSED[name]
    for number in (2, 3):
        kernel = load(text, number).kernel
        with pytest.raises(KernelError, match=words) as caught:
            fingerprint(kernel, {})
        assert re.search(r"[\w.]+ \(.*\.py:\d+\)", str(caught.value))
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "name",
    ["named tuple", "numpy number", "njit that reads a global",
     "module's njit", "module's plain function", "module's function that reads another module",
     "star import", "module of a module"],
)  # fmt: skip
def test_what_is_accepted_computes_compiled_what_it_does_in_python(load, name):
    for number in (2, 3):
        kernel = load(TOLD[name], number).kernel
        assert compose(kernel, {})(1.5) == pytest.approx(kernel(1.5))
        assert compose(kernel, {}, jit=False)(1.5) == pytest.approx(kernel(1.5))


def test_a_module_changed_between_linking_and_compiling_does_not_reach_the_machine_code(load):
    """Neither what is given to it later nor what it had compiled before."""
    kernels = load(TOLD["module's njit"], 2)
    assert kernels.beside.fast(1.0) == 2.0
    kernels.beside.K = 5
    linked = compose(kernels.kernel, {})
    kernels.beside.K = 7
    assert linked(1.0) == 5.0


def test_a_global_of_the_name_of_an_attribute_is_not_the_kernels(load):
    text = "gap = [@]\ndef kernel(x):\n    return x.gap\n"
    assert fingerprint(load(text, 2).kernel, {}) == fingerprint(load(text, 3).kernel, {})


def test_sets_in_the_code_do_not_hang_on_the_order_of_a_process(load):
    first, second = (load(f"def f(x):\n    return x in {texts}\n", 2).f
                     for texts in ("{'a', 'b', 'c'}", "{'c', 'b', 'a'}"))  # fmt: skip
    assert fingerprint(first, {}) == fingerprint(second, {})


STICKY = """\
from flocsim.forces import CentreForce
LIST = [@]
def helper(gap):
    return LIST[0] * gap
class Sticky(CentreForce):
    @staticmethod
    def kernel(pair):
        return helper(pair.gap)
"""


def test_the_refusal_names_the_force(load):
    words = r"^Sticky: kernel helper \(.*kernels\.py:3\) reads the global 'LIST', a list"
    with pytest.raises(KernelError, match=words):
        System([Body(Sphere(5e-6), density=2650.0)] * 2, [load(STICKY, 2).Sticky(), Contact()])
