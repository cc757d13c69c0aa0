"""The numbers of the observer of a collision: what it is given, and what it finds."""

(
    ZONE, ESCAPE, REST_TIME, DRIFT_X, DRIFT_Y, MOBILITY_I, MOBILITY_J, LOAD,
    COLLIDED, INSIDE, CROSSED, D_COLLISION, D_MAX, D_LAST, T_COLLISION, BOND,
    REST_SINCE, REST_X, REST_Y, REST_ANGLE, IN_FLOW, FLOW_XX, FLOW_XY, FLOW_YX, FLOW_YY,
    KICK_ENERGY, BROWNIAN, CAGE_LOW, CAGE_HIGH,
    OBSERVED_SIZE,
) = range(30)  # fmt: skip
"""Columns of `observed`. Given: D_0 [m], escape gap [m], rest time [s], velocity of j relative to i
in settling, or about that in a flow [m/s], largest mobilities [s/kg], the largest load that
settling, or the flow, can put on a bond [N]; whether they meet in a flow alone, and its gradient
[1/s]; k_B T [J], 0 without kicks, whether they meet by thermal motion alone, when ESCAPE is the
distance of their centres [m], and the gaps [m] of a secondary minimum between which kicks do not
let a pair out. Found: flags, centre distances [m], time [s], the kind of
bond (flocsim.bonds), and since when the doublet has been resting in which pose."""

BODY_I, BODY_J = range(2)
"""The two bodies of an encounter: the receiver, and the one that it meets."""
