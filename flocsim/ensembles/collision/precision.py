"""How accurate a run is: a replicate as a plain System, and how far two ends are apart."""

import attrs
import numpy as np

from flocsim.arrays import NOW


def placed(body, motion):
    """A body at a place and velocity: motion is x, y, angle, vx, vy, spin."""
    x, y, angle, vx, vy, spin = map(float, motion)
    return attrs.evolve(body, position=(x, y), angle=angle, velocity=(vx, vy), spin=spin)


def replicate_system(encounter, angles, share, integrator=None):
    """The System of an Encounter where a replicate starts, with another integrator if given."""
    system = encounter.system
    starts = encounter.start(angles, share).motion[NOW]
    bodies = tuple(placed(b, motion) for b, motion in zip(system.bodies, starts, strict=True))
    return attrs.evolve(system, bodies=bodies, integrator=integrator or system.integrator)


def end_distance(bodies, position, exact):
    """The furthest [m] that any point of an outline is from where it ought to be.

    ``position`` and ``exact`` (n, 3): x, y [m] and angle [rad] of the bodies at the end of two
    runs. Largest |Δx| + R |Δθ| of a body, R its largest centroid-to-outline distance.
    """
    sizes = np.array([body.shape.bounding_radius for body in bodies])
    shift = np.hypot(*(position[:, :2] - exact[:, :2]).T)
    return float(np.max(shift + sizes * np.abs(position[:, 2] - exact[:, 2])))
