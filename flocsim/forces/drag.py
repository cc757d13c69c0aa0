"""Drag on each body: Stokes, Schiller and Naumann (finite Reynolds number), or that of its shape.

The resistance of a shape is computed once by boundary elements (flocsim.hydrodynamics.prism_drag)
and stored on disk. Equations and sources stand in StokesDrag.
"""

import functools
import hashlib
import inspect
import math
from collections.abc import Callable, Iterable
from typing import Any

import attrs
import numpy as np

from flocsim.body import Body, Fluid
from flocsim.compiler.disk_cache import kept
from flocsim.compiler.processor import cpu_kind, versions
from flocsim.errors import RangeError, UsageError
from flocsim.fields import choice, flag, quantity
from flocsim.forces.base import BodyForce, Force
from flocsim.geometry.shapes import cores, outline
from flocsim.geometry.shapes.shape import Shape
from flocsim.hydrodynamics import panels, rigid_bodies
from flocsim.hydrodynamics.rigid_bodies import drag_factor, turning_factor
from flocsim.state.bodies import RESISTANCE_COLUMNS

STOKES_UP_TO = 1.0
"""Reynolds number up to which Stokes's law is used without a warning: it is 15 % too low there."""

SCHILLER_NAUMANN_UP_TO = 800.0
"""Reynolds number up to which the law of Schiller and Naumann is valid, within about 5 %."""


def flow_at(flow, x, y):
    """Return (u_x, u_y, Ω) of the flow (u_x, u_y, g_xx, g_xy, g_yx, g_yy) at a position."""
    u_x, u_y, g_xx, g_xy, g_yx, g_yy = flow
    # Ω is the spin of a fluid element, half the vorticity.
    return u_x + g_xx * x + g_xy * y, u_y + g_yx * x + g_yy * y, 0.5 * (g_yx - g_xy)


def strain_of(flow):
    """Return (E_xx, E_xy) [1/s] of the flow: its rate of strain without the dilatational part."""
    _, _, g_xx, g_xy, g_yx, g_yy = flow
    return 0.5 * (g_xx - g_yy), 0.5 * (g_xy + g_yx)


def strain_spin(body, flow):
    """Return B (−E_xx sin 2ψ + E_xy cos 2ψ) [rad/s], the spin beyond Ω that a strain causes.

    ψ is the angle of the long axis; Jeffery (1922).
    """
    e_xx, e_xy = strain_of(flow)
    twice = 2.0 * (body.angle + body.long_axis)
    return body.elongation * (e_xy * math.cos(twice) - e_xx * math.sin(twice))


def reynolds_number(speed: float, radius: float, viscosity: float, density: float) -> float:
    """Return Re = 2 r ρ_f |v − u|/γ for a speed relative to the fluid [m/s].

    r in m, γ in Pa s, ρ_f in kg/m³.
    """
    return 2.0 * radius * density * speed / viscosity


def resistance_load(body, c, s, vx, vy, spin):
    """Return R (v − u, ω − Ω) over the viscosity, in the frame of the shape.

    ``c`` and ``s`` are the cosine and sine of the angle of the body.
    """
    # Velocities are rotated into the frame of the shape; a spin in the plane is the same there.
    ahead, aside = c * vx + s * vy, c * vy - s * vx
    return (
        body.resistance_xx * ahead + body.resistance_xy * aside + body.resistance_xs * spin,
        body.resistance_xy * ahead + body.resistance_yy * aside + body.resistance_ys * spin,
        body.resistance_xs * ahead + body.resistance_ys * aside + body.resistance_ss * spin,
    )


def apply_shielding(body, x, y):
    """Return Q (x, y): the velocity, or the force, left by the shielding in a cluster."""
    xy = body.shielding_xy
    return body.shielding_xx * x + xy * y, xy * x + body.shielding_yy * y


def sphere_load(body, x, y, spin, viscosity, density, options):
    """Return (fx, fy, torque) on the equivalent sphere at a velocity and spin relative to the flow.

    ``options``: (rotational, with_inertia, permeability).
    """
    rotational, with_inertia, permeability = options
    # Stokes drag, Tang et al. (2014), eq. 4, and the torque on a rotating sphere in slow flow.
    translation = 6.0 * math.pi * viscosity * body.radius
    rotation = 8.0 * math.pi * viscosity * body.radius**3 * rotational
    # Brinkman: a sphere that water flows through resists less than a solid one.
    if permeability > 0.0:
        translation *= drag_factor(body.radius, permeability)
        rotation *= turning_factor(body.radius, permeability)
    if with_inertia:
        reynolds = reynolds_number(math.hypot(x, y), body.radius, viscosity, density)
        # Schiller and Naumann (1933); the torque stays that of slow flow.
        translation *= 1.0 + 0.15 * reynolds**0.687
    return -translation * x, -translation * y, -rotation * spin


