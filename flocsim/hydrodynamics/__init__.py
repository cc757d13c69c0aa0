"""How slow flow resists bodies.

two_spheres: the resistance functions of two unequal spheres, exactly; pair: what follows from them
for motion in a plane; encounters: which of two spheres that meet touch; lone_body: the drag of a
floc's outline, and of spheres that water passes through; clusters: how rigid clusters of bodies
move. May import geometry, compiler and errors.
"""

from flocsim.hydrodynamics.encounters import Meeting, bend
from flocsim.hydrodynamics.lone_body import PrismDrag, happel_permeability, prism_drag
from flocsim.hydrodynamics.pair import Relative, SpherePair
from flocsim.hydrodynamics.two_spheres import TwoSpheres

__all__ = [
    "Meeting",
    "PrismDrag",
    "Relative",
    "SpherePair",
    "TwoSpheres",
    "bend",
    "happel_permeability",
    "prism_drag",
]
