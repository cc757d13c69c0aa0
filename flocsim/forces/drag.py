"""Drag: of Stokes, of Schiller and Naumann where the flow around a body is not slow, and of a
body's own shape, whose resistance is computed once and kept on the disk."""

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
from flocsim.geometry.shapes import cores
from flocsim.geometry.shapes.shape import Shape
from flocsim.hydrodynamics import rigid_bodies
from flocsim.hydrodynamics.rigid_bodies import drag_factor, turning_factor
from flocsim.state.bodies import RESISTANCE_COLUMNS

STOKES_UP_TO = 1.0
"""Reynolds number up to which Stokes's drag is taken to hold: there it lacks 15 %."""

SCHILLER_NAUMANN_UP_TO = 800.0
"""Reynolds number up to which the law of Schiller and Naumann holds, within about 5 %."""


def flow_at(flow, x, y):
    """(u_x, u_y, Ω) of the flow (u_x, u_y, g_xx, g_xy, g_yx, g_yy) at a place."""
    u_x, u_y, g_xx, g_xy, g_yx, g_yy = flow
    return u_x + g_xx * x + g_xy * y, u_y + g_yx * x + g_yy * y, 0.5 * (g_yx - g_xy)


def strain_of(flow):
    """(E_xx, E_xy) [1/s] of the flow: its rate of strain, without what makes it swell."""
    _, _, g_xx, g_xy, g_yx, g_yy = flow
    return 0.5 * (g_xx - g_yy), 0.5 * (g_xy + g_yx)


def strained_spin(body, flow):
    """B (−E_xx sin 2ψ + E_xy cos 2ψ) [rad/s]: how much faster than Ω a body with its long axis at
    the angle ψ turns freely in the flow."""
    e_xx, e_xy = strain_of(flow)
    twice = 2.0 * (body.angle + body.long_axis)
    return body.elongation * (e_xy * math.cos(twice) - e_xx * math.sin(twice))


def reynolds_number(speed: float, radius: float, viscosity: float, density: float) -> float:
    """Re = 2 r ρ_f |v − u|/γ of a speed against the fluid [m/s]; r [m], γ [Pa s], ρ_f [kg/m³]."""
    return 2.0 * radius * density * speed / viscosity


def resisted(body, c, s, vx, vy, spin):
    """R (v − u, ω − Ω) in the frame of a shape that has turned by an angle of this cosine and sine,
    over the viscosity."""
    ahead, aside = c * vx + s * vy, c * vy - s * vx
    return (
        body.resistance_xx * ahead + body.resistance_xy * aside + body.resistance_xs * spin,
        body.resistance_xy * ahead + body.resistance_yy * aside + body.resistance_ys * spin,
        body.resistance_xs * ahead + body.resistance_ys * aside + body.resistance_ss * spin,
    )


def shielded_by(body, x, y):
    """Q (x, y): what is left in a cluster of a motion, or of the force against it."""
    xy = body.shielding_xy
    return body.shielding_xx * x + xy * y, xy * x + body.shielding_yy * y


def sphere_load(body, x, y, spin, viscosity, density, options):
    """Force and torque on the equivalent sphere that moves and turns so against the flow;
    ``options``: rotational, with_inertia, permeability."""
    rotational, with_inertia, permeability = options
    translation = 6.0 * math.pi * viscosity * body.radius
    rotation = 8.0 * math.pi * viscosity * body.radius**3 * rotational
    if permeability > 0.0:
        translation *= drag_factor(body.radius, permeability)
        rotation *= turning_factor(body.radius, permeability)
    if with_inertia:
        reynolds = reynolds_number(math.hypot(x, y), body.radius, viscosity, density)
        translation *= 1.0 + 0.15 * reynolds**0.687
    return -translation * x, -translation * y, -rotation * spin


def resisted_in(body, flow):
    """(cosine and sine of its angle, the same of its motion in a flow)."""
    u, v, turning = flow_at(flow, body.x, body.y)
    c, s = math.cos(body.angle), math.sin(body.angle)
    x, y, turn = resisted(body, c, s, body.vx - u, body.vy - v, body.spin - turning)
    return c, s, x, y, turn


def strained_load(body, c, s, flow):
    """Γ (E_xx, E_xy) in that frame: what a flow's strain puts on the shape, over the viscosity."""
    e_xx, e_xy = strain_of(flow)
    c_2, s_2 = c * c - s * s, 2.0 * c * s
    e_xx, e_xy = c_2 * e_xx + s_2 * e_xy, c_2 * e_xy - s_2 * e_xx
    return (
        body.strain_xx_x * e_xx + body.strain_xy_x * e_xy,
        body.strain_xx_y * e_xx + body.strain_xy_y * e_xy,
        body.strain_xx_s * e_xx + body.strain_xy_s * e_xy,
    )


