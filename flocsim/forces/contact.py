"""Visco-elastic contact: its law, and springs and dashpots from what is measured of a material."""

import functools
import math
from typing import Any, NamedTuple

import attrs

from flocsim.errors import RangeError
from flocsim.fields import flag, quantity, word_or_quantity
from flocsim.forces.base import ContactForce


class ContactLaw(NamedTuple):
    """The numbers of a Contact's law, as its kernels read them."""

    normal_stiffness: float  # k_n [N/m]; 0 where the next one is given
    normal_modulus: float  # k_n over the equivalent radius of the smaller body [Pa]
    tangential_stiffness: float  # k_t [N/m]; 0 where the next one is given
    tangential_ratio: float  # k_t over k_n
    damping_ratio: float  # z = λ_n/(2 √(k_n/M)); 0 where the next one is given
    normal_damping: float  # λ_n [1/s]
    proportional: float  # 1 where λ_t = λ_n k_t/k_n, 0 where it is the next one
    tangential_damping: float  # λ_t [1/s]
    friction: float  # µ; inf where nothing slides
    tension: float  # 1 where the normal force may pull, 0 where it may not


def stiffnesses(contact, law):
    """(k_n, k_t) [N/m] of a contact: as given, or from the modulus and the smaller body's size."""
    k_n = law.normal_stiffness + law.normal_modulus * contact.smaller_radius
    return k_n, law.tangential_stiffness + law.tangential_ratio * k_n


def unclipped(contact, law):
    """(normal, tangential) force of springs and dashpots alone [N]: eqs 7 and 8."""
    k_n, k_t = stiffnesses(contact, law)
    critical = 2.0 * math.sqrt(k_n / contact.effective_mass)
    damping = law.normal_damping + law.damping_ratio * critical
    shear_damping = law.tangential_damping + law.proportional * (k_t / k_n) * damping
    normal = k_n * contact.overlap + contact.effective_mass * damping * contact.overlap_rate
    drag = contact.effective_mass * shear_damping * contact.slip_rate
    return normal, -k_t * contact.slip - drag


def impact_exponent(damping_ratio: float) -> float:
    """Return z acos(z)/√(1 − z²) of a damping ratio z, continued beyond z = 1.

    A mass of speed v gets v/ω0 times exp(−that) deep; clipped at tension, it leaves with a
    restitution of exp(−2 that) (Schwager and Pöschel 2007, Granular Matter 9, 465).
    """
    z = damping_ratio
    if abs(z - 1.0) < 1e-6:
        return 1.0
    if z < 1.0:
        return z * math.acos(z) / math.sqrt(1.0 - z * z)
    return z * math.acosh(z) / math.sqrt(z * z - 1.0)


@functools.cache
def damping_ratio_for(restitution: float, tension: bool) -> float:
    """Return the damping ratio z = λ_n/(2ω0) at which two spheres part with this restitution."""
    loss = -math.log(restitution)
    if tension:
        # e = exp(−πz/√(1 − z²)): a contact that pulls lasts half a damped vibration.
        return loss / math.hypot(math.pi, loss)
    from scipy.optimize import brentq

    # The exponent exceeds ln z, so that z is below 1/√e.
    return float(brentq(lambda z: 2.0 * impact_exponent(z) - loss, 0.0, restitution**-0.5))


def unless(other: str, value: Any) -> Any:
    """A default: the value, or None where the field ``other``, which replaces it, is given."""
    return attrs.Factory(
        lambda self: value if getattr(self, other) is None else None, takes_self=True
    )


INSTEAD = {"young": "k_n", "poisson": "k_t", "restitution": "damping_n"}
"""Parameter of a material → the parameter of the law that follows from it."""


