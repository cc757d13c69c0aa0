"""The paper's own optimiser (section 2.3; Dobrohotoff et al. 2012): vertices as damped particles.

Each vertex obeys ẍ = −H ∇V − c ẋ, ∇V by central differences of the pixel error over ±h.  The
printed equation has the signs that would raise V.  The paper gives H and c but neither h, the time
step, the start nor the end; those are set here: a pixel, a step in which nothing moves by much more
than a fraction of a pixel, even spacing, and no lower V for a while.
"""

import numpy as np

from flocsim.geometry.fit.coverage import compiled, count_wrong, cover, move_vertex, neighbours
from flocsim.geometry.fit.edge_errors import leaves_room
from flocsim.geometry.fit.simple import stays_simple

FORCE = 0.5
"""H, the paper's force factor."""

DAMPING = 2.0
"""c, the paper's damping factor."""

SPACING = 1.0
"""h [px]: V is a whole number and flat below the size of a pixel."""

TIME_STEP = 0.1
"""Short against the relaxation time 1/c."""

PATIENCE = 200
"""Steps without a lower V after which it counts as the minimum: forty relaxation times."""


def gradient(mask, odd, near, vertices, k, radius, spacing):
    """∇V [pixels/px] of vertex k by central differences."""
    before, here, after = neighbours(vertices, k)
    x, y = here
    right, _ = move_vertex(mask, odd, near, before, here, after, (x + spacing, y), radius, False)
    left, _ = move_vertex(mask, odd, near, before, here, after, (x - spacing, y), radius, False)
    down, _ = move_vertex(mask, odd, near, before, here, after, (x, y + spacing), radius, False)
    up, _ = move_vertex(mask, odd, near, before, here, after, (x, y - spacing), radius, False)
    return 0.5 * (right - left) / spacing, 0.5 * (down - up) / spacing


def advance(mask, odd, near, vertices, velocities, k, radius, step):
    """Move vertex k by its velocity, or stop it where the polygon would not stay simple.

    Returns the change of V.
    """
    before, here, after = neighbours(vertices, k)
    x = vertices[k, 0] + step * velocities[k, 0]
    y = vertices[k, 1] + step * velocities[k, 1]
    room = leaves_room(mask.shape, (x, y), radius + SPACING + 1.0)
    if not (room and stays_simple(vertices, k, x, y)):
        velocities[k] = 0.0
        return 0
    vertices[k, 0], vertices[k, 1] = x, y
    change, _ = move_vertex(mask, odd, near, before, here, after, (x, y), radius, True)
    return change


def damped_descent(mask, vertices, best, radius, force, damping, spacing, step, patience):
    """The vertices (N, 2) of the least V on the way of the damped motion into ``best``; the steps
    taken."""
    odd, near = cover(vertices, radius, mask.shape)
    wrong = least = count_wrong(mask, odd, near)[0]
    best[:] = vertices
    velocities = np.zeros_like(vertices)
    steps = waited = 0
    while waited < patience and least > 0:
        for k in range(len(vertices)):
            across, down = gradient(mask, odd, near, vertices, k, radius, spacing)
            velocities[k, 0] -= step * (force * across + damping * velocities[k, 0])
            velocities[k, 1] -= step * (force * down + damping * velocities[k, 1])
        for k in range(len(vertices)):
            wrong += advance(mask, odd, near, vertices, velocities, k, radius, step)
        steps, waited = steps + 1, waited + 1
        if wrong < least:
            best[:], least, waited = vertices, wrong, 0
    return steps


def paper_fit(mask: np.ndarray, start: np.ndarray, radius: float) -> np.ndarray:
    """The vertices (N, 2) that the paper's motion leads to from a start, which it leaves alone."""
    vertices, best = np.array(start), np.empty_like(start)
    compiled(damped_descent)(
        mask, vertices, best, radius, FORCE, DAMPING, SPACING, TIME_STEP, PATIENCE
    )
    return best
