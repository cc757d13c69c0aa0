"""How far the bodies of a pair have rolled and slid over each other between two states.

The rate v_t of the tangential displacement is the rate of a sum of lengths: of the foot along its
edge, of the normal's turn about an end of it, and of what the vertex's disk rolls off,

    dξ = ± ds + D (dφ − dθ_b) + r (dθ_b − dθ_a),

s the foot's place on the edge, φ the direction of the normal, D = r_a + r_b + gap, and
r = r_a + gap/2 the radius at which the disk of the vertex rolls. On the edge's inside the normal
turns with the edge, and at its end the foot stays, so that one formula serves both. Between two
states the displacement is therefore known from where the bodies are, whatever a method makes of the
motion in between: a doublet that turns as one has none, however long its steps. What is left to be
summed over a step is next to nothing: D and r change with the gap, by its change times the turn.
"""

import math

import flocsim.arrays as at
from flocsim.geometry.contact.points import row_radii
from flocsim.integrators.rhs.views import tangential_rate


def turn_of_normal(work, state, row):
    """The angle by which the normal of a pair has turned since now, within half a turn [rad]."""
    g = work.geometry
    ox, oy = g[at.NOW, row, at.NORMAL_X], g[at.NOW, row, at.NORMAL_Y]
    nx, ny = g[state, row, at.NORMAL_X], g[state, row, at.NORMAL_Y]
    return math.atan2(ox * ny - oy * nx, ox * nx + oy * ny)


def rolled(scene, work, state, row):
    """How far the tangential displacement of a pair has grown from now to a state, at the gap of
    now [m]; both are located."""
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    g = work.geometry
    radius_a, radius_b = row_radii(scene, work, row)
    gap = g[at.NOW, row, at.GAP]
    turn_a = work.motion[state, a, at.ANGLE] - work.motion[at.NOW, a, at.ANGLE]
    turn_b = work.motion[state, b, at.ANGLE] - work.motion[at.NOW, b, at.ANGLE]
    inside = at.NOW if g[at.NOW, row, at.TURNING] == 0.0 else state
    along = g[inside, row, at.SIDE] * (g[state, row, at.FOOT] - g[at.NOW, row, at.FOOT])
    about = turn_of_normal(work, state, row) - turn_b
    rolling = (radius_a + 0.5 * gap) * (turn_b - turn_a)
    return along + (radius_a + radius_b + gap) * about + rolling


def rolled_besides(scene, work, state, row):
    """How fast it grows besides, in a state, as the gap is another one than now [m/s]."""
    a, b = work.candidates[row, at.VERTEX_BODY], work.candidates[row, at.EDGE_BODY]
    g, spin_b = work.geometry, work.motion[state, b, at.SPIN]
    radius_a, radius_b = row_radii(scene, work, row)
    gap, apart = g[state, row, at.GAP], g[state, row, at.GAP] - g[at.NOW, row, at.GAP]
    relative = spin_b - work.motion[state, a, at.SPIN]
    about = 0.0
    if g[state, row, at.TURNING] != 0.0:
        rolling = (radius_a + 0.5 * gap) * relative
        about = (tangential_rate(work, state, row) - rolling) / (radius_a + radius_b + gap)
    return apart * (about + 0.5 * relative)
