"""What turning does to the force of a pair: its normal and its arms change with the bodies' places.

With f = N n + T t the normal turns by ψ, and the force by (N t − T n) ψ. On the vertex's body the
torque changes by A (ψ − θ_a), where A = p·f and p leads from the centroid to the vertex. On the
edge's body, the same holds for an end of the edge; on its inside the foot slides by σ instead, and
the torque changes by N σ.
"""

from flocsim.integrators.products import add_product
from flocsim.layout import NOW, RADIUS, STIFFNESS

NOTHING = (0.0, 0.0, 0.0)
"""A body on which a direction has no entries."""


def sliding_row(scene, work, row):
    """Entries of σ, by which the vertex moves along the edge, on the two bodies; and the arms.

    The arms are p·n and the same for the foot.
    """
    a, b = work.candidates[row, 0], work.candidates[row, 2]
    g = work.geometry
    tx, ty = -g[NOW, row, 1], g[NOW, row, 0]
    difference = scene.bodies[a, RADIUS] - scene.bodies[b, RADIUS]
    distance = g[NOW, row, 2] + scene.bodies[a, RADIUS] + scene.bodies[b, RADIUS]
    arm_a = g[NOW, row, 4] + 0.5 * (distance + difference)
    arm_b = g[NOW, row, 6] - 0.5 * (distance - difference)
    # An end goes with its body; along an edge that turns, the vertex slides by its own arm.
    beside = distance if g[NOW, row, 7] == 0.0 else 0.0
    return (tx, ty, arm_a), (-tx, -ty, -arm_b - beside), arm_a, arm_b


def scaled(row, share):
    """A direction's entries on one body, times a number."""
    return row[0] * share, row[1] * share, row[2] * share


def add_turning(scene, work, row, normal, tangential):
    """Derivative by the places of a pair's force whose size stays the same."""
    a, b = work.candidates[row, 0], work.candidates[row, 2]
    g, stiffness = work.geometry, work.jacobian
    slide_a, slide_b, arm_a, arm_b = sliding_row(scene, work, row)
    nx, ny, turning = g[NOW, row, 0], g[NOW, row, 1], g[NOW, row, 7]
    fx, fy = -normal * ny - tangential * nx, normal * nx - tangential * ny
    torque_a = normal * arm_a - tangential * g[NOW, row, 3]
    torque_b = normal * arm_b - tangential * g[NOW, row, 5]
    stiffness[STIFFNESS, 3 * a + 2, 3 * a + 2] += torque_a
    if turning == 0.0:
        out = (fx, fy, torque_a), (-fx, -fy, 0.0)
        add_product(work, STIFFNESS, a, b, out, (NOTHING, (0.0, 0.0, 1.0)), -1.0)
        on_b = NOTHING, (0.0, 0.0, 1.0)
        add_product(work, STIFFNESS, a, b, on_b, (slide_a, slide_b), -normal)
    else:
        out = (fx, fy, torque_a), (-fx, -fy, -torque_b)
        by = scaled(slide_a, turning), scaled(slide_b, turning)
        add_product(work, STIFFNESS, a, b, out, by, -1.0)
        stiffness[STIFFNESS, 3 * b + 2, 3 * b + 2] -= torque_b
