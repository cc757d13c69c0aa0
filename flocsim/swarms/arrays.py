"""The arrays of a swarm: what is known of every body between two common times."""

from typing import Annotated, NamedTuple

import numpy as np

from flocsim.state.bodies import MOTION_COLUMNS, Disc
from flocsim.state.clock import Clock
from flocsim.state.scene import Scene

ERROR_COLUMNS = 6
"""Columns of ``errors``: ``place`` to ``uncertain_velocity`` of BodyErrors."""

# Which of an island's clocks, and of its counts.
(
    RUNNING,  # of the island that runs
    FRESH,  # as each of them begins
) = range(2)

# Places in ``times``.
(
    BEGIN,  # of the window [s]
    END,  # of the window [s]
    HORIZON_AT,  # when the run ends [s]
    TIME_COUNT,
) = range(4)

# Columns of ``links``: contacts of which more is known than where the bodies are.
(
    LATER_BODY,  # the body of the larger number
    EARLIER_BODY,
    AT_VERTEX,  # core point of the vertex, of all bodies'
    AT_EDGE,  # first core point of the edge, of all bodies'
    MODE,  # how it touched (KEPT_MODE)
    LINK_COLUMNS,
) = range(6)

SLIP_COLUMNS = 5
"""Columns of ``slips``, of the same contacts: ``slip`` to ``short_flights`` of SavedContact."""

# Columns of ``costs``, of every island.
(
    STEPS_TAKEN,
    STEPS_REJECTED,
    FORCES_SUMMED,
    COST_COLUMNS,
) = range(4)

STRETCHES = 16
"""Stretches of a window, for each of which it is noted where bodies have been."""

LEFT, RIGHT, LOW, HIGH, BOX_COLUMNS = range(5)
"""Columns of ``ways``, for every stretch: between where a body has been [m]."""

# Columns of what an island's observer sees, of every body.
(
    START_X,  # where the straight path begins that it is expected to go [m]
    START_Y,  # [m]
    PATH_VX,  # [m/s]
    PATH_VY,  # [m/s]
    FURTHEST,  # how far it has strayed from it [m]
    SEEN_X,  # where it was last seen [m]
    SEEN_Y,  # [m]
    SEEN_AT,  # of the first body, as what follows: when that was [s]
    SINCE,  # when the window began [s]
    LENGTH,  # of the window [s]
    HALT,  # 1 where another thread wants the island to stop at once
    BOXES,  # from here on, for every stretch: where it has been, as ``ways``
) = range(12)

TRACK_COLUMNS = BOXES + STRETCHES * BOX_COLUMNS


class Swarm(NamedTuple):
    """n bodies at a common time, and at the window's end."""

    bodies: np.ndarray  # this and the next three as in a Scene
    first: np.ndarray
    vertices: np.ndarray
    tree: np.ndarray
    motion: Annotated[np.ndarray, ("n", MOTION_COLUMNS)]
    carried: Annotated[np.ndarray, ("n", MOTION_COLUMNS)]  # the vector of the state's error
    errors: Annotated[np.ndarray, ("n", ERROR_COLUMNS)]  # what errors of steps have led to
    steps: np.ndarray  # (n,): size of the next step [s]
    methods: np.ndarray  # (n,): 1 where steps of its island went on across switches, as ACROSS
    wander: np.ndarray  # (n,): how far a body may stray from a straight path in a window [m]
    first_link: np.ndarray  # (n + 1,): where the contacts of a later body begin
    links: Annotated[np.ndarray, ("k", LINK_COLUMNS)]
    slips: Annotated[np.ndarray, ("k", SLIP_COLUMNS)]
    new_motion: Annotated[np.ndarray, ("n", MOTION_COLUMNS)]  # from here on: at the window's end
    new_carried: Annotated[np.ndarray, ("n", MOTION_COLUMNS)]
    new_errors: Annotated[np.ndarray, ("n", ERROR_COLUMNS)]
    new_steps: np.ndarray
    new_methods: np.ndarray
    stated: np.ndarray  # (n,): the stated error of every body [m]
    strayed: np.ndarray  # (n,): how far it strayed [m]
    ways: Annotated[np.ndarray, ("n", STRETCHES, BOX_COLUMNS)]  # where it has been
    discs: np.ndarray  # (n,) of Disc: what the sweep for neighbours works on
    order: np.ndarray  # (n,): the same
    starts: np.ndarray  # (n + 1,): the same
    times: np.ndarray  # see BEGIN


def swarm_of(scene: Scene, position: np.ndarray, velocity: np.ndarray, clock: Clock) -> Swarm:
    """The arrays of a swarm at its start: places and velocities (n, 3), nothing touching yet; the
    ``clock`` that its method begins with."""
    n = len(scene.bodies)
    motion = np.ascontiguousarray(np.hstack([position, velocity]))
    return Swarm(
        bodies=scene.bodies,
        first=scene.first,
        vertices=scene.vertices,
        tree=scene.tree,
        motion=motion,
        carried=np.zeros((n, MOTION_COLUMNS)),
        errors=np.zeros((n, ERROR_COLUMNS)),
        steps=np.full(n, clock.step),
        methods=np.full(n, clock.across),
        wander=np.zeros(n),
        first_link=np.zeros(n + 1, dtype=np.int64),
        links=np.zeros((0, LINK_COLUMNS), dtype=np.int64),
        slips=np.zeros((0, SLIP_COLUMNS)),
        new_motion=motion.copy(),
        new_carried=np.zeros((n, MOTION_COLUMNS)),
        new_errors=np.zeros((n, ERROR_COLUMNS)),
        new_steps=np.full(n, clock.step),
        new_methods=np.full(n, clock.across),
        stated=np.zeros(n),
        strayed=np.zeros(n),
        ways=np.zeros((n, STRETCHES, BOX_COLUMNS)),
        discs=Disc.rows(n),
        order=np.arange(n, dtype=np.int64),
        starts=np.zeros(n + 1, dtype=np.int64),
        times=np.zeros(TIME_COUNT),
    )


class Found(NamedTuple):
    """What islands have left behind: ``links`` (room, 5) and ``slips`` (room, 5), filled up to
    ``filled[0]``."""

    links: np.ndarray
    slips: np.ndarray
    filled: np.ndarray


def found_of(room: int) -> Found:
    """Room for so many contacts."""
    return Found(
        np.zeros((room, LINK_COLUMNS), dtype=np.int64),
        np.zeros((room, SLIP_COLUMNS)),
        np.zeros(1, dtype=np.int64),
    )


def with_links(swarm: Swarm, links: np.ndarray, slips: np.ndarray) -> Swarm:
    """The swarm with these contacts, in the order of their bodies."""
    order = np.lexsort(links.T[::-1])
    links, slips = np.ascontiguousarray(links[order]), np.ascontiguousarray(slips[order])
    first = np.searchsorted(links[:, LATER_BODY], np.arange(len(swarm.bodies) + 1))
    return swarm._replace(links=links, slips=slips, first_link=first.astype(np.int64))
