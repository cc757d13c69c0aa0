"""Visco-elastic contact."""

import math

import attrs

from flocsim.fields import flag, quantity, word_or_quantity
from flocsim.forces.base import ContactForce


def unclipped(contact, k_n, shear, critical, lambda_n, proportional, lambda_t):
    """(normal, tangential) force of springs and dashpots alone [N]."""
    damping = lambda_n + critical * 2.0 * math.sqrt(k_n / contact.effective_mass)
    shear_damping = lambda_t + proportional * damping
    normal = k_n * contact.overlap + contact.effective_mass * damping * contact.overlap_rate
    drag = contact.effective_mass * shear_damping * contact.slip_rate
    return normal, -shear * contact.slip - drag


@attrs.frozen
class Contact(ContactForce):
    """Spring and dashpot at each contact point, normal and tangential.

    Normal k_n Δ + M λ_n dΔ/dt (repulsion), tangential −k_t ξ − M λ_t dξ/dt, with
    M = m_i m_j/(m_i + m_j). Parameters: ``k_n``, ``k_t`` [N/m]; ``damping_n`` λ_n [1/s] or
    "critical" = 2√(k_n/M); ``damping_t`` λ_t [1/s] or "proportional" = λ_n k_t/k_n; ``friction``
    µ (inf: no sliding, as in the paper; 0: no tangential force at all); ``tension``: False clips
    the normal force at zero (the paper's infinite contact time needs it unclipped).

    At a corner up to four vertex–edge pairs touch at once, so that the effective stiffness there
    is a multiple of ``k_n``.  Source: Tang et al. (2014), eqs 7 and 8.
    """

    k_n: float = quantity("N/m", above=0.0, default=20.0)
    k_t: float = quantity("N/m", at_least=0.0, default=2.0)
    damping_n: float | str = word_or_quantity("critical", "1/s", at_least=0.0, default="critical")
    damping_t: float | str = word_or_quantity(
        "proportional", "1/s", at_least=0.0, default="proportional"
    )
    friction: float | str = word_or_quantity("none", "", at_least=0.0, default="none")
    tension: bool = flag(default=True, help="false: the normal force never pulls")

    @property
    def critical(self) -> float:
        """1.0 where λ_n follows from critical damping, else 0.0."""
        return float(self.damping_n == "critical")

    @property
    def lambda_n(self) -> float:
        """λ_n [1/s] where it is given, else 0."""
        return 0.0 if self.damping_n == "critical" else float(self.damping_n)

    @property
    def frictionless(self) -> bool:
        """Whether µ = 0: there is no tangential force then, and nothing of it exists."""
        return self.friction == 0.0

    @property
    def shear(self) -> float:
        """k_t [N/m], 0 without friction."""
        return 0.0 if self.frictionless else self.k_t

    @property
    def proportional(self) -> float:
        """k_t/k_n where λ_t follows λ_n, else 0."""
        return self.shear / self.k_n if self.damping_t == "proportional" else 0.0

    @property
    def lambda_t(self) -> float:
        """λ_t [1/s] where it is given, else 0."""
        given = self.damping_t != "proportional" and not self.frictionless
        return float(self.damping_t) if given else 0.0

    @property
    def friction_limit(self) -> float:
        """µ as a number: inf where nothing can slide."""
        sheared = self.shear > 0.0 or self.lambda_t > 0.0
        return float(self.friction) if self.friction != "none" and sheared else math.inf

    @property
    def goes_on_apart(self) -> bool:
        """Springs and dashpots do; the kernel of a subclass may not."""
        return type(self).kernel is Contact.kernel

    @property
    def slides(self) -> bool:
        """Whether friction limits ξ, or a subclass with a limit of its own."""
        own = type(self).slip_limit is not Contact.slip_limit
        return own or (self.friction_limit < math.inf and self.shear > 0.0)

    @property
    def has_events(self) -> bool:
        """Whether anything is clipped."""
        return not self.tension or self.friction_limit < math.inf

    @staticmethod
    def kernel(
        contact, k_n, shear, critical, lambda_n, proportional, lambda_t, friction_limit, tension
    ):
        """(normal, tangential) force [N]."""
        normal, tangential = unclipped(
            contact, k_n, shear, critical, lambda_n, proportional, lambda_t
        )
        if tension == 0.0:
            normal = max(normal, 0.0)
        if friction_limit < math.inf:
            hold = friction_limit * max(normal, 0.0)
            tangential = min(max(tangential, -hold), hold)
        return normal, tangential

    @staticmethod
    def events(contact, k_n, shear, critical, lambda_n, proportional, lambda_t, friction_limit):
        """(the normal force, which begins to pull where it is 0; how much more friction could hold,
        which begins to slide) [N]."""
        normal, tangential = unclipped(
            contact, k_n, shear, critical, lambda_n, proportional, lambda_t
        )
        if friction_limit == math.inf:
            return normal, 1.0
        return normal, friction_limit * max(normal, 0.0) - abs(tangential)

    @staticmethod
    def slip_limit(contact, k_n, shear, friction_limit):
        """The elastic displacement µ k_n Δ/k_t that friction can hold [m]."""
        if friction_limit == math.inf or shear == 0.0:
            return math.inf
        return friction_limit * k_n * max(contact.overlap, 0.0) / shear
