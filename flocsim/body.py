"""Body and Fluid: the objects that a user composes a scene of."""

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import attrs
import numpy as np

from flocsim import water
from flocsim.constants import (
    ROOM_TEMPERATURE,
    WATER_DENSITY,
    WATER_PERMITTIVITY,
    WATER_VISCOSITY,
)
from flocsim.errors import RangeError, UsageError
from flocsim.fields import (
    choice,
    field,
    flag,
    in_unit,
    is_number,
    number,
    only,
    quantity,
    several,
    word_or_quantity,
)
from flocsim.geometry.contact.charges import charges_of_bodies, field_of_bodies
from flocsim.geometry.contact.core_points import outlines_of
from flocsim.geometry.shapes.pieces import pieces_of_bodies
from flocsim.geometry.shapes.shape import Shape
from flocsim.hooks import LAWS
from flocsim.state.bodies import RESISTANCE_COLUMNS, UNSHIELDED, BodyConstants
from flocsim.state.scene import NO_LAYER, NO_OUTLINES, Scene

NO_LAWS = (None,) * len(LAWS)
"""``Scene.laws`` of an uncompiled scene without forces."""


def read_vector(name: str, length: int, unit: str, values: Iterable[float]) -> Any:
    """Return ``length`` finite numbers, or texts such as "5 um", as a tuple of floats.

    Raises UsageError for anything else.
    """
    try:
        listed = [] if isinstance(values, str) else list(values)
        numbers = tuple(float(in_unit(value, unit, name)) for value in listed)
    except RangeError:
        raise
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != length or not all(math.isfinite(number) for number in numbers):
        raise UsageError(f"{name} must be {length} finite numbers [{unit}], found {values!r}")
    return numbers


def read_position(values: Iterable[float]) -> tuple[float, float]:
    return read_vector("position", 2, "m", values)


def read_velocity(values: Iterable[float]) -> tuple[float, float]:
    return read_vector("velocity", 2, "m/s", values)


@attrs.frozen(eq=False)
class Fluid:
    """Water around the bodies, with an optional linear background flow.

    Parameters
    ----------
    temperature : float, optional
        Temperature [K], or a text such as "15 degC".
    salinity : float, optional
        Salinity of sea water [g/kg].
    ionic_strength : float, optional
        Ionic strength of another salt [mol/m³], instead of ``salinity``.
    viscosity : float
        γ [Pa s]; by default that of the water described, else of water at 25 °C.
    density : float
        ρ_f [kg/m³]; default as for the viscosity.
    buoyancy : bool
        Whether the weight of the displaced fluid is subtracted from a body's weight.
    velocity : (float, float)
        Velocity of the background flow at the origin [m/s].
    gradient : (float, float, float, float)
        (∂u_x/∂x, ∂u_x/∂y, ∂u_y/∂x, ∂u_y/∂y) [1/s].

    Raises
    ------
    UsageError
        If both ``salinity`` and ``ionic_strength`` are given.

    Notes
    -----
    The flow is u(x) = velocity + gradient · x, with Ω = ½ (∂u_y/∂x − ∂u_x/∂y); still by default.

    With a temperature, a salinity or an ionic strength, viscosity and density follow from it unless
    they are given (flocsim.water), and so do ``permittivity`` and ``debye_length``. With a salt
    given by its ionic strength, viscosity and density are those of fresh water: 0.1 mol/l of NaCl
    would add 0.9 and 0.4 % to them.
    """

    temperature: float | None = quantity(
        "K", at_least=water.ZERO_CELSIUS, at_most=water.ZERO_CELSIUS + 40.0, default=None,
        help='of the water, as "15 degC"; 25 °C if only the salt is given', kw_only=True,
    )  # fmt: skip
    salinity: float | None = quantity(
        "g/kg", at_least=0.0, at_most=42.0, default=None,
        help="of sea water, pure or diluted; the ocean has 35 g/kg", kw_only=True,
    )  # fmt: skip
    ionic_strength: float | None = quantity(
        "mol/m^3", above=0.0, at_most=1000.0, default=None,
        help="ionic strength I of another salt, instead of `salinity`", kw_only=True,
    )  # fmt: skip
    viscosity: float = quantity(
        "Pa s", above=0.0, help="γ; follows from temperature and salt, if they are given",
        default=attrs.Factory(lambda self: self.of_water(water.viscosity, WATER_VISCOSITY), True),
        shown=f"{WATER_VISCOSITY}",
    )  # fmt: skip
    density: float = quantity(
        "kg/m^3", at_least=0.0, help="ρ_f; follows from temperature and salt, if they are given",
        default=attrs.Factory(lambda self: self.of_water(water.density, WATER_DENSITY), True),
        shown=f"{WATER_DENSITY}",
    )  # fmt: skip
    buoyancy: bool = flag(default=False, help="subtract the displaced fluid's weight")
    velocity: tuple[float, float] = field(
        several(number("m/s"), 2, distinct=False), default=(0.0, 0.0),
        help="of the background flow at the origin",
    )  # fmt: skip
    gradient: tuple[float, float, float, float] = field(
        several(number("1/s"), 4, distinct=False), default=(0.0, 0.0, 0.0, 0.0),
        help="of the background flow: ∂u_x/∂x, ∂u_x/∂y, ∂u_y/∂x, ∂u_y/∂y",
    )  # fmt: skip

    def __attrs_post_init__(self) -> None:
        if self.salinity is not None and self.ionic_strength is not None:
            raise UsageError(
                "salinity determines the ionic strength, but ionic_strength is given too: remove "
                "one of them"
            )

    def of_water(self, law: Callable[[float, float], float], otherwise: float) -> float:
        """Return a property from flocsim.water at the temperature and salinity of this fluid.

        ``otherwise`` where the water is not described, or not by numbers (validators then report
        that).
        """
        given = [
            each for each in (self.temperature, self.salinity, self.ionic_strength)
            if each is not None
        ]  # fmt: skip
        if not given or not all(map(is_number, given)):
            return otherwise
        return law(self.warmth, self.salinity or 0.0)

    @property
    def warmth(self) -> float:
        """Temperature [K] at which properties of water are evaluated."""
        return self.temperature or ROOM_TEMPERATURE

    @property
    def ions(self) -> float | None:
        """Ionic strength [mol/m³]; None if no salt is given."""
        if self.salinity is None:
            return self.ionic_strength
        return self.of_water(water.ionic_strength, 0.0)

    @property
    def permittivity(self) -> float:
        """Relative permittivity ε_r [-]."""

        def law(warmth: float, salinity: float) -> float:
            # Other salts reduce it as sea water of the same ionic strength does.
            if self.ionic_strength is not None:
                salinity = water.sea_salinity(warmth, self.ionic_strength)
            return water.permittivity(warmth, salinity)

        return self.of_water(law, WATER_PERMITTIVITY)

    @property
    def debye_length(self) -> float | None:
        """Debye length 1/κ [m]; None without salt."""
        if not self.ions:
            return None
        return water.debye_length(self.warmth, self.ions, self.permittivity)

    @property
    def words(self) -> str:
        """Description of the water and of its derived properties; "" if it is not described."""
        said = [f"{self.warmth - water.ZERO_CELSIUS:.4g} °C"]
        if self.salinity is not None:
            said.append(f"{self.salinity:g} g/kg of salt")
        if self.ionic_strength is not None:
            said.append(f"an ionic strength of {1e-3 * self.ionic_strength:g} mol/l")
        if len(said) == 1 and self.temperature is None:
            return ""
        debye = self.debye_length
        return (
            f"water of {' and '.join(said)}: viscosity {1e3 * self.viscosity:.4g} mPa s, density "
            f"{self.density:.5g} kg/m^3, permittivity {self.permittivity:.4g}"
            + (f", Debye length {1e9 * debye:.3g} nm" if debye else "")
        )

    @property
    def flow(self) -> tuple[float, ...]:
        """Velocity and gradient as (u_x, u_y, g_xx, g_xy, g_yx, g_yy)."""
        return (*self.velocity, *self.gradient)


