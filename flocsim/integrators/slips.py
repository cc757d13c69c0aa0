"""What contacts can hold: the limit of their tangential displacements."""

from flocsim.integrators.views import contact_view
from flocsim.layout import CANDIDATES, CLOSED, NEW
from flocsim.slots import slip_limit


def limit_slips(scene, work):
    """Cut the displacements of the closed pairs in NEW to what they can hold there."""
    for row in range(work.tally[CANDIDATES]):
        if work.candidates[row, CLOSED] == 1:
            limit = slip_limit(contact_view(scene, work, NEW, row), scene.parameters)
            work.slip[NEW, row] = min(max(work.slip[NEW, row], -limit), limit)
