"""Kicks: random forces that stay the same for a while, steps ending where they change.

Time is cut into kicks of τ, and each of these may be halved, and halved again, where bodies are
near each other. What a body gets in a kick is the mean η of white noise over it, N(0, 1/τ): ξ/√τ
of a whole kick; and of the halves of one that lasts T and has the mean η,

    η ± ξ/√T,

with a number ξ of its own: a Brownian bridge, so that the halves add up to the whole, and that a
kick is halved changes nothing of where the path leads. All ξ are functions of (seed, replicate),
of the body, and of the kick's place among all kicks. How finely the next kick is cut is
decided where it begins, by where the bodies are then, so that no later chance is used.

Random numbers are a function of what they are for, of a counter and a key, without a state:
Philox 4 × 32 with ten rounds, written so that the same integers come out in plain Python and in
compiled code, where a product of two of 32 bits wraps around in a signed 64-bit integer: the bits
that are kept are the same.

Source: Salmon, Moraes, Dror and Shaw (2011), Parallel random numbers: as easy as 1, 2, 3, SC11.
"""

import math

from flocsim.geometry.contact.points import length_of, separation
from flocsim.state.work import NOW

KICK, HALVINGS, SPREAD, LEAST_WAY = range(4)
"""Places in ``Scene.kicks``: how long the longest kick is [s], 0 where there are none; how often it
may be halved; 2 D of two bodies against each other [m²/s]; and the way in a kick below which none
is halved [m]."""

SHARE_OF_GAP = 0.25
"""A kick moves two bodies against each other by this share of the gap between them, at most."""

SAME_TIME, ROUNDED = 1e-9, 1e-15
"""A step that ends within this share of a kick, or of the time, from its end has ended there."""


def has_kicks(scene):
    """Whether a scene has random forces."""
    return scene.kicks[KICK] > 0.0


def finest_kick(scene):
    """The shortest kick [s]."""
    return scene.kicks[KICK] / 2.0 ** scene.kicks[HALVINGS]


def kick_end(scene, work):
    """When the present kick ends [s]; inf where there are none."""
    if not has_kicks(scene):
        return math.inf
    return (work.kick.at + work.kick.span) * finest_kick(scene)


def meet_kick(scene, work, clock):
    """Let a step that has ended with the kick, but for rounding, end just there."""
    if has_kicks(scene):
        end = kick_end(scene, work)
        near = SAME_TIME * work.kick.span * finest_kick(scene)
        if abs(clock.time - end) <= max(near, ROUNDED * clock.time):
            clock.time = end


def listed_gap(work, pair):
    """The least gap of the listed features of two bodies [m]; half of what is left until they must
    be listed anew where none is."""
    least = math.inf
    for row in range(work.tally.candidates):
        if work.candidates[row].pair == pair:
            least = min(least, work.geometry[NOW, row].gap)
    return least if least < math.inf else max(0.5 * work.budget[pair], 0.0)


def nearest(scene, work):
    """How near any two bodies that are watched are, at least [m]."""
    least = math.inf
    for pair in range(work.tally.pairs):
        a, b = work.pairs[pair].later, work.pairs[pair].earlier
        x, y = separation(scene, work, NOW, a, b)
        gap = length_of(x, y)
        gap -= scene.bodies[a].bounding_radius + scene.bodies[b].bounding_radius
        if gap <= 0.0:
            gap = listed_gap(work, pair)
        least = min(least, gap)
    return least


def span_from(scene, work, place):
    """How many of the shortest kicks the one from a place on lasts."""
    span, longest = 1, 1 << int(scene.kicks[HALVINGS])
    if longest == 1:
        return span
    allowed = max(SHARE_OF_GAP * nearest(scene, work), scene.kicks[LEAST_WAY])
    spread = scene.kicks[SPREAD] * finest_kick(scene)
    while span < longest and place % (2 * span) == 0 and 2 * span * spread <= allowed * allowed:
        span *= 2
    return span


def mean_noise(kick, halvings, place, span, body, key):
    """η of one kick for x, y and the angle [1/√s].

    ``kick`` [s] and ``halvings`` of the longest; ``place`` and ``span`` in the shortest.
    """
    x, y, turn = three_normals(place >> halvings, 0, body, key)
    size = 1.0 / math.sqrt(kick)
    x, y, turn = size * x, size * y, size * turn
    level, length = 1, 1 << halvings
    while length > span:
        length >>= 1
        # The first half gets more of what the second gets less of.
        side = size if place & length == 0 else -size
        more_x, more_y, more = three_normals(place >> (halvings - level + 1), level, body, key)
        x, y, turn = x + side * more_x, y + side * more_y, turn + side * more
        size *= math.sqrt(2.0)
        level += 1
    return x, y, turn


def renew_kicks(scene, work, clock):
    """Begin the next kick where the present one has ended."""
    if not has_kicks(scene):
        return
    finest = finest_kick(scene)
    begun = work.kick.at * finest <= clock.time
    if work.kick.span > 0.0 and begun and clock.time < kick_end(scene, work):
        return
    place = int(clock.time / finest)
    while (place + 1) * finest <= clock.time:
        place += 1
    while place * finest > clock.time:
        place -= 1
    span = span_from(scene, work, place)
    work.kick.at, work.kick.span = float(place), float(span)
    kick, halvings = scene.kicks[KICK], int(scene.kicks[HALVINGS])
    for body in range(work.kicks.shape[0]):
        who = int(scene.bodies[body].identity)
        noise = mean_noise(kick, halvings, place, span, who, scene.key)
        work.kicks[body].x, work.kicks[body].y, work.kicks[body].turn = noise
    # What was extrapolated from the last kick would only mislead.
    clock.staged_step = 0.0


LOW = 0xFFFFFFFF
"""The lower 32 bits."""

FIRST_FACTOR, SECOND_FACTOR = 0xD2511F53, 0xCD9E8D57
FIRST_WEYL, SECOND_WEYL = 0x9E3779B9, 0xBB67AE85

ROUNDS = 10

WORD = 2.0**-32
"""One part of the range of a word."""


def philox(one, two, three, four, key, other):
    """Four words of 32 bits from a counter of four and a key of two."""
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
    """Three independent standard normal numbers (Box and Muller) for a place in a tree of kicks.

    ``index`` of the place at its ``level``, whole numbers from 0; ``body``: whom it is for;
    ``key``: two words.
    """
    one, two, three, four = philox(
        index & LOW, (index >> 32) & LOW, level & LOW, body & LOW, key[0], key[1]
    )
    turn = 2.0 * math.pi * WORD * (two + 0.5)
    size = math.sqrt(-2.0 * math.log(WORD * (one + 0.5)))
    last = math.sqrt(-2.0 * math.log(WORD * (three + 0.5)))
    last *= math.cos(2.0 * math.pi * WORD * (four + 0.5))
    return size * math.cos(turn), size * math.sin(turn), last
