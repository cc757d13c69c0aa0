"""A force of one's own: two polymer brushes that meet before the bodies do."""

import attrs

from flocsim.fields import quantity
from flocsim.forces import CentreForce


@attrs.frozen
class StericBrush(CentreForce):
    """Repulsion of two polymer brushes, linear in their overlap: F = k (2L − d) for d < 2L.

    Parameters: ``strength`` k [N/m]; ``brush`` L [m], the length of one brush; d is the gap of the
    equivalent spheres.
    """

    strength: float = quantity("N/m", above=0.0)
    brush: float = quantity("m", above=0.0)

    @property
    def reach(self):
        """Brushes that do not meet do nothing: beyond this gap the kernel is not even called."""
        return 2.0 * self.brush

    @staticmethod
    def kernel(pair, strength, reach):
        """Repulsion [N]; parameters are asked for by name, fields and properties alike."""
        return strength * (reach - pair.gap)
