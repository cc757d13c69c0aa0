"""How slow flow resists bodies.

two_spheres: the resistance functions of two unequal spheres, exactly; pair: what follows from them
for motion in a plane; encounters: which of two spheres that meet touch. May import errors.
"""

from flocsim.hydrodynamics.encounters import Meeting
from flocsim.hydrodynamics.pair import Relative, SpherePair
from flocsim.hydrodynamics.two_spheres import TwoSpheres

__all__ = ["Meeting", "Relative", "SpherePair", "TwoSpheres"]
