"""Body, Fluid, and the tuples of scalars and arrays that kernels see."""

import math
from typing import NamedTuple

import attrs
import numpy as np

from flocsim.constants import WATER_DENSITY, WATER_VISCOSITY
from flocsim.errors import UsageError
from flocsim.fields import flag, is_number, quantity
from flocsim.geometry.shape import Shape
from flocsim.layout import NOW, TALLY_SIZE


class BodyView(NamedTuple):
    """One body, as a BodyForce kernel sees it. SI units; angle and spin counter-clockwise."""

    time: float
    x: float
    y: float
    angle: float
    vx: float
    vy: float
    spin: float
    mass: float
    buoyant_mass: float
    inertia: float
    radius: float


class PairView(NamedTuple):
    """Two bodies, as a CentreForce or SurfaceForce kernel sees them.

    ``gap`` [m] is d_c − r_i − r_j for a CentreForce, the distance between the outlines for a
    SurfaceForce; ``gap_rate`` [m/s] its rate of change; radii are equivalent radii.
    """

    time: float
    gap: float
    gap_rate: float
    centre_distance: float
    radius_i: float
    radius_j: float
    reduced_radius: float
    effective_mass: float


class ContactView(NamedTuple):
    """One contact point, as a ContactForce kernel sees it.

    ``overlap`` [m] > 0 and its rate; ``slip`` [m] the tangential elastic displacement ξ and its
    rate; ``effective_mass`` M = m_i m_j/(m_i + m_j) [kg] of the pair.
    """

    overlap: float
    overlap_rate: float
    slip: float
    slip_rate: float
    effective_mass: float
    radius_i: float
    radius_j: float


class Scene(NamedTuple):
    """What does not change in a run: n bodies, all their core points, the forces' numbers.

    ``bodies`` (n, 7) has the columns below; core points of body b are rows ``first[b]`` to
    ``first[b + 1]`` of ``vertices``. Few arrays, because every array that a compiled function is
    handed costs compile time in all of its callers.
    """

    bodies: np.ndarray
    first: np.ndarray
    vertices: np.ndarray
    parameters: np.ndarray


def read_vector(name, length, unit):
    """An attrs converter: ``length`` finite numbers as a tuple of floats."""

    def convert(values):
        try:
            numbers = tuple(float(value) for value in values)
        except (TypeError, ValueError):
            numbers = ()
        if len(numbers) != length or not all(math.isfinite(number) for number in numbers):
            raise UsageError(f"{name} must be {length} finite numbers [{unit}], found {values!r}")
        return numbers

    return convert


@attrs.frozen(eq=False)
class Fluid:
    """The water around the bodies, with an optional linear background flow.

    u(x) = velocity + gradient · x, Ω = ½ (∂u_y/∂x − ∂u_x/∂y); still by default.
    ``gradient`` = (∂u_x/∂x, ∂u_x/∂y, ∂u_y/∂x, ∂u_y/∂y) [1/s].
    """

    viscosity: float = quantity("Pa s", above=0.0, default=WATER_VISCOSITY, help="γ")
    density: float = quantity("kg/m^3", at_least=0.0, default=WATER_DENSITY, help="ρ_f")
    buoyancy: bool = flag(default=False, help="subtract the displaced fluid's weight")
    velocity: tuple = attrs.field(
        default=(0.0, 0.0), converter=read_vector("velocity", 2, "m/s"), metadata={"vector": 2}
    )
    gradient: tuple = attrs.field(
        default=(0.0, 0.0, 0.0, 0.0),
        converter=read_vector("gradient", 4, "1/s"),
        metadata={"vector": 4},
    )

    @property
    def flow(self):
        """Velocity and gradient as the parameters (u_x, u_y, g_xx, g_xy, g_yx, g_yy)."""
        return (*self.velocity, *self.gradient)


def check_shape(instance, attribute, value):
    """attrs validator: the body's shape is a Shape."""
    if not isinstance(value, Shape):
        raise UsageError(f"shape must be a Sphere or a SpheroPolygon, found {value!r}")


def check_positive_or_none(instance, attribute, value):
    """attrs validator: None, or a finite number above zero."""
    if value is not None and not (is_number(value) and value > 0.0):
        raise UsageError(f"{attribute.name} must be a finite number above 0, found {value!r}")


def check_depth(instance, attribute, value):
    """attrs validator: a depth is "sphere" or a length above zero."""
    if value != "sphere":
        check_positive_or_none(instance, attribute, value)


