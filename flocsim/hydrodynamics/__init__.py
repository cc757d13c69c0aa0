"""How slow flow resists bodies.

two_spheres: the resistance functions of two unequal spheres, exactly; pair: what follows from them
for motion in a plane; encounters: which of two spheres that meet touch; prism: the drag of a
floc's outline; clusters: how rigid clusters of bodies move; permeable: spheres that water passes
through. May import geometry, compiler and errors.
"""

from flocsim.hydrodynamics.encounters import Meeting, bend
from flocsim.hydrodynamics.pair import Relative, SpherePair
from flocsim.hydrodynamics.permeable import happel_permeability
from flocsim.hydrodynamics.prism import PrismDrag, prism_drag
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
