"""Two spheres in slow flow by another way: point forces inside them, fitted to their surfaces.

Nothing of flocsim is used. Accurate to 1e-5 for gaps of a quarter of the smaller radius and more.
"""

import numpy as np


def points(count, radius, centre):
    """Even points of a sphere, and of one around it, by the golden angle."""
    place = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * place / count, np.pi * (1.0 + 5.0**0.5) * place
    flat = np.sqrt(1.0 - z * z)
    return np.array(centre) + radius * np.column_stack(
        [flat * np.cos(turn), flat * np.sin(turn), z]
    )


def oseen(at, sources):
    """(3k, 3m): velocities at points by unit point forces, viscosity 1."""
    apart = at[:, None] - sources[None]
    distance = np.linalg.norm(apart, axis=2)[..., None, None]
    tensor = np.eye(3) / distance + apart[..., :, None] * apart[..., None, :] / distance**3
    return np.moveaxis(tensor, 2, 1).reshape(3 * len(at), 3 * len(sources)) / (8.0 * np.pi)


def resistances(ratio, gap, count=300, depth=0.6):
    """Forces and torques (12, …) on spheres of radius 1 and ``ratio``, centres along x: (R (12, 12)
    by velocities and spins of 1 and 2, Γ (12, 2) by E_xx = 1 with E_yy = E_zz = −½, and E_xy)."""
    radii, places = (1.0, ratio), (np.zeros(3), np.array([1.0 + ratio + gap, 0.0, 0.0]))
    inner = [points(count, depth * a, c) for a, c in zip(radii, places, strict=True)]
    outer = [points(3 * count, a, c) for a, c in zip(radii, places, strict=True)]
    surface = np.concatenate(outer)
    wanted = np.zeros((len(surface), 3, 14))
    size = 3 * count
    for sphere in (0, 1):
        mine = slice(sphere * size, (sphere + 1) * size)
        arm = outer[sphere] - places[sphere]
        for axis in range(3):
            unit = np.eye(3)[axis]
            wanted[mine, axis, 6 * sphere + axis] = 1.0
            wanted[mine, :, 6 * sphere + 3 + axis] = np.cross(unit, arm)
    # A body that rests in a strain: the disturbance takes away the flow, but for that at its
    # centre, with which it is taken to go.
    for column, strain in enumerate((np.diag([1.0, -0.5, -0.5]), np.eye(3)[[1, 0, 2]] * [1, 1, 0])):
        for sphere in (0, 1):
            mine = slice(sphere * size, (sphere + 1) * size)
            wanted[mine, :, 12 + column] = -(outer[sphere] - places[sphere]) @ strain
    matrix = oseen(surface, np.concatenate(inner))
    forces = np.linalg.lstsq(matrix, wanted.reshape(-1, 14), rcond=1e-12)[0]
    forces = forces.reshape(2, count, 3, 14)
    found = np.zeros((12, 14))
    for sphere in (0, 1):
        arm = inner[sphere] - places[sphere]
        found[6 * sphere : 6 * sphere + 3] = forces[sphere].sum(axis=0)
        found[6 * sphere + 3 : 6 * sphere + 6] = np.cross(
            arm[:, :, None], forces[sphere], axisa=1, axisb=1, axisc=1
        ).sum(axis=0)
    return found[:, :12], -found[:, 12:]
