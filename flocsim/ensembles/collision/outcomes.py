"""What becomes of two bodies: missed, held, or a collision that ends bound or departed.

`watch_pair`, the observer, looks at the pair after every accepted step. Departed is a pair that
touched and has parted for good (departure.py), missed one that parted so before it touched; held is
one that has not touched and rests so, one body over the other, in a secondary minimum say; bound is
one that has touched and is proved to stay together (flocsim.bonds).
"""

import flocsim.arrays as at
from flocsim.bonds.bond import NO_BOND
from flocsim.ensembles.collision.departure import has_departed
from flocsim.ensembles.collision.observed import (
    BODY_I,
    BODY_J,
    BOND,
    COLLIDED,
    CROSSED,
    D_COLLISION,
    D_LAST,
    D_MAX,
    INSIDE,
    T_COLLISION,
    ZONE,
)
from flocsim.ensembles.collision.resting import bond_of, rests_for_long
from flocsim.geometry.contact.near_pairs import gap_between
from flocsim.geometry.contact.points import least_listed_gap
from flocsim.integrators.rhs.views import centre_line

BOUND, DEPARTED, MISSED, HELD = 1, 2, 3, 4
"""Codes of the observer."""


def has_not_touched(observed):
    return observed[COLLIDED] == 0.0


def outline_gap(scene, work):
    """Distance between the two outlines now [m], negative where they overlap."""
    return gap_between(scene, work, BODY_J, BODY_I)


def note_collision(observed, time, distance):
    observed[COLLIDED] = 1.0
    observed[INSIDE] = 1.0 if distance < observed[ZONE] else 0.0
    observed[D_COLLISION] = distance
    observed[D_MAX] = distance
    observed[T_COLLISION] = time


def follow(observed, distance):
    """Keep the largest and last centre distance, and whether it crossed D_0."""
    observed[D_LAST] = distance
    if observed[COLLIDED] == 1.0:
        observed[D_MAX] = max(observed[D_MAX], distance)
        inside = 1.0 if distance < observed[ZONE] else 0.0
        if inside != observed[INSIDE]:
            observed[CROSSED] = 1.0


def look_at_pair(scene, work, observed, time):
    """(direction from i to j, d_c, the least gap of the listed features), their first touch and
    their distances noted."""
    nx, ny, distance = centre_line(scene, work, at.NOW, BODY_J, BODY_I)
    gap = least_listed_gap(work)
    if observed[COLLIDED] == 0.0 and gap < 0.0:
        note_collision(observed, time, distance)
    follow(observed, distance)
    return nx, ny, distance, gap


def watch_pair(scene, work, observed, time):
    """The observer: 0 to go on, or BOUND, DEPARTED, MISSED, HELD."""
    nx, ny, distance, gap = look_at_pair(scene, work, observed, time)
    if has_departed(scene, work, observed, time, nx, ny, distance, gap):
        return MISSED if observed[COLLIDED] == 0.0 else DEPARTED
    if observed[COLLIDED] == 0.0:
        return HELD if rests_for_long(scene, work, observed, time) else 0
    observed[BOND] = bond_of(scene, work, observed, time)
    return 0 if observed[BOND] == NO_BOND else BOUND
