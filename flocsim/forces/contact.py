"""Viscoelastic contact law (spring and dashpot), from stiffnesses or from material constants.

At each contact point, with overlap Δ, tangential displacement ξ and M = m_i m_j/(m_i + m_j),

    N = k_n Δ + M λ_n dΔ/dt,    T = −k_t ξ − M λ_t dξ/dt,

Tang et al. (2014), eqs 7 and 8. Options are a Coulomb limit |T| ≤ µ N, and N ≥ 0 (no tension).
"""

import functools
import math
from typing import Any, NamedTuple

import attrs

from flocsim.errors import RangeError
from flocsim.fields import flag, quantity, word_or_quantity
from flocsim.forces.base import ContactForce


class ContactLaw(NamedTuple):
    """Numerical parameters of the contact law, as its kernels read them."""

    normal_stiffness: float  # k_n [N/m]; 0 where normal_modulus is given
    normal_modulus: float  # k_n over the smaller body's equivalent radius [Pa]; 0: none
    tangential_stiffness: float  # k_t [N/m]; 0 where tangential_ratio is given
    tangential_ratio: float  # k_t/k_n; 0 where tangential_stiffness is given
    damping_ratio: float  # z = λ_n/(2 √(k_n/M)), 1 is critical; 0: see normal_damping
    normal_damping: float  # λ_n [1/s]
    proportional: float  # 1: λ_t = λ_n k_t/k_n; 0: λ_t = tangential_damping
    tangential_damping: float  # λ_t [1/s]
    friction: float  # Coulomb coefficient µ; inf: no sliding
    tension: float  # 1 where the normal force may be tensile, else 0


def stiffnesses(contact, law):
    """Return (k_n, k_t) [N/m] of a contact, from constants or from the modulus and the body
    size."""
    k_n = law.normal_stiffness + law.normal_modulus * contact.smaller_radius
    return k_n, law.tangential_stiffness + law.tangential_ratio * k_n


def linear_forces(contact, law):
    """Return (normal, tangential) forces [N] of springs and dashpots without limits: eqs 7 and
    8."""
    k_n, k_t = stiffnesses(contact, law)
    # One of the two terms is zero: damping is given either as a rate or as a fraction of critical.
    critical = 2.0 * math.sqrt(k_n / contact.effective_mass)
    damping = law.normal_damping + law.damping_ratio * critical
    # "proportional": tangential and normal dashpots have the same relaxation time relative to their
    # springs, λ_t/λ_n = k_t/k_n (Tang et al. 2014, below eq. 8).
    shear_damping = law.tangential_damping + law.proportional * (k_t / k_n) * damping
    normal = k_n * contact.overlap + contact.effective_mass * damping * contact.overlap_rate
    drag = contact.effective_mass * shear_damping * contact.slip_rate
    return normal, -k_t * contact.slip - drag


def impact_exponent(damping_ratio: float) -> float:
    """Return z acos(z)/√(1 − z²) for a damping ratio z, continued analytically beyond z = 1.

    A mass with impact speed v reaches the largest overlap (v/ω0) exp(−exponent). With tension
    clipped, its coefficient of restitution is exp(−2 exponent) (Schwager and Pöschel 2007, Granular
    Matter 9, 465).
    """
    z = damping_ratio
    # The limit z → 1, where both formulas below are 0/0.
    if abs(z - 1.0) < 1e-6:
        return 1.0
    if z < 1.0:
        return z * math.acos(z) / math.sqrt(1.0 - z * z)
    # Overdamped: acos and √(1 − z²) become imaginary together.
    return z * math.acosh(z) / math.sqrt(z * z - 1.0)


@functools.cache
def damping_ratio_for(restitution: float, tension: bool) -> float:
    """Return the damping ratio z = λ_n/(2ω0) that gives two spheres this coefficient of
    restitution."""
    loss = -math.log(restitution)
    if tension:
        # Without clipping the contact lasts half a period of the damped oscillation: e =
        # exp(−πz/√(1 − z²)).
        return loss / math.hypot(math.pi, loss)
    from scipy.optimize import brentq

    # The exponent exceeds ln z, so e < 1/z² and z < e^(−1/2): a bracket for the root.
    return float(brentq(lambda z: 2.0 * impact_exponent(z) - loss, 0.0, restitution**-0.5))


def default_unless(other: str, value: Any) -> Any:
    """Return an attrs default: the value, or None where the alternative field ``other`` is
    given."""
    return attrs.Factory(
        lambda self: value if getattr(self, other) is None else None, takes_self=True
    )


REPLACED_BY = {"young": "k_n", "poisson": "k_t", "restitution": "damping_n"}
"""{material constant: the parameter of the law that it replaces}."""


