"""The kinds of force. A force is a frozen attrs class around one plain kernel.

The kernel is a static method on scalars: its first argument is the view of a body, a pair or a
contact (flocsim.state.views), the others are the names of its own fields and properties, or of the
fluid's (``viscosity``, ``density``, ``flow``). It captures nothing and allocates nothing, so that
it runs uncompiled for debugging and compiled at the speed of hand-written code. New parameter
values never recompile.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from typing import Any, ClassVar

import attrs
import numpy as np

from flocsim.body import Fluid
from flocsim.fields import word_or_quantity


@attrs.frozen
class Force(ABC):
    """What all forces share; subclass one of its kinds, BodyForce, CentreForce, SurfaceForce,
    OutlineForce, OrientedForce or ContactForce, and give it a static method ``kernel``, its law."""

    @staticmethod
    @abstractmethod
    def kernel(view):
        """The law itself; each kind says what it returns."""

    def kernel_in(self, fluid: Fluid) -> Callable:
        """The kernel to use in this fluid; a subclass may have a cheaper one for some fluids."""
        return self.kernel

    def remarks(self, fluid: Fluid) -> list[str]:
        """What System.explain() says of it in this fluid besides, in a few words each."""
        return []

    @property
    def absent(self) -> str:
        """Why a scene can leave this force out ("" where it cannot), e.g. a zero strength."""
        return ""


@attrs.frozen
class BodyForce(Force):
    """A force on each body by itself: ``kernel(body, …) → (fx, fy, torque)`` [N, N, N m]."""


@attrs.frozen
class PairForce(Force):
    """A force between two bodies: ``kernel(pair, …) → repulsion`` [N], positive pushes apart.

    A class may supply ``slope(pair, …)``, the derivative of the repulsion by the gap [N/m], for
    the implicit integrators; without it they take differences of the kernel.
    """

    slope: ClassVar[Any] = None

    @property
    @abstractmethod
    def acts_on(self) -> str:
        """ "centres" (along the line of centres), "surfaces" (at the nearest points of the
        outlines), "outlines" (all along them) or "orientations" (as both are turned)."""

    @property
    def reach(self) -> float:
        """The gap [m] beyond which the force is left out, and not even called."""
        return np.inf


@attrs.frozen
class CentreForce(PairForce):
    """A PairForce along the line of centres, of the gap between the equivalent spheres: without
    torque."""

    acts_on = "centres"


@attrs.frozen
class SurfaceForce(PairForce):
    """A PairForce between the two outlines, of the smooth gap between them (surface_gap.py)."""

    acts_on = "surfaces"


@attrs.frozen
class OutlineForce(PairForce):
    """A PairForce all along the two outlines: ``kernel(point, …) → pressure`` [Pa].

    ``point`` is an OutlineView, and the pressure that of two plates which are ``point.gap`` apart,
    above 0 where it pushes them apart. It is summed over the outline of the smaller body, times the
    ``depth`` of the bodies along the third direction [m] ("sphere": 4/3 r_eq of the smaller).
    """

    depth: float | str = word_or_quantity("sphere", "m", above=0.0, default="sphere", kw_only=True)

    acts_on = "outlines"


@attrs.frozen
class OrientedForce(PairForce):
    """A PairForce of the distance of two bodies and of how both are turned:
    ``kernel(pair, …) → energy`` [J].

    ``pair`` is an OrientedView. Force and torques are minus the derivatives of the energy U, by
    differences: F = −∂U/∂d along the line of centres, (∂U/∂α_i + ∂U/∂α_j)/d across it, and torques
    −∂U/∂α, so that momentum, angular momentum and energy are kept. U must be smooth, of period 2π
    in both angles, and have faded at ``reach``.
    """

    acts_on = "orientations"


@attrs.frozen
class ContactForce(Force):
    """A force at each contact point: ``kernel(contact, …) → (normal, tangential)`` [N].

    The normal force is positive in repulsion; the tangential force acts along the direction in
    which ``slip`` grows, so that a spring returns −k·slip. A class may supply
    ``slip_limit(contact, …)`` [m]: the largest elastic displacement that the contact can hold; and
    ``events(contact, …) → (number, …)``, of any unit: each changes its sign at a kink of the law
    (a clip, a threshold), and steps of controlled error end there.

    ``contact.overlap`` is never below 0: where a step is tried beyond the end of a contact, it is
    0. ``goes_on_apart = True`` hands negative overlaps over, to a law that goes on smoothly there.
    """

    slip_limit: ClassVar[Any] = None
    events: ClassVar[Any] = None

    @property
    def goes_on_apart(self) -> bool:
        """Whether the law is one for negative overlaps, too, without a kink at 0."""
        return False

    @property
    def slides(self) -> bool:
        """Whether its displacements have a limit with these parameters."""
        return self.slip_limit is not None

    @property
    def has_events(self) -> bool:
        """Whether the law has kinks with these parameters."""
        return self.events is not None


def told_apart(names: Iterable[str]) -> list[str]:
    """The names in their order, each once: "Pull", "Pull (2)", "Pull (3)"."""
    found: list[str] = []
    counts: dict[str, int] = {}
    for name in names:
        counts[name] = counts.get(name, 0) + 1
        found.append(name if counts[name] == 1 else f"{name} ({counts[name]})")
    return found


def names_of(forces: Sequence[Any]) -> list[str]:
    """What the forces of a scene are called, by their classes and their places: no two alike."""
    return told_apart(type(force).__name__ for force in forces)
