"""The tangential elastic displacement of contacts while a step is taken."""

from flocsim.integrators.views import contact_view, normal_rate, tangential_rate
from flocsim.layout import CANDIDATES
from flocsim.slots import slip_limit


def limited_slip(scene, view):
    """The view's slip, cut to what the contact can hold."""
    limit = slip_limit(view, scene.parameters)
    return min(max(view.slip, -limit), limit)


def advance_slips(scene, work, speed, slips, new_slips, step):
    """ξ + step · v_t of the pairs that overlap; zero for all others."""
    for row in range(work.tally[CANDIDATES]):
        work.slip[new_slips, row] = 0.0
        overlap = -work.geometry[row, 2]
        if overlap > 0.0:
            rate = tangential_rate(work, speed, row)
            overlap_rate = -normal_rate(work, speed, row)
            slip = work.slip[slips, row] + step * rate
            view = contact_view(scene, work, row, overlap, overlap_rate, slip, rate)
            work.slip[new_slips, row] = limited_slip(scene, view)