def strain_load(body, c, s, flow):
    """Return Γ (E_xx, E_xy) over the viscosity, the load of the strain, in the frame of the
    shape."""
    e_xx, e_xy = strain_of(flow)
    c_2, s_2 = c * c - s * s, 2.0 * c * s
    # A strain rotates with twice the angle.
    e_xx, e_xy = c_2 * e_xx + s_2 * e_xy, c_2 * e_xy - s_2 * e_xx
    return (
        body.strain_xx_x * e_xx + body.strain_xy_x * e_xy,
        body.strain_xx_y * e_xx + body.strain_xy_y * e_xy,
        body.strain_xx_s * e_xx + body.strain_xy_s * e_xy,
    )


@attrs.frozen
class StokesDrag(BodyForce):
    """Drag −6πγ r_eq (v − u) f and, if ``rotational``, torque −8πγ r_eq³ (ω − Ω).

    Viscosity γ, density ρ_f and the background flow u, Ω are the fluid's.

    Parameters
    ----------
    rotational : bool
        Whether there is a drag torque.
    law : "stokes", "schiller_naumann" or "shape"
        "stokes": f = 1, for Reynolds numbers up to about 1. "schiller_naumann": f = 1 + 0.15
        Re^0.687 for Re = 2 r_eq ρ_f |v − u|/γ up to 800; the torque remains Stokes's. "shape": slow
        flow around the body's own outline.
    strain : bool
        Whether the strain E of the flow turns elongated bodies (law "shape" includes it).
    clusters : bool
        Whether touching bodies of a swarm shield each other from the flow.
    permeability : float
        k [m²] of Brinkman's equation inside the equivalent sphere; 0 is impermeable.

    Raises
    ------
    RangeError
        If ``strain`` or the law "shape" is combined with ``rotational`` false, or "shape" with a
        permeability.

    Notes
    -----
    Shape: the load (force, torque) is −γ R (v − u, ω − Ω) + γ Γ (E_xx, E_xy). The symmetric R (3 ×
    3) and Γ (3 × 2), in the frame of the shape, are those of a prism with the outline and the depth
    of the body (flocsim.hydrodynamics.prism_drag), computed once per shape. A body of one core
    point is a sphere unless its depth is given. Such a body drifts sideways and turns as it falls.

    Strain: the torque is −8πγ r_eq³ [ω − Ω − B(−E_xx sin 2ψ + E_xy cos 2ψ)], where ψ is the angle
    of the long axis and B = (M₁ − M₂)/(M₁ + M₂) follows from the principal second moments of area.
    An ellipse with half axes a and b has B = (a² − b²)/(a² + b²) and follows Jeffery's orbit, with
    period 2π(a/b + b/a)/G in simple shear G. Any other shape is treated as the ellipse with its
    moments.

    Clusters: the drag R of a body becomes Q R Q, with the same Q for all bodies of a cluster,
    chosen so that their sum is the resistance of the cluster (flocsim.swarms.together.clusters).
    Torques stay those of single bodies. Re is then that of Q (v − u).

    Permeability: with β = r_eq/√k the drag is reduced by Brinkman's factor 2β²(1 − tanh β/β)/(2β² +
    3(1 − tanh β/β)) and the torque by 1 + 3/β² − 3 coth β/β (flocsim.hydrodynamics.rigid_bodies).

    Sources: Tang et al. (2014), eq. 4; Schiller and Naumann (1933), as in Clift, Grace and Weber
    (1978), Table 5.2; Jeffery (1922), Proc. R. Soc. A 102, 161. The rotational drag of a sphere is
    an addition to the paper; without it nothing would stop a spin.
    """

    rotational: bool = flag(default=True, help="drag torque on spinning bodies")
    law: str = choice(
        "stokes",
        "schiller_naumann",
        "shape",
        default="stokes",
        help="schiller_naumann: Stokes's drag times 1 + 0.15 Re^0.687, Re = 2 r_eq ρ_f v/γ, for Re "
        "up to 800; shape: slow flow around the outline of each body",
    )

    strain: bool = flag(
        default=False, help="let the strain of the flow rotate long bodies (Jeffery orbits)"
    )

    clusters: bool = flag(
        default=False,
        help="in swarms: let touching flocs shield each other from the flow, so that a cluster "
        "settles faster than its flocs",
    )
    permeability: float = quantity(
        "m^2", at_least=0.0, default=0.0,
        help="k of Brinkman's equation inside the equivalent sphere; 0: no water passes through "
        "the flocs",
    )  # fmt: skip

    def __attrs_post_init__(self) -> None:
        if self.strain and not self.rotational:
            raise RangeError(
                "strain must be false if rotational is false: it is part of the drag torque"
            )
        if self.law == "shape" and self.permeability > 0.0:
            raise RangeError(
                'permeability must be 0 if law is "shape": it is known for spheres only'
            )
        if self.law == "shape" and not self.rotational:
            raise RangeError(
                'rotational must be true if law is "shape": the drag of a shape couples '
                "translation and rotation"
            )

    @property
    def valid_up_to(self) -> float:
        """Reynolds number up to which the law is valid."""
        return SCHILLER_NAUMANN_UP_TO if self.law == "schiller_naumann" else STOKES_UP_TO

    def kernel_in(self, fluid: Fluid) -> Callable:
        """Return the kernel of this law; in still water one without derivatives by position."""
        if self.law == "shape":
            return self.shape
        if self.clusters:
            return self.shielded
        return self.kernel if any(fluid.flow) else self.still

    @property
    def options(self) -> tuple[bool, bool, float]:
        """Parameters of `sphere_load`: rotational, with inertia (Schiller–Naumann),
        permeability."""
        return self.rotational, self.law == "schiller_naumann", self.permeability

    def remarks(self, fluid: Fluid) -> list[str]:
        """Return whether the drag depends on shape, strain, clusters and permeability."""
        others = ["reduced in clusters of a swarm"] * self.clusters
        others += ["reduced by permeability"] * (self.permeability > 0.0)
        if self.law == "shape":
            return ["depends on the outline of each body", *others]
        if not self.strain:
            return others
        strained = any(strain_of(fluid.flow))
        words = "strain rotates long bodies" if strained else "this flow has no strain: left out"
        return [words, *others]

    @staticmethod
    def kernel(body, viscosity, density, flow, strain, options):
        """Return the load on the equivalent sphere in a flow, with or without strain torque."""
        u, v, turning = flow_at(flow, body.x, body.y)
        # Jeffery: the strain shifts the spin at which there is no torque.
        spin = body.spin - turning - strain * strain_spin(body, flow)
        return sphere_load(body, body.vx - u, body.vy - v, spin, viscosity, density, options)

    @staticmethod
    def still(body, viscosity, density, options):
        """Return the load on the equivalent sphere in still water."""
        return sphere_load(body, body.vx, body.vy, body.spin, viscosity, density, options)

    @staticmethod
    def shielded(body, viscosity, density, flow, strain, options):
        """Return the load on the equivalent sphere in a cluster."""
        u, v, turning = flow_at(flow, body.x, body.y)
        spin = body.spin - turning - strain * strain_spin(body, flow)
        # The drag matrix is Q R Q: the velocity is shielded first, then the force.
        x, y = apply_shielding(body, body.vx - u, body.vy - v)
        fx, fy, torque = sphere_load(body, x, y, spin, viscosity, density, options)
        fx, fy = apply_shielding(body, fx, fy)
        return fx, fy, torque

    @staticmethod
    def shape(body, viscosity, flow):
        """Return the load on the shape, shielded by its cluster if it is in one."""
        u, v, turning = flow_at(flow, body.x, body.y)
        c, s = math.cos(body.angle), math.sin(body.angle)
        x, y = apply_shielding(body, body.vx - u, body.vy - v)
        x, y, turn = resistance_load(body, c, s, x, y, body.spin - turning)
        more_x, more_y, more = strain_load(body, c, s, flow)
        # Load of the strain less resistance, then back to the frame of the scene.
        x, y, turn = viscosity * (more_x - x), viscosity * (more_y - y), viscosity * (more - turn)
        x, y = apply_shielding(body, c * x - s * y, s * x + c * y)
        return x, y, turn


