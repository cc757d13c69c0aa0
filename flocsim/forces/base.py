"""The kinds of force that a scene may contain, as abstract classes.

A force is a frozen attrs class around one plain kernel. The kernel is a static method on scalars.
Its first argument is a view of a body, a pair of bodies or a contact (flocsim.state.views). Its
other arguments are named after fields or properties of the force, or of the fluid (``viscosity``,
``density``, ``flow``), and receive their values. A kernel captures no variables and allocates no
memory, so that it runs uncompiled for debugging and compiled at the speed of hand-written code. New
parameter values never recompile it.
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
    """Base class of all forces.

    Notes
    -----
    Subclass one of its kinds (BodyForce, CentreForce, SurfaceForce, OutlineForce, OrientedForce or
    ContactForce), decorate the class with ``attrs.frozen``, and give it a static method ``kernel``:
    a plain function of a view of the bodies and of parameters named after fields of the force or of
    the fluid.
    """

    @staticmethod
    @abstractmethod
    def kernel(view):
        """Return the force, pressure or energy; each kind states units and shape."""

    @property
    def acts_on(self) -> str:
        """Where the force acts; "" for what is evaluated otherwise than by a kernel."""
        return ""

    def kernel_in(self, fluid: Fluid) -> Callable:
        """Return the kernel to use in a fluid; a subclass may choose a cheaper one for some fluids.

        Parameters
        ----------
        fluid : Fluid

        Returns
        -------
        callable
        """
        return self.kernel

    def remarks(self, fluid: Fluid) -> list[str]:
        """Return short remarks on this force in a fluid, for System.explain().

        Parameters
        ----------
        fluid : Fluid

        Returns
        -------
        list of str
        """
        return []

    @property
    def absent(self) -> str:
        """Reason why a scene can leave this force out, e.g. "hamaker is zero"; "" where it
        cannot."""
        return ""


@attrs.frozen
class BodyForce(Force):
    """A force on each body independently of all others.

    Notes
    -----
    ``kernel(body, …) → (fx, fy, torque)`` [N, N, N m], torque about the centroid; ``body`` is a
    BodyView.
    """

    acts_on = "bodies"


@attrs.frozen
class PairForce(Force):
    """A force between two bodies.

    Notes
    -----
    ``kernel(pair, …) → repulsion`` [N], positive where it pushes the bodies apart. A class may
    supply a static method ``slope(pair, …)``, the derivative of the repulsion with respect to the
    gap [N/m], for the implicit integrators; otherwise they use central differences of the kernel.
    """

    # A class attribute and no field: a kernel, not a parameter that a user sets.
    slope: ClassVar[Any] = None

    @property
    @abstractmethod
    def acts_on(self) -> str:
        """Where the force acts.

        "centres" (along the line of centres), "surfaces" (at the nearest points of the outlines),
        "outlines" (along both outlines) or "orientations" (depends on both angles).
        """

    @property
    def reach(self) -> float:
        """Gap [m] beyond which the force is taken as zero and its kernel is not called."""
        # Any finite default would make a force jump to zero there.
        return np.inf


@attrs.frozen
class CentreForce(PairForce):
    """A force along the line of centres, as a function of the gap between equivalent spheres.

    Notes
    -----
    ``kernel(pair, …) → repulsion`` [N], positive where it pushes the bodies apart; ``pair`` is a
    PairView. The force exerts no torque. For ``slope`` and ``reach`` see PairForce.
    """

    acts_on = "centres"


@attrs.frozen
class SurfaceForce(PairForce):
    """A force at the nearest points of two outlines, as a function of their smooth gap.

    Notes
    -----
    ``kernel(pair, …) → repulsion`` [N], positive where it pushes the bodies apart; ``pair`` is a
    PairView. The smooth gap is a soft minimum over all vertex–edge pairs
    (integrators/rhs/surface_gap.py). For ``slope`` and ``reach`` see PairForce.
    """

    acts_on = "surfaces"


@attrs.frozen
class OutlineForce(PairForce):
    """A PairForce distributed along two outlines: ``kernel(point, …) → pressure`` [Pa].

    ``point`` is an OutlineView. The kernel returns the pressure between two parallel plates
    ``point.gap`` apart, positive in repulsion. It is integrated over the outline of the smaller
    body.

    Parameters
    ----------
    depth : float or "sphere"
        Extent of the bodies in the third direction [m]; "sphere" is 4/3 r_eq of the smaller body.
    """

    # By keyword alone: a subclass can then declare fields without defaults.
    depth: float | str = word_or_quantity("sphere", "m", above=0.0, default="sphere", kw_only=True)

    acts_on = "outlines"


@attrs.frozen
class OrientedForce(PairForce):
    """A PairForce derived from an energy of distance and orientations: ``kernel(pair, …) → energy``
    [J].

    ``pair`` is an OrientedView.

    Notes
    -----
    Forces and torques are minus the derivatives of the energy U, by finite differences: −∂U/∂d
    along the line of centres, (∂U/∂α_i + ∂U/∂α_j)/d across it, and torques −∂U/∂α_i and −∂U/∂α_j.
    Momentum, angular momentum and energy are therefore conserved. U must be smooth, have period 2π
    in both angles, and have decayed to zero at ``reach``.
    """

    acts_on = "orientations"


@attrs.frozen
class ContactForce(Force):
    """A force at each contact point: ``kernel(contact, …) → (normal, tangential)`` [N].

    ``contact`` is a ContactView. The normal force is positive in repulsion. The tangential force
    acts along the direction in which ``slip`` grows, so a spring returns −k·slip.

    Notes
    -----
    A class may supply two more static methods. ``slip_limit(contact, …)`` [m] returns the largest
    elastic displacement that friction allows. ``events(contact, …) → (number, …)``, in any unit,
    returns functions that change sign at kinks of the law (a clipped force, a threshold); steps
    with error control end at these sign changes.

    ``contact.overlap`` is never negative: where a trial step leads beyond the end of a contact, it
    is 0. With ``goes_on_apart = True`` the kernel receives negative overlaps as well, for a law
    that continues smoothly there.
    """

    acts_on = "contacts"

    # None: no friction limit, and no kinks in the law.
    slip_limit: ClassVar[Any] = None
    events: ClassVar[Any] = None

    @property
    def goes_on_apart(self) -> bool:
        """True if the law extends to negative overlaps without a kink at 0."""
        return False

    @property
    def slides(self) -> bool:
        """True if the tangential displacement is limited with these parameters."""
        return self.slip_limit is not None

    @property
    def has_events(self) -> bool:
        """True if the law has kinks with these parameters."""
        return self.events is not None


def unique_names(names: Iterable[str]) -> list[str]:
    """Return the names in the same order, repeated ones numbered: "Pull", "Pull (2)", "Pull
    (3)"."""
    unique: list[str] = []
    counts: dict[str, int] = {}
    for name in names:
        counts[name] = counts.get(name, 0) + 1
        # The first of a name is not numbered.
        unique.append(name if counts[name] == 1 else f"{name} ({counts[name]})")
    return unique


def force_names(forces: Sequence[Any]) -> list[str]:
    """Return a unique name for each force of a scene: its class, numbered where it repeats."""
    return unique_names(type(force).__name__ for force in forces)
