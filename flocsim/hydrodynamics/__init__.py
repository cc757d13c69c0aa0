"""Hydrodynamic resistance in slow (Stokes) flow.

two_spheres: exact resistance functions of two unequal spheres. pair: resistance and mobility of two
spheres for motion in a plane. encounters: collision efficiency of two spheres. rigid_bodies: drag
of floc outlines, permeable spheres, and clusters of bodies. May import geometry, compiler and
errors.
"""

from flocsim.hydrodynamics.encounters import Meeting, bend, bend_in_flow
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
    "bend_in_flow",
    "happel_permeability",
    "prism_drag",
]
