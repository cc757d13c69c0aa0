"""The forces between bodies and fluid; subclass one of the six kinds to add your own."""

from flocsim.forces.base import (
    BodyForce,
    CentreForce,
    ContactForce,
    Force,
    OrientedForce,
    OutlineForce,
    PairForce,
    SurfaceForce,
)
from flocsim.forces.body_forces import Gravity, Thermal
from flocsim.forces.contact import Contact
from flocsim.forces.dlvo import DoubleLayer, VanDerWaals
from flocsim.forces.drag import StokesDrag
from flocsim.forces.pair_resistance import Lubrication, PairResistance

__all__ = [
    "BodyForce",
    "CentreForce",
    "Contact",
    "ContactForce",
    "DoubleLayer",
    "Force",
    "Gravity",
    "Lubrication",
    "OrientedForce",
    "OutlineForce",
    "PairForce",
    "PairResistance",
    "StokesDrag",
    "SurfaceForce",
    "Thermal",
    "VanDerWaals",
]
