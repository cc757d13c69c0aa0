"""flocsim: when two flocs of real shape meet in water, do they collide, and do they stick?"""

from flocsim.body import Body, Fluid
from flocsim.geometry.sphere import Sphere
from flocsim.geometry.spheropolygon import SpheroPolygon
from flocsim.system import System, Trajectory

__version__ = "0.1.0"

__all__ = ["Body", "Fluid", "Sphere", "SpheroPolygon", "System", "Trajectory", "__version__"]
