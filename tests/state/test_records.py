"""Records are read and written by name, in arrays and alone."""

import pickle

import numpy as np
import pytest

from flocsim.compiler.composer import compose
from flocsim.errors import KernelError
from flocsim.state.records import Record, copied


class Weight(Record):
    """A record for these tests."""

    mass: float  # [kg]
    pieces: int


def heavier(weight, weights):
    weight.mass += weights[1].mass
    weights[0].pieces = weight.pieces + 1
    return weight.mass


def test_elements_are_of_their_class_and_share_the_memory_of_the_array():
    rows = Weight.rows(3)
    element = rows[1]
    element.mass = 2.5
    assert isinstance(element, Weight)
    assert rows["mass"].tolist() == [0.0, 2.5, 0.0]
    assert rows[1].mass == 2.5


def test_a_record_alone_begins_with_the_values_given():
    weight = Weight.one(pieces=4)
    assert (weight.mass, weight.pieces) == (0.0, 4)


@pytest.mark.parametrize(
    "misspelt",
    [
        lambda weight: Weight.one(mas=1.0),
        lambda weight: setattr(weight, "mas", 1.0),
        lambda weight: weight.mas,
    ],
)
def test_a_misspelt_field_is_refused(misspelt):
    with pytest.raises((ValueError, AttributeError), match="mas"):
        misspelt(Weight.one())


def test_a_field_may_not_have_the_name_of_something_else_of_a_record():
    with pytest.raises(TypeError, match=r"Odd\.shape"):

        class Odd(Record):
            """A record with a name that numpy has taken."""

            shape: float


@pytest.mark.parametrize("copy", [Weight.copy, copied, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_has_memory_of_its_own(copy):
    weight = Weight.one(mass=2.0)
    other = copy(weight)
    other.mass = 3.0
    assert weight.mass == 2.0
    assert type(other) is Weight


def test_columns_become_rows():
    rows = Weight.of(np.array([0.5, 1.5]), np.array([1, 2]))
    assert rows["mass"].tolist() == [0.5, 1.5]
    assert rows["pieces"].tolist() == [1, 2]


@pytest.mark.parametrize("jit", [True, False])
def test_kernels_read_and_write_by_name_compiled_or_not(jit):
    weight, weights = Weight.one(mass=1.0, pieces=6), Weight.rows(2)
    weights[1].mass = 0.5
    assert compose(heavier, {}, jit=jit)(weight, weights) == 1.5
    assert weight.mass == 1.5
    assert weights[0].pieces == 7


def test_compiled_code_refuses_a_record_within_an_array():
    weights = Weight.rows(2)
    with pytest.raises(KernelError, match="not alone in its array: take a copy"):
        compose(heavier, {})(weights[1], weights)
