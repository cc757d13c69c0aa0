"""Two distances of a pair: where it begins, j above i, displaced sideways, a gap apart; and D_0.

The attraction zone is d_c < D_0: where van der Waals attraction and double-layer repulsion balance.

With x = κ d, F_A = F_R reads x² exp(−x) = S, S = H_A κ/(24π ε0 ε_r φ²): sizes cancel. It has two
roots where S ≤ 4/e², x = −2 W₀(−√S/2) (inner) and −2 W₋₁(−√S/2) (outer), W Lambert's function, and
none above.
"""

import math
from collections.abc import Sequence

import numpy as np

from flocsim.ensembles.config.schema import ZoneConfig
from flocsim.errors import ZoneError
from flocsim.forces import DoubleLayer, VanDerWaals
from flocsim.forces.base import Force
from flocsim.geometry.shapes.shape import Shape
from flocsim.state.records import Record

LARGEST_RATIO = 4.0 / math.e**2
"""S above which attraction wins at every distance."""


def half_widths(shape: Shape, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the half-extents [m] at many angles."""
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    # Each part by its own spheroradius: the widest part need not be the one that reaches farthest.
    ends = [(c * p.points[:, 0] - s * p.points[:, 1], p.radius) for p in shape.parts]
    return (
        np.max([radius - x.min(axis=1) for x, radius in ends], axis=0),
        np.max([radius + x.max(axis=1) for x, radius in ends], axis=0),
    )


def half_extent(bodies, body, radius, angle, side):
    """Return the extent of a turned outline from its centroid [m], towards +x (``side`` 1) or −x
    (−1); ``radius``: its spheroradius."""
    vertices, largest = bodies.vertices, -math.inf
    across, along = side * math.cos(angle), -side * math.sin(angle)
    for point in range(bodies.first[body], bodies.first[body + 1]):
        reach = vertices[point].x * across + vertices[point].y * along
        largest = max(largest, reach + vertices[point].excess_radius)
    return largest + radius


def grazing_offset(bodies, angle_i, angle_j, radius_i, radius_j):
    """Return the displacement [m] at which the outlines of i and j just graze as j passes on the
    right: the sum of the half-extents that face each other."""
    right = half_extent(bodies, 0, radius_i, angle_i, 1.0)
    return right + half_extent(bodies, 1, radius_j, angle_j, -1.0)


def top_of_edge(ax, ay, bx, by, radius, x):
    """Return the height [m] of the top, at x, of the edge from a to b swept by a disk of a radius;
    −inf beside it."""
    if x < min(ax, bx) - radius or x > max(ax, bx) + radius:
        return -math.inf
    top, length = -math.inf, math.hypot(bx - ax, by - ay)
    # The disks around both ends.
    if abs(x - ax) <= radius:
        top = ay + math.sqrt(radius * radius - (x - ax) * (x - ax))
    if abs(x - bx) <= radius:
        top = max(top, by + math.sqrt(radius * radius - (x - bx) * (x - bx)))
    # The side between them, which is the edge shifted along its upper normal.
    if bx != ax:
        along = (x - ax) / (bx - ax) + radius * (by - ay) / (length * abs(bx - ax))
        if 0.0 <= along <= 1.0:
            top = max(top, ay + along * (by - ay) + radius * abs(bx - ax) / length)
    return top


def start_height(bodies, angle_i, angle_j, contact, reach, displacement, gap):
    """Return the height of j's centroid over i's [m] at which the outlines are ``gap`` apart as j
    comes straight down.

    ``bodies``: the Scene of i and j, or their Outlines; ``contact`` = r_i + r_j of the
    spheroradii; ``reach`` = R_i + R_j. Where j passes without coming so near, it starts clear
    above.
    """
    vertices, highest = bodies.vertices, -math.inf
    ci, si, cj, sj = math.cos(angle_i), math.sin(angle_i), math.cos(angle_j), math.sin(angle_j)
    # The highest of all contacts of a vertex of one with an edge of the other, widened by the sum
    # of their radii and the gap.
    for point in range(bodies.first[1], bodies.first[2]):
        end = point + vertices[point].edge_offset
        x = displacement + cj * vertices[point].x - sj * vertices[point].y
        y = sj * vertices[point].x + cj * vertices[point].y
        end_x = displacement + cj * vertices[end].x - sj * vertices[end].y
        end_y = sj * vertices[end].x + cj * vertices[end].y
        for other in range(bodies.first[0], bodies.first[1]):
            stop = other + vertices[other].edge_offset
            other_y = si * vertices[other].x + ci * vertices[other].y
            stop_y = si * vertices[stop].x + ci * vertices[stop].y
            wide = contact + gap + vertices[point].excess_radius + vertices[other].excess_radius
            # Most lie too low to count.
            if max(other_y, stop_y) + wide - min(y, end_y) <= highest:
                continue
            other_x = ci * vertices[other].x - si * vertices[other].y
            stop_x = ci * vertices[stop].x - si * vertices[stop].y
            highest = max(highest, top_of_edge(other_x, other_y, stop_x, stop_y, wide, x) - y)
            # The other's vertex under the edge: mirrored, it is above.
            highest = max(highest, other_y + top_of_edge(x, -y, end_x, -end_y, wide, other_x))
    clear = reach + gap
    return highest if highest > -clear else clear


class Start(Record):
    """Where a replicate begins: i at the origin, j beside it."""

    angle_i: float  # orientations [rad]
    angle_j: float
    x: float  # of j's centroid from i's [m]; of a pair that settles both follow from what is below
    y: float
    vx_i: float  # velocities [m/s] and spins [rad/s]
    vy_i: float
    spin_i: float
    vx_j: float
    vy_j: float
    spin_j: float
    gap: float  # distance of the outlines as j comes straight down [m]; 0: the pair does not settle
    share: float  # displacement of j over δ_max
    largest: float  # δ_max [m]; 0: that at which the outlines just graze
    clear: float  # least distance of the centroids [m]; 0: any
    reach: float  # R_i + R_j [m]
    radius_i: float  # spheroradii [m]
    radius_j: float


def place_of(bodies, start):
    """Return where j's centroid starts from i's, (x, y) [m].

    Parameters
    ----------
    bodies : Scene or Outlines
        Those of i and j.
    start : Start
        What is given.
    """
    if start.gap == 0.0:
        return start.x, start.y
    angle_i, angle_j, largest = start.angle_i, start.angle_j, start.largest
    if largest == 0.0:
        largest = grazing_offset(bodies, angle_i, angle_j, start.radius_i, start.radius_j)
    x, contact = start.share * largest, start.radius_i + start.radius_j
    y = start_height(bodies, angle_i, angle_j, contact, start.reach, x, start.gap)
    if abs(x) < start.clear:
        y = max(y, math.sqrt(start.clear * start.clear - x * x))
    return x, y


def attraction_ratio(attraction: VanDerWaals, layer: DoubleLayer) -> float:
    """Return S = H_A κ/(24π ε0 ε_r φ_i φ_j) [-]; inf without repulsion."""
    if layer.strength <= 0.0:
        return math.inf
    return attraction.hamaker / (6.0 * layer.strength * layer.debye_length**2)


def neutral_distance(attraction: VanDerWaals, layer: DoubleLayer, root: str) -> float:
    """Return d_0 [m], the ``root`` ("inner" or "outer") of F_A = F_R; ZoneError where there is
    none."""
    ratio = attraction_ratio(attraction, layer)
    if ratio > LARGEST_RATIO:
        raise ZoneError(
            f"no attraction zone: van der Waals attraction exceeds double-layer repulsion at every "
            f"distance, S = {ratio:.4g} > 4/e² = {LARGEST_RATIO:.4f}, so that F_A = F_R has no "
            f"root; raise forces.double_layer.potential or debye_length, lower "
            f"forces.van_der_waals.hamaker, or give zone.distance or zone.centre"
        )
    if ratio <= 0.0:
        raise ZoneError(
            "no attraction zone: without attraction F_A = F_R has no root; raise "
            "forces.van_der_waals.hamaker, or give zone.distance or zone.centre"
        )
    return balance(ratio, root) * layer.debye_length


def balance(ratio: float, root: str) -> float:
    """Return x [-] at which x² exp(−x) is a ratio up to 4/e², below 2 ("inner") or above ("outer").

    Newton's method on 2 ln x − x, which is concave: from outside of a root it comes nearer with
    every step and never passes it.
    """
    x = math.sqrt(ratio) if root == "inner" else 4.0 - 2.0 * math.log(ratio)
    for _ in range(100):
        above = 2.0 * math.log(x) - x - math.log(ratio)
        if above >= 0.0 or x == 2.0:
            break
        x -= above / (2.0 / x - 1.0)
    return x


def only_one(forces, kind):
    found = [force for force in forces if isinstance(force, kind)]
    if len(found) != 1:
        raise ZoneError(
            f"zone.root needs just one {kind.__name__} force to balance, found {len(found)}; give "
            "zone.distance or zone.centre instead"
        )
    return found[0]


def zone_distance(
    zone: ZoneConfig, forces: Sequence[Force], radius_i: float, radius_j: float
) -> float:
    """Return D_0 [m], the centre distance within which a pair counts as inside the zone."""
    if zone.centre is not None:
        return zone.centre
    if zone.distance is not None:
        return radius_i + radius_j + zone.distance
    both = only_one(forces, VanDerWaals), only_one(forces, DoubleLayer)
    return radius_i + radius_j + neutral_distance(*both, zone.root or "outer")