@attrs.frozen
class FractalDensity:
    """Density of a fractal floc, ρ(D) = ρ_w + (ρ_p − ρ_w)(D_p/D)^(3 − n_f), with D = 2 r_eq.

    Parameters
    ----------
    primary : float
        Diameter D_p of the primary particles [m]; a smaller floc is solid.
    dimension : float
        Fractal dimension n_f.
    solid : float
        Density ρ_p of the primary particles [kg/m³].

    Notes
    -----
    Source: Kranenburg (1994), Estuarine, Coastal and Shelf Science 39, 451.
    """

    law: str = choice("fractal")
    primary: float = quantity("m", above=0.0)
    dimension: float = quantity("", above=1.0, at_most=3.0)
    solid: float = quantity("kg/m^3", above=0.0)

    def at(self, radius: float, water: float) -> float:
        """Return ρ [kg/m³] of a floc with equivalent radius ``radius`` [m] in water of density
        ``water``."""
        thinned = min(0.5 * self.primary / radius, 1.0) ** (3.0 - self.dimension)
        return water + (self.solid - water) * thinned


@attrs.frozen(eq=False)
class Body:
    """A rigid shape with a mass, a position and a velocity.

    Parameters
    ----------
    shape : Shape
        Outline of the body.
    position : (float, float)
        Centroid [m].
    angle : float
        Angle of the shape's frame, counter-clockwise [rad].
    velocity : (float, float)
        [m/s].
    spin : float
        Angular velocity, counter-clockwise [rad/s].
    surface_density : float, optional
        ρ_s [kg/m²].
    density : float, optional
        ρ [kg/m³], instead of ``surface_density``.
    depth : float or "sphere"
        Extent in the third direction [m]; "sphere" = 4/3 r_eq, with which the mass is that of the
        equivalent solid sphere.
    fixed : bool
        Whether no force changes its velocity, which is zero unless given.

    Raises
    ------
    UsageError
        Unless exactly one of ``surface_density`` and ``density`` is given.

    Notes
    -----
    Mass m = ρ_s A and moment of inertia I = ρ_s J, with ρ_s = ``surface_density`` or ``density`` ·
    ``depth``.
    """

    shape: Shape = attrs.field(
        validator=only(Shape, "shape must be a Sphere, a SpheroPolygon, or a Shape of your own")
    )
    position: tuple[float, float] = attrs.field(default=(0.0, 0.0), converter=read_position)
    angle: float = quantity("rad", default=0.0)
    velocity: tuple[float, float] = attrs.field(default=(0.0, 0.0), converter=read_velocity)
    spin: float = quantity("rad/s", default=0.0)
    surface_density: float | None = quantity("kg/m^2", above=0.0, default=None, kw_only=True)
    density: float | None = quantity("kg/m^3", above=0.0, default=None, kw_only=True)
    depth: float | str = word_or_quantity("sphere", "m", above=0.0, default="sphere", kw_only=True)
    fixed: bool = flag(default=False)

    def __attrs_post_init__(self) -> None:
        if (self.surface_density is None) == (self.density is None):
            raise UsageError(
                "a body needs one of surface_density [kg/m^2] and density [kg/m^3], found "
                f"{'neither' if self.density is None else 'both'}"
            )

    @property
    def areal_density(self) -> float:
        """ρ_s [kg/m²]."""
        if self.surface_density is not None:
            return self.surface_density
        assert self.density is not None
        # The volume of the equivalent sphere over the area of its great circle: 4/3 r_eq.
        if isinstance(self.depth, str):
            return self.density * 4.0 / 3.0 * self.shape.equivalent_radius
        return self.density * self.depth

    @property
    def mass(self) -> float:
        """m = ρ_s A [kg]."""
        return self.areal_density * self.shape.area

    @property
    def inertia(self) -> float:
        """I = ρ_s J [kg m²]."""
        return self.areal_density * self.shape.second_moment

    def buoyant_mass(self, fluid: Fluid) -> float:
        """Return m (1 − ρ_f/ρ) [kg] with buoyancy on, else m.

        Raises UsageError if ρ is unknown, except for a fixed body, which no weight moves.
        """
        if not fluid.buoyancy or (self.fixed and self.density is None):
            return self.mass
        if self.density is None:
            raise UsageError(
                "buoyancy needs the density of the bodies [kg/m^3], but only surface_density is "
                "given: set bodies.density and bodies.depth, or fluid.buoyancy = false"
            )
        return self.mass * (1.0 - fluid.density / self.density)


