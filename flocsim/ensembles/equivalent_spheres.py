"""What integrals say of the equivalent spheres of a brownian study: how often they would touch, and
how much their interaction slows down their coagulation.

In the plane, where the study is, so many of two spheres that are let go at a distance r touch
before they are b apart: ln(b/r)/ln(b/(r_i + r_j)) without forces between them. What shapes do
beyond that is the difference to these. The stability ratio W is that of three dimensions.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from flocsim.brownian.splitting import splitting_probability, stability_ratio
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.flocs import Floc
from flocsim.ensembles.config.pair_scene import BROWNIAN
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.preflight import sphere_pairs
from flocsim.forces.thermal import thermal_in


def sphere_facts(config: Config, flocs: Sequence[Floc] | None = None) -> list[dict]:
    """[{type, release, escape [m], diffusion [m²/s], free, touch, stability}] of the collision
    types of a brownian study, nothing of others.

    ``free`` and ``touch``: probabilities to touch without and with the forces between the spheres;
    what is no number, as for a potential beyond all bounds, is None.
    """
    return [
        {"type": name, **facts_of(pair)}
        for name, pair in sphere_pairs(config, flocs)
        if pair.meeting == BROWNIAN
    ]


def facts_of(pair: Encounter) -> dict[str, Any]:
    """The same of one pair of spheres."""
    system, (near, far) = pair.system, pair.ends
    radius_i, radius_j = (shape.equivalent_radius for shape in pair.shapes)
    radii = radius_i, radius_j
    [thermal] = thermal_in(system.forces)
    known: dict[str, Any] = {"temperature": thermal.temperature, "fluid": system.fluid}
    with np.errstate(all="ignore"):
        found = {
            "free": splitting_probability([], radii, near, far, **known),
            "touch": splitting_probability(system.forces, radii, near, far, **known),
            "stability": stability_ratio(system.forces, radii, **known),
        }
    plain = {name: value if math.isfinite(value) else None for name, value in found.items()}
    return {"release": near, "escape": far, "diffusion": pair.diffusion} | plain
