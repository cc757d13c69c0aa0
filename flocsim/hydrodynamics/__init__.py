"""How slow flow resists bodies.

two_spheres: the resistance functions of two unequal spheres, exactly; pair: what follows from them
for motion in a plane; encounters: which of two spheres that meet touch; rigid_bodies: the drag of a
floc's outline, of spheres that water passes through, and of clusters of bodies. May import
geometry, compiler and errors.
"""

from flocsim.hydrodynamics.encounters import Meeting, bend
from flocsim.hydrodynamics.pair import Relative, SpherePair
from flocsim.hydrodynamics.rigid_bodies import PrismDrag, happel_permeability, prism_drag
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