def shields_clusters(forces: Iterable[Force]) -> bool:
    """Return True if one of the forces is a drag with shielding in clusters."""
    return any(isinstance(force, StokesDrag) and force.clusters for force in forces)


def solid_radius(radius: float, forces: Iterable[Force]) -> float:
    """Return the radius [m] of the solid sphere with the drag of a permeable one of ``radius``."""
    for force in forces:
        if isinstance(force, StokesDrag) and force.permeability > 0.0:
            radius *= drag_factor(radius, force.permeability)
    return radius


def is_permeable(forces: Iterable[Force]) -> bool:
    """Return True if one of the forces is a drag of permeable bodies."""
    return any(isinstance(force, StokesDrag) and force.permeability > 0.0 for force in forces)


KEY_DECIMALS = 7
"""Decimals of outline coordinates and depth over r_eq in the key of a stored resistance.

Shapes that agree to these decimals share one result.
"""

UNIT_SPHERE = (6.0 * math.pi, 0.0, 6.0 * math.pi, 0.0, 0.0, 8.0 * math.pi) + (0.0,) * 6
"""R and Γ of a sphere of radius 1, in the order of BodyView: a strain exerts no load on it."""

LENGTH_POWERS = (1, 1, 1, 2, 2, 3, 2, 2, 3, 2, 2, 3)
"""Power of the length scale by which each number grows (R: m, m², m³; Γ: m², m³)."""


