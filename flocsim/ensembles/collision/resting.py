"""What the observer of a pair knows of its bond: the load, and how long it has kept its pose.

The proofs are those of flocsim.bonds. In a flow the load comes from everywhere, as the doublet
turns round in it, and the rest time is that of a whole turn.
"""

import math

import flocsim.arrays as at
from flocsim.bonds.bond import CERTIFICATE, Load, bond_between, doublet_pose, way_between
from flocsim.bonds.certificate import is_certain, is_certain_in_kicks
from flocsim.bonds.rest import FAR_LONGER, STILL, kind_at_rest, swings
from flocsim.ensembles.collision.observed import (
    BODY_I,
    BODY_J,
    DRIFT_X,
    DRIFT_Y,
    IN_FLOW,
    KICK_ENERGY,
    LOAD,
    REST_ANGLE,
    REST_SINCE,
    REST_TIME,
    REST_X,
    REST_Y,
)


def load_on(observed):
    """The Load on the bond of the two."""
    drift = math.hypot(observed[DRIFT_X], observed[DRIFT_Y])
    x, y = observed[DRIFT_X] / drift, observed[DRIFT_Y] / drift
    if observed[IN_FLOW] != 0.0:
        x, y = 0.0, 0.0
    return Load(observed[LOAD], drift, x, y, 0.0, 1.0, observed[KICK_ENERGY])


def start_rest(scene, work, observed, time):
    """From now on the doublet may be resting as it is."""
    observed[REST_SINCE] = time
    pose = doublet_pose(scene, work, at.NOW, BODY_I, BODY_J)
    observed[REST_X], observed[REST_Y], observed[REST_ANGLE] = pose


def rest_of(scene, work, observed, time, load):
    """How long the doublet has kept its pose without swinging, in rest times."""
    before = observed[REST_X], observed[REST_Y], observed[REST_ANGLE]
    pose = doublet_pose(scene, work, at.NOW, BODY_I, BODY_J)
    moved = way_between(scene, BODY_I, BODY_J, pose, before)
    if moved > STILL * load.drift * observed[REST_TIME]:
        start_rest(scene, work, observed, time)
        return 0.0
    if swings(scene, work, BODY_I, BODY_J, load):
        return 0.0
    return (time - observed[REST_SINCE]) / observed[REST_TIME]


def rests_for_long(scene, work, observed, time):
    """Whether two bodies have kept still against each other far longer than the rest time."""
    return rest_of(scene, work, observed, time, load_on(observed)) >= FAR_LONGER


def bond_of(scene, work, observed, time):
    """The kind of bond of two bodies that have touched, NO_BOND where none is proved."""
    bond, load = bond_between(scene, work, time, BODY_I, BODY_J), load_on(observed)
    if is_certain(scene, work, time, bond, load):
        return CERTIFICATE
    rested = rest_of(scene, work, observed, time, load)
    return kind_at_rest(scene, work, time, bond, load, rested)


def bond_in_kicks(scene, work, observed, time):
    """The same where kicks may open it."""
    bond, load = bond_between(scene, work, time, BODY_I, BODY_J), load_on(observed)
    if is_certain_in_kicks(scene, work, time, bond, load):
        return CERTIFICATE
    rested = rest_of(scene, work, observed, time, load)
    return kind_at_rest(scene, work, time, bond, load, rested)
