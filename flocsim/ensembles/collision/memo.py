"""Places in the memo of a binary collision's observer (flocsim.ensembles.collision.outcomes)."""

(
    ZONE, ESCAPE, REST_TIME, DRIFT_X, DRIFT_Y, MOBILITY_I, MOBILITY_J,
    COLLIDED, INSIDE, CROSSED, D_COLLISION, D_MAX, D_LAST, T_COLLISION,
    REST_SINCE, REST_X, REST_Y, REST_ANGLE, MEMO_SIZE,
) = range(19)  # fmt: skip
"""The observer's memo. Given: D_0 [m], escape gap [m], rest time [s], settling velocity of j
relative to i [m/s], mobilities [s/kg]. Found: flags, centre distances [m], times [s]."""