@attrs.frozen(eq=False)
class Body:
    """A rigid shape with a mass, a place and a motion.

    Mass m = ρ_s A and inertia I = ρ_s J, with ρ_s [kg/m²] either ``surface_density`` or
    ``density`` · ``depth``; depth is a length [m] or "sphere" = 4/3 r_eq (then m is the mass of the
    equivalent solid sphere). ``fixed`` bodies do not move.
    """

    shape: Shape = attrs.field(validator=check_shape)
    position: tuple = attrs.field(default=(0.0, 0.0), converter=read_vector("position", 2, "m"))
    angle: float = quantity("rad", default=0.0)
    velocity: tuple = attrs.field(default=(0.0, 0.0), converter=read_vector("velocity", 2, "m/s"))
    spin: float = quantity("rad/s", default=0.0)
    surface_density: float = attrs.field(
        default=None, kw_only=True, validator=check_positive_or_none
    )
    density: float = attrs.field(default=None, kw_only=True, validator=check_positive_or_none)
    depth: float = attrs.field(default="sphere", kw_only=True, validator=check_depth)
    fixed: bool = flag(default=False)

    def __attrs_post_init__(self):
        if (self.surface_density is None) == (self.density is None):
            raise UsageError(
                "a body needs either surface_density [kg/m^2] or density [kg/m^3], not both: "
                f"found surface_density={self.surface_density}, density={self.density}"
            )

    @property
    def areal_density(self):
        """ρ_s [kg/m²]."""
        if self.surface_density is not None:
            return self.surface_density
        if self.depth == "sphere":
            return self.density * 4.0 / 3.0 * self.shape.equivalent_radius
        return self.density * self.depth

    @property
    def mass(self):
        """m = ρ_s A [kg]."""
        return self.areal_density * self.shape.area

    @property
    def inertia(self):
        """I = ρ_s J [kg m²]."""
        return self.areal_density * self.shape.second_moment

    def buoyant_mass(self, fluid):
        """m (1 − ρ_f/ρ) [kg] with buoyancy on, else m; UsageError where ρ is not known."""
        if not fluid.buoyancy:
            return self.mass
        if self.density is None:
            raise UsageError(
                "buoyancy needs the bodies' density [kg/m^3], but only surface_density is given: "
                "set bodies.density and bodies.depth, or fluid.buoyancy = false"
            )
        return self.mass * (1.0 - fluid.density / self.density)


def scene_of(bodies, fluid, parameters):
    """The bodies as one Scene of fresh arrays; ``parameters`` are the forces' numbers."""
    shapes = [body.shape for body in bodies]
    sizes = [len(shape.vertices) for shape in shapes]

    columns = (
        [body.mass for body in bodies],
        [body.buoyant_mass(fluid) for body in bodies],
        [body.inertia for body in bodies],
        [0.0 if body.fixed else 1.0 for body in bodies],
        [shape.equivalent_radius for shape in shapes],
        [shape.bounding_radius for shape in shapes],
        [shape.radius for shape in shapes],
    )
    return Scene(
        bodies=np.ascontiguousarray(np.array(columns, dtype=float).T),
        first=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        vertices=np.concatenate([np.array(shape.vertices) for shape in shapes]),
        parameters=np.array(parameters, dtype=float),
    )


class Work(NamedTuple):
    """What changes in a run, and the scratch space of the drivers; all arrays are reused.

    ``motion`` (4, n, 6): states NOW, NEW, FULL, HALF of x, y, angle, vx, vy, spin.
    ``slip`` (4, capacity): tangential displacements of the listed pairs in these states.
    ``bodies`` (n, 8): force and torque, place at the last listing, cosine and sine of the angle.
    ``system`` (2, 3n, 3n + 1): linear systems BASE and NEWTON, the load in the last column.
    ``candidates`` (capacity, 6): body of the vertex, its core point, body of the edge, first and
    last core point of the edge, 1 where the contact acts in this step.
    ``geometry`` (capacity, 7): see flocsim.geometry.contacts.  ``kept`` (capacity, 3): point, edge
    and displacement of pairs while the list is made anew.  ``budget`` (n (n − 1)/2,): motion after
    which it must be.  ``placed`` (V, 2): core points at the listing.  ``tally``: see flocsim.layout.
    """

    motion: np.ndarray
    slip: np.ndarray
    bodies: np.ndarray
    system: np.ndarray
    candidates: np.ndarray
    geometry: np.ndarray
    kept: np.ndarray
    budget: np.ndarray
    placed: np.ndarray
    tally: np.ndarray


def work_of(scene, position, velocity, capacity=256):
    """Work arrays for a scene at the given position and velocity (n, 3), no contact yet."""
    n = len(scene.bodies)
    motion = np.zeros((4, n, 6))
    motion[NOW] = np.hstack([position, velocity])
    return Work(
        motion=motion,
        slip=np.zeros((4, capacity)),
        bodies=np.zeros((n, 8)),
        system=np.zeros((2, 3 * n, 3 * n + 1)),
        candidates=np.zeros((capacity, 6), dtype=np.int64),
        geometry=np.zeros((capacity, 7)),
        kept=np.zeros((capacity, 3)),
        budget=np.full(n * (n - 1) // 2, -1.0),
        placed=np.zeros_like(scene.vertices),
        tally=np.zeros(TALLY_SIZE, dtype=np.int64),
    )


def with_capacity(work, capacity):
    """The same work arrays with room for more contact candidates."""

    def grown(array, axis):
        shape = list(array.shape)
        shape[axis] = capacity
        larger = np.zeros(shape, dtype=array.dtype)
        larger[tuple(slice(size) for size in array.shape)] = array
        return larger

    return work._replace(
        slip=grown(work.slip, 1),
        candidates=grown(work.candidates, 0),
        geometry=grown(work.geometry, 0),
        kept=grown(work.kept, 0),
    )
