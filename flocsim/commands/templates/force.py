import attrs

from flocsim.fields import quantity
from flocsim.forces import CentreForce


@attrs.frozen
class Mine(CentreForce):
    strength: float = quantity("N/m", above=0.0)
    length: float = quantity("m", above=0.0)

    @staticmethod
    def kernel(pair, strength, length):  # repulsion [N] at a gap of the equivalent spheres
        return strength * max(length - pair.gap, 0.0)