def follows_shape(forces: Iterable[Force]) -> bool:
    """Return True if one of the forces is a drag with the law "shape"."""
    return any(isinstance(force, StokesDrag) and force.law == "shape" for force in forces)


def resistance_numbers(forces: Iterable[Force], body: Body) -> tuple[float, ...]:
    """Return the fields of BodyView from ``resistance_xx`` on; zeros unless a drag follows
    shapes."""
    return body_resistance(body) if follows_shape(forces) else (0.0,) * RESISTANCE_COLUMNS


def body_resistance(body: Body) -> tuple[float, ...]:
    """Return the six numbers of R and six of Γ of a body over the viscosity, in BodyView's order.

    They are those of a prism with the body's outline and depth [m]. With depth "sphere" a shape of
    one core point is a sphere, any other shape is 4/3 r_eq deep.
    """
    shape, radius = body.shape, body.shape.equivalent_radius
    if isinstance(body.depth, str) and len(shape.vertices) == 1:
        unit: Any = UNIT_SPHERE
    else:
        # Everything in units of r_eq, so that equal shapes share a stored result.
        height = 4.0 / 3.0 if isinstance(body.depth, str) else body.depth / radius
        unit = unit_resistance(outline_bytes(shape), round(height, KEY_DECIMALS))
    return tuple(number * radius**power for number, power in zip(unit, LENGTH_POWERS, strict=True))


def drag_radius(forces: Iterable[Force], body: Body) -> float:
    """Return the radius [m] of the sphere with the same mobility, averaged over in-plane
    directions.

    The body is free to turn. It is r_eq unless a drag follows shapes or bodies are permeable.
    """
    radius = body.shape.equivalent_radius
    if not follows_shape(forces):
        return solid_radius(radius, forces)
    # Mobility of the free body: torque zero, so the full R is inverted.
    mobility = np.linalg.inv(resistance_matrices(body_resistance(body))[0])
    # Mean mobility ½ (µ_xx + µ_yy) = 1/(6πγ r), solved for r.
    return float(1.0 / (3.0 * math.pi * (mobility[0, 0] + mobility[1, 1])))


def resistance_matrices(numbers: Iterable[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return (R (3, 3), Γ (3, 2)) from the twelve numbers."""
    xx, xy, yy, xs, ys, ss, *strain = numbers
    resistance = np.array([[xx, xy, xs], [xy, yy, ys], [xs, ys, ss]])
    return resistance, np.reshape(strain, (2, 3)).T


def outline_bytes(shape: Shape) -> tuple[bytes, ...]:
    """Return the outline over r_eq as bytes, equal for equal shapes of any size."""
    radius = shape.equivalent_radius
    # Adding zero turns −0 into 0, which has other bytes.
    return tuple(
        (np.round(ring / radius, KEY_DECIMALS) + 0.0).tobytes() for ring in shape.outline()
    )


@functools.lru_cache(maxsize=4096)
def unit_resistance(ring_bytes: tuple[bytes, ...], height: float) -> tuple[float, ...]:
    """Return the twelve numbers for an outline with r_eq = 1, from disk if they are stored
    there."""

    def make() -> bytes:
        rings = [np.frombuffer(ring).reshape(-1, 2) for ring in ring_bytes]
        drag = rigid_bodies.prism_drag(rings, height)
        r = drag.resistance
        # A resistance with a negative eigenvalue would drive a body instead of braking it.
        if not np.linalg.eigvalsh(r)[0] > 0.0:
            raise UsageError(
                f"the drag of an outline {height:.3g} r_eq deep cannot be computed: its resistance "
                'is not positive; give the drag the law "stokes", or the shape fewer thin parts'
            )
        # R: xx, xy, yy, xs, ys, ss; then Γ by columns.
        numbers = [r[0, 0], r[0, 1], r[1, 1], r[0, 2], r[1, 2], r[2, 2], *drag.strain.T.ravel()]
        return np.array(numbers, dtype=float).tobytes()

    digest = hashlib.blake2b(b"|".join(ring_bytes), digest_size=32).hexdigest()
    key = computation_key(rigid_bodies, panels, outline, cores)
    data = kept("flocsim_drag", f"{digest} {height} {key}", make)
    return tuple(np.frombuffer(data).tolist())


@functools.cache
def computation_key(*modules: Any) -> str:
    """Return a key for stored results besides their input: code of modules, versions, processor."""
    # Other code, libraries or processors may give other digits: their results are stored apart.
    code = hashlib.blake2b(digest_size=16)
    for module in modules:
        code.update(inspect.getsource(module).encode())
    return f"{code.hexdigest()} {versions()} {cpu_kind()}"