@attrs.frozen
class StokesDrag(BodyForce):
    """Drag −6πγ r_eq (v − u) f, and torque −8πγ r_eq³ (ω − Ω) where ``rotational``.

    ``law`` "stokes": f = 1, for Reynolds numbers up to about 1. "schiller_naumann":
    f = 1 + 0.15 Re^0.687 for Re up to 800, with Re = 2 r_eq ρ_f |v − u|/γ of the equivalent sphere
    (its diameter and its speed relative to the flow); the torque remains Stokes's. Viscosity γ,
    density ρ_f and the background flow u, Ω are the fluid's.

    "shape": −γ R (v − u, ω − Ω) + γ Γ (E_xx, E_xy), force and torque, for slow flow around the
    body's own outline. The symmetric R (3 × 3) and Γ (3 × 2), in the frame of the shape, are those
    of a prism of the outline and the body's depth, a rigid multiblob
    (flocsim.hydrodynamics.prism_drag), computed once for a shape; a body of one core point is a
    sphere unless its depth is given. Such a body drifts sideways and turns as it falls.

    ``strain``: the strain E of the flow also turns an elongated body ("shape" includes that), with
    the torque
    −8πγ r_eq³ [ω − Ω − B(−E_xx sin 2ψ + E_xy cos 2ψ)], ψ being the angle of the long axis and
    B = (M₁ − M₂)/(M₁ + M₂) of the principal second moments of area. An ellipse with the half axes
    a and b has B = (a² − b²)/(a² + b²), and turns as Jeffery found, once in 2π(a/b + b/a)/G in a
    simple shear G; any other shape is treated as the ellipse of its moments.

    ``clusters``: bodies of a swarm that touch shield each other from the flow. Their drag R becomes
    Q R Q, the same Q for all of a cluster, with which all of them together resist as much as the
    cluster does (flocsim.swarms.together.clusters); torques stay those of each. Re is then that of
    Q (v − u).

    ``permeability`` k [m²]: what water passes through resists less, by Brinkman's factor of the
    equivalent sphere, 2β²(1 − tanh β/β)/(2β² + 3(1 − tanh β/β)) with β = r_eq/√k, its torque by
    1 + 3/β² − 3 coth β/β (flocsim.hydrodynamics.rigid_bodies); 0 is impermeable.

    Sources: Tang et al. (2014), eq. 4; Schiller and Naumann (1933), as in Clift, Grace and Weber
    (1978), Table 5.2; Jeffery (1922), Proc. R. Soc. A 102, 161. The rotational drag of a sphere is
    an addition; without it nothing would stop a spin.
    """

    rotational: bool = flag(default=True, help="drag torque on spinning bodies")
    law: str = choice(
        "stokes",
        "schiller_naumann",
        "shape",
        default="stokes",
        help="schiller_naumann: times 1 + 0.15 Re^0.687, Re = 2 r_eq ρ_f v/γ, for Re up to 800; "
        "shape: slow flow around each body's own outline",
    )

    strain: bool = flag(
        default=False, help="a flow's strain turns long bodies, too: Jeffery's orbits"
    )

    clusters: bool = flag(
        default=False,
        help="in swarms: flocs that touch shield each other from the flow, so that a cluster "
        "settles at its own speed",
    )
    permeability: float = quantity(
        "m^2", at_least=0.0, default=0.0,
        help="of flocs that water passes through: k of Brinkman's equation in the equivalent "
        "sphere; 0: none does",
    )  # fmt: skip

    def __attrs_post_init__(self) -> None:
        if self.strain and not self.rotational:
            raise RangeError(
                "strain must be false where rotational is: it is a part of the drag torque"
            )
        if self.law == "shape" and self.permeability > 0.0:
            raise RangeError(
                'permeability must be 0 where law is "shape": it is known of equivalent spheres'
            )
        if self.law == "shape" and not self.rotational:
            raise RangeError(
                'rotational must be true where law is "shape": a shape that is pushed beside where '
                "it resists turns, and turning pushes it"
            )

    @property
    def serves_up_to(self) -> float:
        """The Reynolds number up to which the law holds."""
        return SCHILLER_NAUMANN_UP_TO if self.law == "schiller_naumann" else STOKES_UP_TO

    def kernel_in(self, fluid: Fluid) -> Callable:
        """Still water needs no flow, and no derivative by the place; a flow without strain, none by
        the angle."""
        moves, strains = any(fluid.flow), any(strain_of(fluid.flow))
        if self.law == "shape":
            if self.clusters:
                return self.shielded_shape
            return self.shape_strained if strains else self.shape
        if self.clusters:
            return self.shielded if moves else self.shielded_still
        if self.strain and strains:
            return self.strained
        return self.kernel if moves else self.still

    @property
    def options(self) -> tuple[bool, bool, float]:
        """What its kernels on spheres are given: ``rotational``, whether the force is more than
        Stokes's, ``permeability``."""
        return self.rotational, self.law == "schiller_naumann", self.permeability

    def remarks(self, fluid: Fluid) -> list[str]:
        """Whether it follows shapes, the flow's strain and clusters."""
        others = ["less in clusters of a swarm"] * self.clusters
        others += ["less as water passes through"] * (self.permeability > 0.0)
        if self.law == "shape":
            return ["of each body's own outline", *others]
        if not self.strain:
            return others
        strained = any(strain_of(fluid.flow))
        words = "long bodies turned by strain" if strained else "no strain in this flow: left out"
        return [words, *others]

    @staticmethod
    def kernel(body, viscosity, density, flow, options):
        """Force and torque on the equivalent sphere in the flow."""
        u, v, turning = flow_at(flow, body.x, body.y)
        return sphere_load(
            body, body.vx - u, body.vy - v, body.spin - turning, viscosity, density, options
        )

    @staticmethod
    def strained(body, viscosity, density, flow, options):
        """The same, with the torque of the flow's strain on the shape."""
        u, v, turning = flow_at(flow, body.x, body.y)
        spin = body.spin - turning - strained_spin(body, flow)
        return sphere_load(body, body.vx - u, body.vy - v, spin, viscosity, density, options)

    @staticmethod
    def still(body, viscosity, density, options):
        """Force and torque on the equivalent sphere in still water."""
        return sphere_load(body, body.vx, body.vy, body.spin, viscosity, density, options)

    @staticmethod
    def shielded(body, viscosity, density, flow, strain, options):
        """Force and torque on the equivalent sphere in a cluster, which strain may turn."""
        u, v, turning = flow_at(flow, body.x, body.y)
        spin = body.spin - turning - strain * strained_spin(body, flow)
        x, y = shielded_by(body, body.vx - u, body.vy - v)
        fx, fy, torque = sphere_load(body, x, y, spin, viscosity, density, options)
        fx, fy = shielded_by(body, fx, fy)
        return fx, fy, torque

    @staticmethod
    def shielded_still(body, viscosity, density, options):
        """The same in still water."""
        x, y = shielded_by(body, body.vx, body.vy)
        fx, fy, torque = sphere_load(body, x, y, body.spin, viscosity, density, options)
        fx, fy = shielded_by(body, fx, fy)
        return fx, fy, torque

    @staticmethod
    def shape(body, viscosity, flow):
        """Force and torque on the shape in a flow without strain."""
        c, s, x, y, turn = resisted_in(body, flow)
        return -viscosity * (c * x - s * y), -viscosity * (s * x + c * y), -viscosity * turn

    @staticmethod
    def shape_strained(body, viscosity, flow):
        """Force and torque on the shape in the flow."""
        c, s, x, y, turn = resisted_in(body, flow)
        more_x, more_y, more = strained_load(body, c, s, flow)
        x, y, turn = viscosity * (more_x - x), viscosity * (more_y - y), viscosity * (more - turn)
        return c * x - s * y, s * x + c * y, turn

    @staticmethod
    def shielded_shape(body, viscosity, flow):
        """Force and torque on the shape in a cluster."""
        u, v, turning = flow_at(flow, body.x, body.y)
        c, s = math.cos(body.angle), math.sin(body.angle)
        x, y = shielded_by(body, body.vx - u, body.vy - v)
        x, y, turn = resisted(body, c, s, x, y, body.spin - turning)
        more_x, more_y, more = strained_load(body, c, s, flow)
        x, y, turn = viscosity * (more_x - x), viscosity * (more_y - y), viscosity * (more - turn)
        x, y = shielded_by(body, c * x - s * y, s * x + c * y)
        return x, y, turn