@attrs.frozen
class Contact(ContactForce):
    """Spring and dashpot at each contact point, normal and tangential.

    Normal k_n Δ + M λ_n dΔ/dt (repulsion), tangential −k_t ξ − M λ_t dξ/dt, with
    M = m_i m_j/(m_i + m_j). Parameters: ``k_n``, ``k_t`` [N/m]; ``damping_n`` λ_n [1/s] or
    "critical" = 2√(k_n/M); ``damping_t`` λ_t [1/s] or "proportional" = λ_n k_t/k_n; ``friction``
    µ (inf: no sliding, as in the paper; 0: no tangential force at all); ``tension``: False clips
    the normal force at zero (the paper's infinite contact time needs it unclipped). Or, instead of
    k_n, k_t and damping_n, what is measured of a material: ``young`` Y [Pa], ``poisson`` ν and the
    coefficient of ``restitution``.

    At a corner up to four vertex–edge pairs touch at once, so that the effective stiffness there
    is a multiple of ``k_n``.  Source: Tang et al. (2014), eqs 7 and 8.
    """

    young: float | None = quantity(
        "Pa", above=0.0, default=None, kw_only=True,
        help="Young's modulus Y, instead of `k_n`: k_n = Y A_p/L = π Y r_eq/2 of the smaller body "
        "of a pair, with L = 2 r_eq and A_p = π r_eq²",
    )  # fmt: skip
    poisson: float | None = quantity(
        "", at_least=0.0, below=1.0 / 3.0, default=None, kw_only=True,
        help="Poisson's ratio ν, instead of `k_t`: k_t = k_n (1 − 3ν)/(1 + ν), which is 0 at "
        "ν = 1/3 and k_n at 0 (Wang and Mora 2008)",
    )  # fmt: skip
    restitution: float | None = quantity(
        "", above=0.0, at_most=1.0, default=None, kw_only=True,
        help="coefficient of restitution e of two spheres that meet head-on, instead of "
        "`damping_n`, which follows from it with `tension` or without",
    )  # fmt: skip
    k_n: float = quantity(
        "N/m", above=0.0, default=unless("young", 20.0), shown="20.0", help="normal stiffness"
    )
    k_t: float = quantity(
        "N/m",
        at_least=0.0,
        default=unless("poisson", 2.0),
        shown="2.0",
        help="tangential stiffness",
    )
    damping_n: float | str = word_or_quantity(
        "critical", "1/s", at_least=0.0, default=unless("restitution", "critical"),
        shown='"critical"', help="normal damping λ_n",
    )  # fmt: skip
    damping_t: float | str = word_or_quantity(
        "proportional", "1/s", at_least=0.0, default="proportional"
    )
    friction: float | str = word_or_quantity("none", "", at_least=0.0, default="none")
    tension: bool = flag(default=True, help="false: the normal force never pulls")

    def __attrs_post_init__(self):
        for name, replaced in INSTEAD.items():
            if (getattr(self, name) is None) == (getattr(self, replaced) is None):
                raise RangeError(f"give either {name} or {replaced}, not both")

    @property
    def stiffness_key(self) -> tuple[str, str]:
        """The parameter that the stiffness is proportional to, and its unit."""
        return ("k_n", "N/m") if self.young is None else ("young", "Pa")

    @property
    def law(self) -> ContactLaw:
        """Return the numbers that the kernels read; friction = 0 leaves nothing tangential."""
        sheared = self.friction != 0.0
        ratio = 0.0 if self.poisson is None else (1.0 - 3.0 * self.poisson) / (1.0 + self.poisson)
        k_t, ratio = (self.k_t or 0.0, ratio) if sheared else (0.0, 0.0)
        damping_ratio, normal_damping = 0.0, 0.0
        if self.restitution is not None:
            damping_ratio = damping_ratio_for(self.restitution, self.tension)
        elif self.damping_n == "critical":
            damping_ratio = 1.0
        else:
            normal_damping = self.damping_n
        proportional = sheared and self.damping_t == "proportional"
        tangential_damping = 0.0 if proportional or not sheared else float(self.damping_t)
        # Friction limits springs and dashpots; without either there is nothing to limit.
        limited = self.friction != "none" and max(k_t, ratio, tangential_damping) > 0.0
        return ContactLaw(
            self.k_n or 0.0, 0.5 * math.pi * (self.young or 0.0), k_t, ratio, damping_ratio,
            normal_damping, float(proportional), tangential_damping,
            float(self.friction) if limited else math.inf, float(self.tension),
        )  # fmt: skip

    @property
    def goes_on_apart(self) -> bool:
        """Springs and dashpots do; the kernel of a subclass may not."""
        return type(self).kernel is Contact.kernel

    @property
    def slides(self) -> bool:
        """Whether friction limits ξ, or a subclass with a limit of its own."""
        own, law = type(self).slip_limit is not Contact.slip_limit, self.law
        springs = max(law.tangential_stiffness, law.tangential_ratio) > 0.0
        return own or (law.friction < math.inf and springs)

    @property
    def has_events(self) -> bool:
        """Whether anything is clipped."""
        return not self.tension or self.law.friction < math.inf

    @staticmethod
    def kernel(contact, law):
        """(normal, tangential) force [N]."""
        normal, tangential = unclipped(contact, law)
        if law.tension == 0.0:
            normal = max(normal, 0.0)
        if law.friction < math.inf:
            hold = law.friction * max(normal, 0.0)
            tangential = min(max(tangential, -hold), hold)
        return normal, tangential

    @staticmethod
    def events(contact, law):
        """(the normal force, which begins to pull where it is 0; how much more friction could hold,
        which begins to slide) [N]."""
        normal, tangential = unclipped(contact, law)
        if law.friction == math.inf:
            return normal, 1.0
        return normal, law.friction * max(normal, 0.0) - abs(tangential)

    @staticmethod
    def slip_limit(contact, law):
        """The elastic displacement µ k_n Δ/k_t that friction can hold [m]."""
        k_n, k_t = stiffnesses(contact, law)
        if law.friction == math.inf or k_t == 0.0:
            return math.inf
        return law.friction * k_n * max(contact.overlap, 0.0) / k_t
