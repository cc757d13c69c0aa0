"""What is subclassed is no object by itself: one line says what a subclass has to give."""

import attrs
import pytest

import flocsim
from flocsim.forces import BodyForce, CentreForce, ContactForce, PairForce, SurfaceForce


@attrs.frozen
class Pull(PairForce):
    """A force between two bodies that does not say along what."""

    @staticmethod
    def kernel(pair):
        return -1.0


@pytest.mark.parametrize(
    ("abstract", "lacks"),
    [
        (flocsim.Shape, "core"),
        (flocsim.Integrator, "attempt"),
        *(
            (each, "kernel")
            for each in (flocsim.Force, BodyForce, CentreForce, SurfaceForce, ContactForce)
        ),
        (Pull, "acts_on"),
    ],
)
def test_what_is_abstract_makes_no_object(abstract, lacks):
    with pytest.raises(TypeError, match=lacks) as found:
        abstract()
    assert "\n" not in str(found.value) and abstract.__name__ in str(found.value)
