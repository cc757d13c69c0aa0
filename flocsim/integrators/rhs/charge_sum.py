"""Forces between double layers: those of all charges of one body on all of another.

What charges are, and why there are any: flocsim.geometry.surfaces.charges. The two sums of forces
between outlines share the way in (outline_sum.py).
"""

import flocsim.arrays as at
from flocsim.compiler.linker import apart
from flocsim.geometry.surfaces.bessel import bessel_slope
from flocsim.hooks import hook

LEAST = 1e-4
"""(κρ)² below which charges are not taken for nearer: so deep bodies never overlap that are to
come apart again."""


@hook
@apart
def sum_charges(scene, a, b, x, y, cosine, sine):
    """(fx, fy, torque about b's centroid) on a metre of body a [N/m, N/m, N], in the frame of b,
    where a lies at x, y [m] turned by an angle of that cosine and sine."""
    kappa, strength, _, far = scene.layer
    bound, charges = scene.bodies[b, at.BOUNDING_RADIUS] + far, scene.charges
    fx, fy, torque = 0.0, 0.0, 0.0
    for row in range(scene.first_charge[a], scene.first_charge[a + 1]):
        px, py, extent = charges[row, 0], charges[row, 1], charges[row, 2]
        mx, my = x + cosine * px - sine * py, y + sine * px + cosine * py
        if mx * mx + my * my > (bound + extent) * (bound + extent):
            continue
        for other in range(scene.first_charge[b], scene.first_charge[b + 1]):
            dx, dy = mx - charges[other, 0], my - charges[other, 1]
            most = far + extent + charges[other, 2]
            if dx * dx + dy * dy > most * most:
                continue
            for i in range(int(charges[row, 3])):
                place = at.FIRST_CHARGE + 3 * i
                px, py = charges[row, place], charges[row, place + 1]
                ax, ay = x + cosine * px - sine * py, y + sine * px + cosine * py
                across, up = 0.0, 0.0
                for j in range(int(charges[other, 3])):
                    place_2 = at.FIRST_CHARGE + 3 * j
                    dx, dy = ax - charges[other, place_2], ay - charges[other, place_2 + 1]
                    squared = dx * dx + dy * dy
                    if squared < far * far:
                        size = charges[other, place_2 + 2]
                        size *= bessel_slope(max(kappa * kappa * squared, LEAST))
                        across += size * dx
                        up += size * dy
                across *= charges[row, place + 2]
                up *= charges[row, place + 2]
                fx += across
                fy += up
                torque += ax * up - ay * across
    scale = strength * kappa * kappa
    return scale * fx, scale * fy, scale * torque


def no_charges(scene, a, b, x, y, cosine, sine):
    """There are none."""
    return 0.0, 0.0, 0.0
