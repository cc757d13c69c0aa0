"""Swarms that several tests run: one set of forces, so that they share what is compiled."""

import numpy as np

from flocsim import Body, Sphere
from flocsim.body import Fluid
from flocsim.forces import Contact, Gravity, StokesDrag

R = 5e-6
WATER = Fluid(buoyancy=True)


def forces(gravity=9.81, **contact):
    """Gravity, drag and contact."""
    return [Gravity(gravity), StokesDrag(), Contact(**contact)]


def crowd(count, seed, speed=5e-4, spread=0.3, fraction=0.3, centre=(0.0, 0.0)):
    """(discs of several sizes at random places of a square, flying about; its side [m]): they fill
    a fraction of it and do not overlap, not even round its seams."""
    rng = np.random.default_rng([seed, count])
    radii = np.sort(R * np.exp(spread * rng.normal(size=count)))[::-1]
    side = float(np.sqrt(np.pi * np.sum(radii**2) / fraction))
    places: list = []
    for radius in radii:
        for _ in range(10_000):
            place = rng.uniform(0.0, side, 2)
            apart = np.array([place - other for other in places]).reshape(-1, 2)
            apart -= side * np.round(apart / side)
            if np.all(np.hypot(*apart.T) > 1.02 * (radius + radii[: len(places)])):
                break
        else:
            raise AssertionError("no place is left")
        places.append(place)
    velocity = speed * rng.normal(size=(count, 2))
    return [
        Body(Sphere(radius), tuple(place + centre), 0.0, tuple(flying), density=2650.0)
        for radius, place, flying in zip(radii, places, velocity, strict=True)
    ], side
