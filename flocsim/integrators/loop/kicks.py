"""Thermal kicks: random forces that are constant for a while; steps end where they change.

Time is cut into kicks of length τ. Each may be halved again and again while bodies are near each
other. In a kick each body feels the mean η of white noise over it, N(0, 1/τ): η = ξ/√τ for a whole
kick, and for the two halves of a kick of length T and mean η

    η ± ξ/√T,

with a number ξ of its own (a Brownian bridge): the halves add up to the whole, so halving a kick
does not change the path that it refines. Each ξ is a function of (seed, replicate), of the body and
of the position of the kick among all kicks. How finely the next kick is cut is decided from the
positions at its start, so no later random number is used.

Random numbers are a stateless function of a counter and a key: Philox 4 × 32 with ten rounds. It is
written so that plain Python and compiled code give the same integers: a product of two 32-bit
numbers wraps around in a signed 64-bit integer, but the bits that are used are the same.

Source: Salmon, Moraes, Dror and Shaw (2011), Parallel random numbers: as easy as 1, 2, 3, SC11.
"""

import math

from flocsim.geometry.contact.points import length_of, separation
from flocsim.integrators.rhs.error import ROUNDING
from flocsim.state.work import NOW

KICK, HALVINGS, SPREAD, LEAST_DISPLACEMENT = range(4)
"""Indices into ``Scene.kicks``: length of the longest kick [s], 0 without kicks; how often it may
be halved; 2 D of two bodies relative to each other [m²/s]; and the displacement per kick below
which none is halved [m]."""

SHARE_OF_GAP = 0.25
"""Largest relative displacement of two bodies in a kick (rms), as a fraction of the gap between
them."""


OVERSHOOT = 0.5826
"""−ζ(½)/√(2π): by so much of √(2 D τ) a path in kicks of τ sees a line that ends it further away,
as it may have crossed it within a kick (Broadie, Glasserman and Kou 1997, Math. Finance 7, 325)."""


def seen_escape(kicks, touch, near, far):
    """Return the distance [m] of two bodies at which kicks show that they have been ``far`` apart.

    They touch at the distance ``touch``, and have begun at ``near``; ``kicks``: those of a Scene.
    """
    kick, halvings, spread, least = kicks
    resolved = max(SHARE_OF_GAP * (far - touch), least) if halvings > 0.0 else math.inf
    overshoot = OVERSHOOT * min(math.sqrt(spread * kick), resolved)
    # Kicks may be longer than the whole way.
    return far - min(overshoot, 0.5 * (far - near))


def has_kicks(scene):
    """Return True if the scene has random forces."""
    return scene.kicks[KICK] > 0.0


def finest_kick(scene):
    """Return the length of the shortest kick [s]."""
    return scene.kicks[KICK] / 2.0 ** scene.kicks[HALVINGS]


def kick_end(scene, work):
    """Return the end of the present kick [s]; inf without kicks."""
    if not has_kicks(scene):
        return math.inf
    return (work.kick.start + work.kick.duration) * finest_kick(scene)


def snap_to_kick_end(scene, work, clock):
    """Set the time to the end of the kick if the step ended there up to rounding."""
    if has_kicks(scene):
        end = kick_end(scene, work)
        if abs(clock.time - end) <= ROUNDING * end:
            clock.time = end


def least_pair_gap(work, pair):
    """Return the least gap of the listed features of two bodies [m]. If none is listed, return half
    of the displacement that remains until they must be listed, a lower bound of it."""
    least = math.inf
    for row in range(work.tally.candidates):
        if work.candidates[row].pair == pair:
            least = min(least, work.geometry[NOW, row].gap)
    return least if least < math.inf else max(0.5 * work.budget[pair], 0.0)


def smallest_gap(scene, work):
    """Return a lower bound of the gap between any two watched bodies [m]."""
    least = math.inf
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        x, y = separation(scene, work, NOW, a, b)
        gap = length_of(x, y)
        # Bounding circles first; if they overlap, the features.
        gap -= scene.bodies[a].bounding_radius + scene.bodies[b].bounding_radius
        if gap <= 0.0:
            gap = least_pair_gap(work, pair)
        least = min(least, gap)
    return least