def shields_clusters(forces: Iterable[Force]) -> bool:
    """Whether a drag among the forces is less in clusters."""
    return any(isinstance(force, StokesDrag) and force.clusters for force in forces)


def solid_radius(radius: float, forces: Iterable[Force]) -> float:
    """Radius [m] of the solid sphere that resists as one of ``radius`` under the drag among
    ``forces``: smaller where water passes through it."""
    for force in forces:
        if isinstance(force, StokesDrag) and force.permeability > 0.0:
            radius *= drag_factor(radius, force.permeability)
    return radius


def is_permeable(forces: Iterable[Force]) -> bool:
    """Whether a drag among the forces is that of bodies which water passes through."""
    return any(isinstance(force, StokesDrag) and force.permeability > 0.0 for force in forces)


DIGITS = 7
"""Of an outline over r_eq, and of the depth: shapes that differ by less are one."""

SPHERE = (6.0 * math.pi, 0.0, 6.0 * math.pi, 0.0, 0.0, 8.0 * math.pi) + (0.0,) * 6
"""The numbers of a sphere of radius 1: R, and no load by a strain."""

POWERS = (1, 1, 1, 2, 2, 3, 2, 2, 3, 2, 2, 3)
"""By which power of the size each number grows."""


def follows_shape(forces: Iterable[Force]) -> bool:
    """Whether a drag among the forces is that of shapes."""
    return any(isinstance(force, StokesDrag) and force.law == "shape" for force in forces)


