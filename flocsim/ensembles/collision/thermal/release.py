"""Where a brownian meeting begins, and where it is missed."""

import math
from collections.abc import Sequence

import numpy as np

from flocsim.ensembles.config.pair_scene import PairScene
from flocsim.errors import ConfigError
from flocsim.geometry.shapes.shape import Shape


def ends_of(options: PairScene, shapes: Sequence[Shape]) -> tuple[float, float]:
    """Distances of the centres [m] at which two bodies are let go, and at which they have missed
    each other."""
    size = sum(shape.equivalent_radius for shape in shapes)
    return options.release * size, options.escape * size


def refuse_release(
    options: PairScene, shapes: Sequence[Shape], diffusion: float = math.inf
) -> None:
    """ConfigError where two bodies do not diffuse, or their outlines may touch as they are let go.

    ``diffusion``: D of the two against each other [m²/s].
    """
    if not diffusion > 0.0:
        raise ConfigError(
            "two bodies that do not diffuse never meet: add [forces.thermal], of a temperature "
            "above 0 K"
        )
    size = sum(shape.equivalent_radius for shape in shapes)
    outer = sum(shape.bounding_radius for shape in shapes)
    if not outer < ends_of(options, shapes)[0]:
        raise ConfigError(
            f"scene.release = {options.release:g} (r_i + r_j) lets outlines touch that reach "
            f"{outer / size:.3g} (r_i + r_j): give a larger one, and scene.escape above it"
        )


def start_apart(angles: Sequence[float], direction: float, far: float) -> np.ndarray:
    """Places (2, 3) [m, m, rad] of i at the origin and j at a distance ``far``, in a direction that
    is a share of a full turn."""
    turn = 2.0 * math.pi * direction
    return np.array(
        [[0.0, 0.0, angles[0]], [far * math.cos(turn), far * math.sin(turn), angles[1]]]
    )