def kick_duration(scene, work, position):
    """Return the length of the kick that begins at an index, both in units of the shortest kick."""
    duration, longest = 1, 1 << int(scene.kicks[HALVINGS])
    if longest == 1:
        return duration
    # Double it while it is aligned, so that kicks form a binary tree, and while √(2 D t) is
    # allowed.
    allowed = max(SHARE_OF_GAP * smallest_gap(scene, work), scene.kicks[LEAST_DISPLACEMENT])
    spread = scene.kicks[SPREAD] * finest_kick(scene)
    while (
        duration < longest
        and position % (2 * duration) == 0
        and 2 * duration * spread <= allowed * allowed
    ):
        duration *= 2
    return duration


def mean_noise(kick, halvings, position, duration, body, key):
    """Return the mean white noise η of one kick for x, y and the angle [1/√s].

    ``kick`` [s] and ``halvings`` belong to the longest kick; ``position`` and ``duration`` of this
    one are in units of the shortest. ``key`` is a pair of 32-bit words.
    """
    x, y, turn = three_normals(position >> halvings, 0, body, key)
    size = 1.0 / math.sqrt(kick)
    x, y, turn = size * x, size * y, size * turn
    # Descend the Brownian bridge from the longest kick, one halving per level: η ± ξ/√T.
    level, length = 1, 1 << halvings
    while length > duration:
        length >>= 1
        # The first half gets more of what the second gets less of.
        side = size if position & length == 0 else -size
        more_x, more_y, more = three_normals(position >> (halvings - level + 1), level, body, key)
        x, y, turn = x + side * more_x, y + side * more_y, turn + side * more
        size *= math.sqrt(2.0)
        level += 1
    return x, y, turn


def renew_kicks(scene, work, clock):
    """Draw the next kick if the present one has ended."""
    if not has_kicks(scene):
        return
    finest = finest_kick(scene)
    begun = work.kick.start * finest <= clock.time
    if work.kick.duration > 0.0 and begun and clock.time < kick_end(scene, work):
        return
    # The index follows from the time alone; rounding of the quotient is corrected.
    position = int(clock.time / finest)
    while (position + 1) * finest <= clock.time:
        position += 1
    while position * finest > clock.time:
        position -= 1
    duration = kick_duration(scene, work, position)
    work.kick.start, work.kick.duration = float(position), float(duration)
    kick, halvings = scene.kicks[KICK], int(scene.kicks[HALVINGS])
    for body in range(work.kicks.shape[0]):
        who = int(scene.bodies[body].identity)
        noise = mean_noise(kick, halvings, position, duration, who, scene.key)
        work.kicks[body].x, work.kicks[body].y, work.kicks[body].turn = noise
    # Stages extrapolated from the last kick would only mislead Newton's method.
    clock.stages_step = 0.0


LOW = 0xFFFFFFFF
"""Mask of the lower 32 bits."""

# Multipliers and Weyl increments of Philox 4 × 32 (Salmon et al. 2011, section 4).
FIRST_FACTOR, SECOND_FACTOR = 0xD2511F53, 0xCD9E8D57
FIRST_WEYL, SECOND_WEYL = 0x9E3779B9, 0xBB67AE85

ROUNDS = 10

WORD = 2.0**-32
"""One unit of a 32-bit word mapped to [0, 1)."""


def philox(one, two, three, four, key, other):
    """Return four 32-bit words from a counter of four words and a key of two."""
    for _ in range(ROUNDS):
        first, second = FIRST_FACTOR * one, SECOND_FACTOR * three
        one, two, three, four = (
            ((second >> 32) & LOW) ^ two ^ key,
            second & LOW,
            ((first >> 32) & LOW) ^ four ^ other,
            first & LOW,
        )
        key, other = (key + FIRST_WEYL) & LOW, (other + SECOND_WEYL) & LOW
    return one, two, three, four


def three_normals(index, level, body, key):
    """Return three independent standard normal numbers for a node in the tree of kicks.

    ``index`` and ``level`` locate the node, whole numbers from 0; ``body`` is whom it is for;
    ``key`` a pair of 32-bit words. Box–Muller transform.
    """
    one, two, three, four = philox(
        index & LOW, (index >> 32) & LOW, level & LOW, body & LOW, key[0], key[1]
    )
    turn = 2.0 * math.pi * WORD * (two + 0.5)
    size = math.sqrt(-2.0 * math.log(WORD * (one + 0.5)))
    last = math.sqrt(-2.0 * math.log(WORD * (three + 0.5)))
    last *= math.cos(2.0 * math.pi * WORD * (four + 0.5))
    return size * math.cos(turn), size * math.sin(turn), last