def resistance_numbers(forces: Iterable[Force], body: Body) -> tuple[float, ...]:
    """Those of BodyView, from ``resistance_xx`` on: zeros unless a drag follows shapes."""
    return body_resistance(body) if follows_shape(forces) else (0.0,) * RESISTANCE_COLUMNS


def body_resistance(body: Body) -> tuple[float, ...]:
    """The six numbers of R and six of Γ of a body over the viscosity, in the order of BodyView.

    Of the prism of its outline with the body's depth [m]; where that is "sphere" a shape of one
    core point is a sphere, and another 4/3 r_eq deep.
    """
    shape, radius = body.shape, body.shape.equivalent_radius
    if isinstance(body.depth, str) and len(shape.vertices) == 1:
        unit: Any = SPHERE
    else:
        height = 4.0 / 3.0 if isinstance(body.depth, str) else body.depth / radius
        unit = unit_resistance(outline_text(shape), round(height, DIGITS))
    return tuple(number * radius**power for number, power in zip(unit, POWERS, strict=True))


def drag_radius(forces: Iterable[Force], body: Body) -> float:
    """Of the sphere that is as hard to move as a body in the mean of all directions of its plane,
    free to turn [m]: r_eq unless a drag follows shapes, or is of bodies that water passes
    through."""
    radius = body.shape.equivalent_radius
    if not follows_shape(forces):
        return solid_radius(radius, forces)
    free = np.linalg.inv(resistance_matrices(body_resistance(body))[0])
    return float(1.0 / (3.0 * math.pi * (free[0, 0] + free[1, 1])))


def resistance_matrices(numbers: Iterable[float]) -> tuple[np.ndarray, np.ndarray]:
    """(R (3, 3), Γ (3, 2)) of such numbers."""
    xx, xy, yy, xs, ys, ss, *strain = numbers
    resistance = np.array([[xx, xy, xs], [xy, yy, ys], [xs, ys, ss]])
    return resistance, np.reshape(strain, (2, 3)).T


def outline_text(shape: Shape) -> tuple[bytes, ...]:
    """The rings of an outline over r_eq, so that shapes alike at any size have the same."""
    radius = shape.equivalent_radius
    # Adding zero leaves no −0, which has other bytes.
    return tuple((np.round(ring / radius, DIGITS) + 0.0).tobytes() for ring in shape.outline())


@functools.lru_cache(maxsize=4096)
def unit_resistance(outline: tuple[bytes, ...], height: float) -> tuple[float, ...]:
    """The numbers of an outline of r_eq = 1, kept on the disk."""

    def made() -> bytes:
        rings = [np.frombuffer(ring).reshape(-1, 2) for ring in outline]
        found = rigid_bodies.prism_drag(rings, height)
        r = found.resistance
        if not np.linalg.eigvalsh(r)[0] > 0.0:
            raise UsageError(
                f"the drag of an outline {height:.3g} r_eq deep cannot be computed: its resistance "
                'is not positive; give the drag the law "stokes", or the shape fewer thin parts'
            )
        numbers = [r[0, 0], r[0, 1], r[1, 1], r[0, 2], r[1, 2], r[2, 2], *found.strain.T.ravel()]
        return np.array(numbers, dtype=float).tobytes()

    told = hashlib.blake2b(b"|".join(outline), digest_size=32).hexdigest()
    data = kept("flocsim_drag", f"{told} {height} {facts_of(rigid_bodies, cores)}", made)
    return tuple(np.frombuffer(data).tolist())


@functools.cache
def facts_of(*modules: Any) -> str:
    """What is computed once follows from beside its input: code of modules, versions, processor."""
    code = hashlib.blake2b(digest_size=16)
    for module in modules:
        code.update(inspect.getsource(module).encode())
    return f"{code.hexdigest()} {versions()} {cpu_kind()}"
