"""Forces are known by their places: any number of one class, in any order."""

import itertools
import math

import attrs
import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, System
from flocsim.errors import KernelError, KernelWarning, UsageError
from flocsim.fields import quantity
from flocsim.forces import CentreForce, Contact, Gravity
from flocsim.forces.base import force_names
from flocsim.forces.codegen import laws_of
from flocsim.swarms.swarm import Swarm

R = 1e-6
APART = [Body(Sphere(R), (4.0 * R * k, 0.0), density=2650.0) for k in range(2)]


@attrs.frozen
class Pull(CentreForce):
    """−k up to a gap, NaN at gaps below ``hole``, nothing where k is zero."""

    k: float = quantity("N", default=1e-15)
    far: float = math.inf
    hole: float = 0.0

    @property
    def reach(self):
        return self.far

    @property
    def absent(self):
        return "k is zero" if self.k == 0.0 else ""

    @staticmethod
    def kernel(pair, k, hole):
        return math.nan if pair.gap < hole else -k


@pytest.mark.parametrize("order", [*itertools.permutations(range(3))])
def test_a_scene_knows_all_forces_of_a_class_in_any_order(order):
    three = [Pull(1e-15), Pull(2e-15), Pull(3e-15)]
    forces = [three[each] for each in order]
    pieces = laws_of(forces, Fluid())
    assert list(pieces.used.values()) == forces
    assert list(pieces.used) == ["Pull", "Pull (2)", "Pull (3)"]


def test_those_left_out_are_known_by_their_places_too():
    pieces = laws_of([Pull(0.0), Pull(1e-15), Gravity(), Pull(0.0)], Fluid())
    assert pieces.left_out == {"Pull": "k is zero", "Pull (3)": "k is zero"}
    assert [*pieces.used] == ["Pull (2)", "Gravity"]


@pytest.mark.parametrize("places", [(0,), (1,), (2,), (0, 2)])
def test_any_force_without_a_reach_is_refused_among_many(places):
    many = [Body(Sphere(R), (3.0 * R * k, 0.0), density=2650.0) for k in range(201)]
    forces = [Pull(far=math.inf if k in places else R) for k in range(3)]
    with pytest.raises(UsageError, match=r"Pull.* has no finite reach"):
        Swarm(many, forces)
    Swarm(many, [Pull(far=R) for _ in range(3)])


def test_a_kernel_that_cannot_be_used_is_named_by_its_place():
    with pytest.raises(KernelError, match=r"^Pull \(2\): its reach is nan"):
        laws_of([Pull(), Pull(far=math.nan)], Fluid())
    with pytest.raises(KernelError, match=r"^Pull: its reach is nan"):
        laws_of([Pull(far=math.nan), Pull()], Fluid())


@pytest.mark.parametrize("count", [1, 2, 3])
def test_forces_and_work_of_a_run_are_those_of_each(count):
    forces = [Pull(1e-15 * (k + 1)) for k in range(count)]
    run = System(APART, forces).run(1e-6, jit=False)
    found = run.forces()
    assert [*found] == force_names(forces)
    pulls = [found[name][0, 0, 0] for name in found]
    assert pulls == pytest.approx([1e-15 * (k + 1) for k in range(count)], rel=1e-3)
    work = run.energies().work
    assert [*work] == force_names(forces)
    totals = [work[name][-1] for name in work]
    assert np.array(totals) / totals[0] == pytest.approx(np.arange(1, count + 1), rel=1e-6)


def test_a_report_names_all():
    text = System(APART, [Pull(), Pull(0.0), Pull(2e-15), Contact(), Contact()]).explain()
    assert "out: Pull (2): k is zero" in text
    assert text.count("in:  Pull(") == 2 and text.count("in:  Contact(") == 2
    assert "Contact and Contact (2) both act" in text


@pytest.mark.parametrize("wrong", [0, 1, 2])
def test_the_one_that_gives_no_number_is_blamed(wrong):
    forces = [Pull(hole=1.0 if k == wrong else 0.0) for k in range(3)]
    name = force_names(forces)[wrong].replace("(", r"\(").replace(")", r"\)")
    with pytest.warns(KernelWarning, match=rf"{name}: Pull.kernel"):
        System(APART, forces).run(1e-6, jit=False, max_steps=100)