def of_forces(pieces: Any) -> dict[str, Any]:
    """Return {field of a Scene: value} for the forces' Pieces (flocsim.forces.codegen)."""
    return {
        "parameters": np.array(pieces.parameters, dtype=float),
        "surface_reach": float(pieces.surface_reach), "centre_reach": float(pieces.centre_reach),
        "outlines": pieces.outlines, "layer": pieces.layer, "events": int(pieces.events),
    }  # fmt: skip


def scene_of(bodies: Sequence[Body], fluid: Fluid, resistances: Any = None, **fields: Any) -> Scene:
    """Return the bodies as one Scene of new arrays.

    ``resistances``: of every body, if a drag follows shapes (flocsim.forces.drag); ``fields``:
    those of the Scene that forces contribute, without which it has no laws, and further ones.
    """
    given: dict[str, Any] = {"parameters": np.zeros(0), "laws": NO_LAWS, **fields}
    reach, layer = given.get("outlines", NO_OUTLINES)[0], given.get("layer", NO_LAYER)
    shapes = [body.shape for body in bodies]
    # Fields of BodyConstants in their order, up to the resistances.
    columns: tuple[Iterable[float], ...] = (
        [body.mass for body in bodies],
        [body.buoyant_mass(fluid) for body in bodies],
        [body.inertia for body in bodies],
        [0.0 if body.fixed else 1.0 for body in bodies],
        [shape.equivalent_radius for shape in shapes],
        [shape.bounding_radius for shape in shapes],
        [shape.radius for shape in shapes],
        [shape.elongation for shape in shapes],
        [shape.long_axis for shape in shapes],
        range(len(bodies)),
    )
    if resistances is None:
        resistances = np.zeros((len(bodies), RESISTANCE_COLUMNS))
    known = BodyConstants.rows(len(bodies))
    rows = zip(zip(*columns, strict=True), resistances, strict=True)
    known[:] = [(*own, *resistance, *UNSHIELDED) for own, resistance in rows]
    scene = Scene(
        bodies=known,
        **outlines_of(shapes)._asdict(),
        # Outlines, charges and fields are empty unless a force between outlines needs them.
        **pieces_of_bodies(shapes if reach > 0.0 else (), len(bodies))._asdict(),
        **charges_of_bodies(shapes, layer[0])._asdict(),
        **field_of_bodies(shapes, layer[0])._asdict(),
        **given,
    )
    # Features are listed for surface forces, and for a pair resistance between outlines.
    listed_reach = max(scene.surface_reach, scene.water.near_cut or -1.0)
    return scene._replace(listed_reach=listed_reach)
