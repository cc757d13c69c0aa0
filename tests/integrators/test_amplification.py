"""By how much motion amplifies a nudge, and what is said of the error then."""

import math

import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.forces import BodyForce, Gravity, StokesDrag
from flocsim.integrators import DormandPrince54, VelocityVerlet
from flocsim.integrators.amplification import MOST_AMPLIFIED

RATE = 300.0
"""How fast the bodies of `Saddle` fly apart [1/s]."""


class Saddle(BodyForce):
    """F = m RATE² (x, y): every difference grows as cosh(RATE t)."""

    @staticmethod
    def kernel(body):
        return body.mass * RATE * RATE * body.x, body.mass * RATE * RATE * body.y, 0.0


def pair(*, fixed=False):
    return [
        Body(Sphere(5e-6), fixed=fixed, surface_density=2.0),
        Body(Sphere(8e-6), (1e-3, 0.0), surface_density=2.0),
    ]


@pytest.mark.parametrize("integrator", [DormandPrince54(1e-11), VelocityVerlet(4e-6)])
def test_a_saddle_amplifies_a_nudge_by_its_cosh(integrator):
    system, until = System(pair(), [Saddle()], integrator), 4.0 / RATE
    found = system.run(until, record=False, amplification=True, jit=False)
    assert found.amplification == pytest.approx(math.cosh(4.0), rel=1e-3)
    assert found.amplification > MOST_AMPLIFIED
    if math.isfinite(found.error):
        assert found.error_text.endswith(
            "which is not a guarantee: the motion amplifies a perturbation 27 times"
        )
    else:
        assert found.error_text == "the method does not estimate its error"


def test_settling_amplifies_nothing_and_says_the_same_each_time():
    system = System(pair(), [Gravity(), StokesDrag()], DormandPrince54(1e-11))
    first, again = (system.run(1e-4, amplification=True, jit=False) for _ in range(2))
    assert first.amplification == again.amplification == pytest.approx(1.0, rel=1e-6)
    assert (
        first.error_text
        == f"stated error {first.error:.2g} m; the motion amplifies a perturbation 1 times"
    )


def test_the_error_is_never_described_without_the_amplification():
    found = System(pair(), [Saddle()], DormandPrince54(1e-11)).run(4.0 / RATE, jit=False)
    assert found.amplification is None
    assert found.error_text.endswith("the motion amplifies a perturbation 27 times")


def test_a_run_that_went_on_states_its_error_alone():
    found = System(pair(), [], DormandPrince54()).run(1e-5, jit=False).go_on(2e-5)
    assert found.error_text == f"stated error {found.error:.2g} m"


def test_a_companion_that_ends_early_counts_as_amplified_without_bound():
    system = System(pair(), [Saddle()], DormandPrince54(1e-11))
    end = np.zeros((2, 3))
    assert system.amplification(4.0 / RATE, end, max_steps=3, jit=False) == math.inf


def test_fixed_bodies_alone_amplify_nothing():
    found = System([pair(fixed=True)[0]], []).run(1e-6, amplification=True, jit=False)
    assert found.amplification == 0.0