@attrs.frozen
class Contact(ContactForce):
    """Linear spring and dashpot at each contact point, normal and tangential.

    Normal force k_n Δ + M λ_n dΔ/dt (repulsion), tangential force −k_t ξ − M λ_t dξ/dt, with M =
    m_i m_j/(m_i + m_j).

    Parameters
    ----------
    k_n, k_t : float
        Normal and tangential stiffness [N/m].
    damping_n : float or "critical"
        λ_n [1/s]; "critical" is 2√(k_n/M).
    damping_t : float or "proportional"
        λ_t [1/s]; "proportional" is λ_n k_t/k_n.
    friction : float or "none"
        Coulomb coefficient µ; "none": no sliding, as in the paper; 0: no tangential force.
    tension : bool
        False clips the normal force at zero; the paper's infinite contact time needs it unclipped.
    young : float, optional
        Young's modulus Y [Pa], instead of ``k_n``.
    poisson : float, optional
        Poisson's ratio ν, instead of ``k_t``.
    restitution : float, optional
        Coefficient of restitution of two spheres, instead of ``damping_n``.

    Raises
    ------
    RangeError
        If a parameter and its alternative are both given, or neither.

    Notes
    -----
    At a corner up to four vertex–edge pairs touch at once; the effective stiffness there is a
    multiple of ``k_n``.

    Source: Tang et al. (2014), eqs 7 and 8.
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
        help="coefficient of restitution e of two spheres that collide head-on, instead of "
        "`damping_n`, which then follows from it and from `tension`",
    )  # fmt: skip
    k_n: float = quantity(
        "N/m",
        above=0.0,
        default=default_unless("young", 20.0),
        shown="20.0",
        help="normal stiffness",
    )
    k_t: float = quantity(
        "N/m",
        at_least=0.0,
        default=default_unless("poisson", 2.0),
        shown="2.0",
        help="tangential stiffness",
    )
    damping_n: float | str = word_or_quantity(
        "critical", "1/s", at_least=0.0, default=default_unless("restitution", "critical"),
        shown='"critical"', help="normal damping λ_n",
    )  # fmt: skip
    damping_t: float | str = word_or_quantity(
        "proportional", "1/s", at_least=0.0, default="proportional"
    )
    friction: float | str = word_or_quantity("none", "", at_least=0.0, default="none")
    tension: bool = flag(default=True, help="whether the normal force may pull")

    def __attrs_post_init__(self):
        for name, replaced in REPLACED_BY.items():
            if (getattr(self, name) is None) == (getattr(self, replaced) is None):
                raise RangeError(f"give one of {name} and {replaced}")

    @property
    def stiffness_key(self) -> tuple[str, str]:
        """Name and unit of the parameter to which the stiffness is proportional."""
        return ("k_n", "N/m") if self.young is None else ("young", "Pa")

    @property
    def law(self) -> ContactLaw:
        """Parameters that the kernels read."""
        # Zero friction removes the whole tangential law, springs and dashpots.
        sheared = self.friction != 0.0
        # k_t/k_n of an isotropic elastic lattice (Wang and Mora 2008).
        ratio = 0.0 if self.poisson is None else (1.0 - 3.0 * self.poisson) / (1.0 + self.poisson)
        k_t, ratio = (self.k_t or 0.0, ratio) if sheared else (0.0, 0.0)
        damping_ratio, normal_damping = 0.0, 0.0  # of these one alone is above zero
        if self.restitution is not None:
            damping_ratio = damping_ratio_for(self.restitution, self.tension)
        elif self.damping_n == "critical":
            damping_ratio = 1.0
        else:
            normal_damping = float(self.damping_n)
        proportional = sheared and self.damping_t == "proportional"
        tangential_damping = 0.0 if proportional or not sheared else float(self.damping_t)
        # Friction limits springs and dashpots; without either there is nothing to limit.
        limited = self.friction != "none" and max(k_t, ratio, tangential_damping) > 0.0
        # Per unit equivalent radius k_n = π Y r_eq/2 is 0.5 π Y (see the help text of ``young``).
        return ContactLaw(
            self.k_n or 0.0, 0.5 * math.pi * (self.young or 0.0), k_t, ratio, damping_ratio,
            normal_damping, float(proportional), tangential_damping,
            float(self.friction) if limited else math.inf, float(self.tension),
        )  # fmt: skip

    @property
    def goes_on_apart(self) -> bool:
        """True for springs and dashpots, which are linear; a subclass with its own kernel may not
        be."""
        return type(self).kernel is Contact.kernel

    @property
    def slides(self) -> bool:
        """True if friction limits ξ, or a subclass defines its own limit."""
        # Without a spring there is no displacement to limit: friction then clips the dashpot alone.
        own, law = type(self).slip_limit is not Contact.slip_limit, self.law
        springs = max(law.tangential_stiffness, law.tangential_ratio) > 0.0
        return own or (law.friction < math.inf and springs)

    @property
    def has_events(self) -> bool:
        """True if the normal or the tangential force is clipped."""
        return not self.tension or self.law.friction < math.inf

    @staticmethod
    def kernel(contact, law):
        """Return (normal, tangential) forces [N]."""
        normal, tangential = linear_forces(contact, law)
        if law.tension == 0.0:
            normal = max(normal, 0.0)
        if law.friction < math.inf:
            # Coulomb: |T| ≤ µ N, with N as transmitted, dashpot included.
            hold = law.friction * max(normal, 0.0)
            tangential = min(max(tangential, -hold), hold)
        return normal, tangential

    @staticmethod
    def events(contact, law):
        """Return two event functions [N]: the normal force, and the friction reserve µN − |T|.

        Tension begins where the first vanishes, sliding where the second does.
        """
        normal, tangential = linear_forces(contact, law)
        if law.friction == math.inf:
            return normal, 1.0
        return normal, law.friction * max(normal, 0.0) - abs(tangential)

    @staticmethod
    def slip_limit(contact, law):
        """Return the elastic displacement µ k_n Δ/k_t at which the spring reaches the Coulomb limit
        [m]."""
        k_n, k_t = stiffnesses(contact, law)
        if law.friction == math.inf or k_t == 0.0:
            return math.inf
        return law.friction * k_n * max(contact.overlap, 0.0) / k_t
