"""Wrong kernels: each is refused in one line that names the force, the file and the line."""

import inspect
import math

import attrs
import numba
import pytest

from flocsim.body import Fluid
from flocsim.errors import KernelError, UsageError
from flocsim.fields import quantity
from flocsim.forces import (
    BodyForce,
    CentreForce,
    Contact,
    ContactForce,
    DoubleLayer,
    Force,
    Gravity,
    PairForce,
    StokesDrag,
    SurfaceForce,
    VanDerWaals,
)
from flocsim.forces.check import check_kernel
from flocsim.forces.codegen import laws_of


@attrs.frozen
class Brush(SurfaceForce):
    """A right one: F = k (2L − gap), with a reach."""

    strength: float = quantity("N/m", above=0.0, default=1e-3)
    brush: float = quantity("m", above=0.0, default=1e-8)

    @property
    def reach(self):
        """Twice the brush."""
        return 2.0 * self.brush

    @staticmethod
    def kernel(pair, strength, reach):
        """k (2L − gap)."""
        return strength * (reach - pair.gap)


@attrs.frozen
class Unknown(Brush):
    @staticmethod
    def kernel(pair, strenght):
        return strenght * pair.gap


@attrs.frozen
class Misspelt(Brush):
    @staticmethod
    def kernel(pair, strength):
        opening = pair.gapp
        return strength * opening


@attrs.frozen
class MisspeltInOneBranch(Brush):
    @staticmethod
    def kernel(pair, strength):
        if pair.gap < 0.0:
            return strength * pair.overlap
        return 0.0


@attrs.frozen
class Pair(CentreForce):
    @staticmethod
    def kernel(pair):
        return pair.gap, 0.0


@attrs.frozen
class NoReturn(CentreForce):
    @staticmethod
    def kernel(pair):
        pair.gap  # noqa: B018


@attrs.frozen
class NoReturnInOneBranch(CentreForce):
    @staticmethod
    def kernel(pair):
        if pair.gap_rate > 0.0:
            return 1e-12


@attrs.frozen
class TwoParts(BodyForce):
    @staticmethod
    def kernel(body):
        return 0.0, -body.mass


@attrs.frozen
class List(ContactForce):
    @staticmethod
    def kernel(contact):
        return [contact.overlap, 0.0]


@attrs.frozen
class WrongLimit(Contact):
    @staticmethod
    def slip_limit(contact, k_n):
        return contact.overlap, k_n


@attrs.frozen
class WrongSlope(Brush):
    @staticmethod
    def slope(pair, strength):
        return "minus k"


@attrs.frozen
class NoParameters(CentreForce):
    @staticmethod
    def kernel():
        return 0.0


@attrs.frozen
class Method(CentreForce):
    def kernel(self, pair):
        return pair.gap


@attrs.frozen
class Lambda(CentreForce):
    kernel = staticmethod(lambda pair: pair.gap)


@attrs.frozen
class Compiled(CentreForce):
    @staticmethod
    @numba.njit
    def kernel(pair):
        return pair.gap


@attrs.frozen
class UndefinedHelper(CentreForce):
    @staticmethod
    def kernel(pair):
        return no_such_helper(pair.gap)  # noqa: F821


@attrs.frozen
class Text(CentreForce):
    label: str = "strong"

    @staticmethod
    def kernel(pair, label):
        return pair.gap


@attrs.frozen
class FailingProperty(CentreForce):
    @property
    def kappa(self):
        """A length of zero divides."""
        return 1.0 / 0.0

    @staticmethod
    def kernel(pair, kappa):
        return kappa * pair.gap


@attrs.frozen
class Reaching(CentreForce):
    limit: object

    @property
    def reach(self):
        """Whatever was given."""
        return self.limit

    @staticmethod
    def kernel(pair):
        return pair.gap


