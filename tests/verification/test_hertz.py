"""Textbook laws of Hertz, as a user types them, against their published impacts.

The law takes powers of the overlap with fractional exponents, which below zero are no numbers:
steps that are tried beyond the end of a contact must not hand it such overlaps.

Hertz: Landau and Lifshitz, Theory of Elasticity, §9, problem 1: an impact lasts 2.94 Δ_max/v.
With the dissipation of Tsuji et al. (1992): Antypov and Elliott, EPL 94 (2011) 50004, eq. 12: e is
the same at every speed, α = −√5 ln e/√(ln²e + π²).
"""

import math

import attrs
import pytest

from flocsim import System
from flocsim.forces import Contact, ContactForce
from flocsim.integrators import DormandPrince54, Implicit, VelocityVerlet
from tests.helpers.methods import by_setting
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import head_on

K, SPEED, GAP = 1e4, 1e-3, 1e-7
"""K [N/m^1.5]."""

LASTS = 2.0 * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)
"""2.943…: how long an impact lasts, in Δ_max/v."""

by_method = by_setting((VelocityVerlet(2e-8), 1e-3), (DormandPrince54(1e-14), 1e-5),
                       (Implicit(1e-14), 1e-5))  # fmt: skip


@attrs.frozen
class Hertz(ContactForce):
    """F = K Δ^1.5 + α √(M K) Δ^(1/4) dΔ/dt, with nothing to guard it."""

    stiffness: float = K
    alpha: float = 0.0

    @staticmethod
    def kernel(contact, stiffness, alpha):
        loss = alpha * (contact.effective_mass * stiffness) ** 0.5
        load = stiffness * contact.overlap**1.5
        return load + loss * contact.overlap**0.25 * contact.overlap_rate, 0.0


@attrs.frozen
class OnTopOfContact(Contact):
    """A subclass of flocsim's own Contact, whose law may go on below zero."""

    @staticmethod
    def kernel(contact, k_n):
        return K * contact.overlap**1.5 + 0.0 * k_n, 0.0


def impact(law, integrator):
    """(restitution, how long the impact lasted [s], Δ_max by energy [m])."""
    bodies = head_on(SPEED, GAP)
    mass = bodies[0].mass / 2.0
    deepest = (5.0 * mass * SPEED**2 / (4.0 * K)) ** 0.4
    until = GAP / SPEED + 4.0 * LASTS * deepest / SPEED
    end = System(bodies, [law], integrator).run(until=until, record=False, jit=False)
    assert end.status.name == "FINISHED"
    parting = end.velocity[-1, 1, 0] - end.velocity[-1, 0, 0]
    gap = end.position[-1, 1, 0] - end.position[-1, 0, 0] - 1e-5
    return parting / SPEED, until - gap / parting - GAP / SPEED, deepest


@by_method
@pytest.mark.parametrize(
    "law",
    rest_slow([Hertz(), OnTopOfContact()], lambda law: isinstance(law, OnTopOfContact)),
    ids=["own", "subclass of Contact"],
)
def test_the_time_of_an_elastic_impact(law, integrator, allowed):
    restitution, lasted, deepest = impact(law, integrator)
    assert restitution == pytest.approx(1.0, rel=allowed)
    assert lasted == pytest.approx(LASTS * deepest / SPEED, rel=allowed)


@by_method
@pytest.mark.parametrize("e", rest_slow([0.9, 0.6, 0.3], lambda e: e == 0.6))
def test_restitution_with_dissipation(e, integrator, allowed):
    alpha = -math.sqrt(5.0) * math.log(e) / math.hypot(math.log(e), math.pi)
    assert impact(Hertz(alpha=alpha), integrator)[0] == pytest.approx(e, rel=allowed)
