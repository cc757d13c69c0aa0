"""The resistance of a body's own shape to slow flow, computed once and kept on the disk."""

import functools
import hashlib
import inspect
import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from flocsim.arrays import RESISTANCE_COLUMNS
from flocsim.body import Body
from flocsim.compiler.disk_cache import kept
from flocsim.compiler.processor import cpu_kind, versions
from flocsim.errors import UsageError
from flocsim.forces.base import Force
from flocsim.forces.drag import StokesDrag
from flocsim.geometry.shapes import cores
from flocsim.geometry.shapes.shape import Shape
from flocsim.hydrodynamics import prism, prism_drag
from flocsim.hydrodynamics.permeable import drag_factor

DIGITS = 7
"""Of an outline over r_eq, and of the depth: shapes that differ by less are one."""

NO_RESISTANCE = (0.0,) * RESISTANCE_COLUMNS

SPHERE = (6.0 * math.pi, 0.0, 6.0 * math.pi, 0.0, 0.0, 8.0 * math.pi) + (0.0,) * 6
"""The numbers of a sphere of radius 1: R, and no load by a strain."""

POWERS = (1, 1, 1, 2, 2, 3, 2, 2, 3, 2, 2, 3)
"""By which power of the size each number grows."""


def follows_shape(forces: Iterable[Force]) -> bool:
    """Whether a drag among the forces is that of shapes."""
    return any(isinstance(force, StokesDrag) and force.law == "shape" for force in forces)


def resistance_numbers(forces: Iterable[Force], body: Body) -> tuple[float, ...]:
    """Those of BodyView, from ``resistance_xx`` on: zeros unless a drag follows shapes."""
    return body_resistance(body) if follows_shape(forces) else NO_RESISTANCE


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
        for force in forces:
            if isinstance(force, StokesDrag) and force.permeability > 0.0:
                radius *= drag_factor(radius, force.permeability)
        return radius
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
        found = prism_drag(rings, height)
        r = found.resistance
        if not np.linalg.eigvalsh(r)[0] > 0.0:
            raise UsageError(
                f"the drag of an outline {height:.3g} r_eq deep cannot be computed: its resistance "
                'is not positive; give the drag the law "stokes", or the shape fewer thin parts'
            )
        numbers = [r[0, 0], r[0, 1], r[1, 1], r[0, 2], r[1, 2], r[2, 2], *found.strain.T.ravel()]
        return np.array(numbers, dtype=float).tobytes()

    told = hashlib.blake2b(b"|".join(outline), digest_size=32).hexdigest()
    data = kept("flocsim_drag", f"{told} {height} {facts_of(prism, cores)}", made)
    return tuple(np.frombuffer(data).tolist())


@functools.cache
def facts_of(*modules: Any) -> str:
    """What is computed once follows from beside its input: code of modules, versions, processor."""
    code = hashlib.blake2b(digest_size=16)
    for module in modules:
        code.update(inspect.getsource(module).encode())
    return f"{code.hexdigest()} {versions()} {cpu_kind()}"
