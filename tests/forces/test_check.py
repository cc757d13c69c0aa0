"""Wrong kernels: each is refused in one line that names the force, the file and the line."""

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


def unknown(pair, strenght):
    return strenght * pair.gap


def misspelt(pair, strength):
    return strength * pair.gapp


def misspelt_in_one_branch(pair, strength):
    if pair.gap < 0.0:
        return strength * pair.overlap
    return 0.0


def two_numbers(pair):
    return pair.gap, 0.0


def no_return_in_one_branch(pair):
    if pair.gap_rate > 0.0:
        return 1e-12


def two_parts(body):
    return 0.0, -body.mass


def makes_a_list(contact):
    return [contact.overlap, 0.0]


def limit_of_two(contact, k_n):
    return contact.overlap, k_n


def slope_in_words(pair, strength):
    return "minus k"


def no_parameters():
    return 0.0


def undefined_helper(pair):
    return no_such_helper(pair.gap)  # noqa: F821


def asks_for_text(pair, label):
    return pair.gap


@attrs.frozen
class Labelled(Brush):
    label: str = "strong"


WRONG = [
    (Brush, "kernel", unknown, "asks for 'strenght'.*strength, brush"),
    (Brush, "kernel", misspelt, "in {file}:{body}.*no attribute 'gapp'; did you mean 'gap'"),
    (Brush, "kernel", misspelt_in_one_branch, "no attribute 'overlap'; it has time, gap"),
    (CentreForce, "kernel", two_numbers, "must return one number, the repulsion"),
    (CentreForce, "kernel", no_return_in_one_branch, "returns None"),
    (BodyForce, "kernel", two_parts, r"must return \(fx, fy, torque\)"),
    (ContactForce, "kernel", makes_a_list, "must return \\(normal, tangential\\)"),
    (Contact, "slip_limit", limit_of_two, "must return one number, the largest slip"),
    (Brush, "slope", slope_in_words, "returns 'minus k'.*slope"),
    (CentreForce, "kernel", no_parameters, "TypeError.*0 positional arguments"),
    (CentreForce, "kernel", lambda pair: pair.gap, "is a lambda"),
    (CentreForce, "kernel", undefined_helper, "fails in {file}:{body}: NameError"),
    (Labelled, "kernel", asks_for_text, "asks for 'label', which is 'strong'; a kernel takes num"),
]


def mine(base, **members):
    """A force of a class of its own, with these members in place of the base's."""
    return attrs.frozen(type("Mine", (base,), members))()


@pytest.mark.parametrize("base, name, function, pattern", WRONG)
def test_a_wrong_kernel_is_named_with_file_and_line(base, name, function, pattern):
    line = function.__code__.co_firstlineno
    with pytest.raises(KernelError, match=pattern.format(file=__file__, body=line + 1)) as caught:
        check_kernel(mine(base, **{name: staticmethod(function)}), Fluid())
    message = str(caught.value)
    assert message.startswith("Mine") and "\n" not in message
    assert f"({__file__}:{line})" in message


@pytest.mark.parametrize(
    "kernel, pattern",
    [(misspelt, "@staticmethod"), (staticmethod(numba.njit(unknown)), "leave its @njit out")],
)
def test_a_kernel_is_a_plain_function_of_the_class(kernel, pattern):
    with pytest.raises(KernelError, match=pattern):
        check_kernel(mine(Brush, kernel=kernel), Fluid())


def test_a_property_that_fails_is_named():
    def kernel(pair, kappa):
        return kappa * pair.gap

    force = mine(CentreForce, kappa=property(lambda self: 1.0 / 0.0), kernel=staticmethod(kernel))
    with pytest.raises(KernelError, match=r"'kappa' cannot be computed .*ZeroDivisionError"):
        check_kernel(force, Fluid())


def test_closures_are_refused_with_what_they_capture():
    strength = 2.0

    def capturing(pair):
        return strength * pair.gap

    with pytest.raises(KernelError, match=rf"\({__file__}:\d+\) captures strength"):
        check_kernel(mine(CentreForce, kernel=staticmethod(capturing)), Fluid())


@pytest.mark.parametrize("reach", [math.nan, None, "far"])
def test_a_reach_that_is_no_gap_is_refused(reach):
    force = mine(CentreForce, kernel=staticmethod(logarithmic), reach=reach)
    with pytest.raises(KernelError, match="Mine: its reach is"):
        laws_of([force], Fluid())


@pytest.mark.parametrize("kind", [CentreForce, SurfaceForce, BodyForce, ContactForce])
def test_a_force_without_a_kernel_is_refused(kind):
    with pytest.raises(TypeError, match="abstract method"):
        mine(kind)


def test_a_force_of_no_kind_is_refused():
    kernel = {"kernel": staticmethod(lambda view: 0.0)}
    with pytest.raises(TypeError, match="acts_on"):
        mine(PairForce, **kernel)
    with pytest.raises(UsageError, match="must subclass BodyForce"):
        laws_of([mine(Force, **kernel)], Fluid())
    with pytest.raises(UsageError, match="found 3"):
        laws_of([3], Fluid())


def logarithmic(pair):
    """Out of its arithmetic for overlaps, where compiled code gives nan and not an exception."""
    return 1e-12 * math.log(pair.gap) / max(pair.gap, 0.0)


def test_what_lies_beyond_a_kernels_arithmetic_is_no_fault_of_its_form():
    check_kernel(mine(CentreForce, kernel=staticmethod(logarithmic)), Fluid())


@pytest.mark.parametrize(
    "force", [Brush(), Gravity(), StokesDrag(), VanDerWaals(), DoubleLayer(), Contact()]
)
@pytest.mark.parametrize("fluid", [Fluid(), Fluid(gradient=(0.0, 1.0, 0.0, 0.0))])
def test_right_forces_pass(force, fluid):
    check_kernel(force, fluid)