WRONG = {
    Unknown: ("kernel", "asks for 'strenght'.*strength, brush"),
    Misspelt: ("kernel", "in {file}:{body}.*no attribute 'gapp'; did you mean 'gap'"),
    MisspeltInOneBranch: ("kernel", "no attribute 'overlap'; it has time, gap"),
    Pair: ("kernel", "must return one number, the repulsion"),
    NoReturn: ("kernel", "returns None"),
    NoReturnInOneBranch: ("kernel", "returns None"),
    TwoParts: ("kernel", r"must return \(fx, fy, torque\)"),
    List: ("kernel", "makes a list in {file}:{body}"),
    WrongLimit: ("slip_limit", "must return one number, the largest slip"),
    WrongSlope: ("slope", "returns 'minus k'.*slope"),
    NoParameters: ("kernel", "TypeError.*0 positional arguments"),
    Method: ("kernel", "@staticmethod"),
    Lambda: ("kernel", "is a lambda"),
    UndefinedHelper: ("kernel", "fails in {file}:{body}: NameError"),
    Text: ("kernel", "asks for 'label', which is 'strong'; a kernel takes numbers only"),
}


@pytest.mark.parametrize("kind", WRONG, ids=lambda kind: kind.__name__)
def test_a_wrong_kernel_is_named_with_file_and_line(kind):
    name, pattern = WRONG[kind]
    function = getattr(kind(), name)
    line = function.__code__.co_firstlineno
    # A function's first line is that of its decorator; its body begins two further down.
    pattern = pattern.format(file=__file__, body=line + 2)
    with pytest.raises(KernelError, match=pattern) as caught:
        check_kernel(kind(), Fluid())
    message = str(caught.value)
    assert message.startswith(kind.__name__) and "\n" not in message
    assert f"({inspect.getsourcefile(kind)}:{line})" in message


def test_a_compiled_kernel_is_refused():
    with pytest.raises(KernelError, match="leave its @njit out"):
        check_kernel(Compiled(), Fluid())


def test_a_property_that_fails_is_named():
    with pytest.raises(KernelError, match=r"'kappa' cannot be computed .*ZeroDivisionError"):
        check_kernel(FailingProperty(), Fluid())


def test_closures_are_refused_with_what_they_capture():
    strength = 2.0

    @attrs.frozen
    class Capturing(CentreForce):
        @staticmethod
        def kernel(pair):
            return strength * pair.gap

    with pytest.raises(KernelError, match=rf"\({__file__}:\d+\) captures strength"):
        check_kernel(Capturing(), Fluid())


@pytest.mark.parametrize("reach", [math.nan, None, "far"])
def test_a_reach_that_is_no_gap_is_refused(reach):
    with pytest.raises(KernelError, match="Reaching: its reach is"):
        laws_of([Reaching(reach)], Fluid())


@pytest.mark.parametrize("kind", [CentreForce, SurfaceForce, BodyForce, ContactForce])
def test_a_force_without_a_kernel_is_refused(kind):
    with pytest.raises(TypeError, match="abstract method"):
        attrs.frozen(type("Mine", (kind,), {}))()


def test_a_force_of_no_kind_is_refused():
    kernel = {"kernel": staticmethod(lambda view: 0.0)}
    with pytest.raises(TypeError, match="acts_on"):
        attrs.frozen(type("Mine", (PairForce,), kernel))()
    with pytest.raises(UsageError, match="must subclass BodyForce"):
        laws_of([attrs.frozen(type("Mine", (Force,), kernel))()], Fluid())
    with pytest.raises(UsageError, match="found 3"):
        laws_of([3], Fluid())


@attrs.frozen
class Logarithmic(CentreForce):
    """Out of its arithmetic for overlaps, where compiled code gives nan and not an exception."""

    @staticmethod
    def kernel(pair):
        return 1e-12 * math.log(pair.gap) / max(pair.gap, 0.0)


def test_what_lies_beyond_a_kernels_arithmetic_is_no_fault_of_its_form():
    check_kernel(Logarithmic(), Fluid())


@pytest.mark.parametrize(
    "force", [Brush(), Gravity(), StokesDrag(), VanDerWaals(), DoubleLayer(), Contact()]
)
@pytest.mark.parametrize("fluid", [Fluid(), Fluid(gradient=(0.0, 1.0, 0.0, 0.0))])
def test_right_forces_pass(force, fluid):
    check_kernel(force, fluid)
