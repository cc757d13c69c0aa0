"""Rests: bonds that have shown to hold, by keeping their pose while the load was at its worst.

Where attraction could not carry the load, and the contacts do by themselves (statics.py), such a
bond is a hook; what merely has kept its pose is a rest. A rest shows that the doublet holds, not
that no kick could open it. Where thermal motion kicks, spheres rest where BARRIER k_B T keep them
in their attraction against the load, and shapes, whose contacts no potential tells of, where it
takes as much to lift one by the smaller spheroradius against it.
"""

import math

import flocsim.arrays as at
from flocsim.bonds.bond import HOOK, NO_BOND, REST, are_spheres, radii_of
from flocsim.bonds.certificate import CALM, capacity, lets_out
from flocsim.bonds.statics import is_hooked
from flocsim.integrators.rhs.climb import BARRIER

STILL = 1e-3
"""A pair that has moved by less than this share of the drift's way keeps its pose."""

HANGING = 0.99
"""Cosine between line of centres and drift above which the load is at its worst."""

NEST = 0.1
"""Centres nearer than this share of r_i + r_j lie nested: the load has no lever to turn them, …"""

FAR_LONGER = 10.0
"""… and they are bound when they have rested for so many rest times."""

REST_TURNS = 3.0
"""Automatic rest time, in turn times (r_i + r_j)/|relative drift|."""


def swings(scene, work, i, j, load):
    """Whether a doublet that turns to hang still swings: it passes the worst direction of its load,
    but may yet be thrown open. One that any load may meet turns with the flow, or its cluster."""
    outer = scene.bodies[i, at.BOUNDING_RADIUS] + scene.bodies[j, at.BOUNDING_RADIUS]
    turns = load.x != 0.0 or load.y != 0.0
    return turns and abs(work.motion[at.NOW, i, at.SPIN]) * outer > CALM * load.drift


def has_shown(scene, bond, load, rested):
    """Whether a pose kept for so many rest times shows that the bond holds.

    The load is at its worst where the faster body hangs straight below; a fixed receiver cannot
    turn, so it need not, nor one whose load comes from everywhere; a nest, or a pair across a
    barrier, has to keep its pose for far longer.
    """
    near = bond.gap >= 0.0 or bond.distance < NEST * radii_of(scene, bond)
    if near and rested >= FAR_LONGER:
        return True
    hangs = bond.nx * load.x + bond.ny * load.y >= HANGING or (load.x == 0.0 and load.y == 0.0)
    hangs = hangs or scene.bodies[bond.i, at.FREE] == 0.0 or scene.bodies[bond.j, at.FREE] == 0.0
    return bond.gap < 0.0 and hangs and rested >= 1.0


def outlasts_kicks(scene, work, time, bond, load):
    """Whether kicks let the bond rest."""
    barrier = BARRIER * load.kicks
    if not are_spheres(scene, bond):
        radii = scene.bodies[bond.i, at.RADIUS], scene.bodies[bond.j, at.RADIUS]
        return load.force > 0.0 and load.force * min(radii[0], radii[1]) >= barrier
    return load.force > 0.0 and not lets_out(scene, work, time, bond, load.force, barrier)


def kind_at_rest(scene, work, time, bond, load, rested):
    """HOOK or REST of a bond whose pose has been kept for so many rest times, or NO_BOND."""
    if not has_shown(scene, bond, load, rested):
        return NO_BOND
    if load.kicks > 0.0 and not outlasts_kicks(scene, work, time, bond, load):
        return NO_BOND
    borne, _, _ = capacity(scene, work, time, bond, 0.0, (load.force, -1.0, math.inf))
    return HOOK if borne <= load.force and is_hooked(scene, work, bond, load) else REST
