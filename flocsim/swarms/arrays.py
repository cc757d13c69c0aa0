"""The arrays of a swarm: what is known of every body between two common times."""

from typing import Annotated, NamedTuple

import numpy as np

from flocsim.state.bodies import MOTION_COLUMNS, BodyConstants, BodyErrors, Disc
from flocsim.state.clock import Clock
from flocsim.state.contacts import SavedContact
from flocsim.state.declared import zeros_of
from flocsim.state.outlines import CorePoint
from flocsim.state.scene import Scene

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

    bodies: Annotated[np.ndarray, ("n",), BodyConstants]  # this and the next two as in a Scene
    first: Annotated[np.ndarray, ("after",), np.int64]
    vertices: Annotated[np.ndarray, (0,), CorePoint]
    motion: Annotated[np.ndarray, ("n", MOTION_COLUMNS)]
    carried: Annotated[np.ndarray, ("n", MOTION_COLUMNS)]  # the vector of the state's error
    errors: Annotated[np.ndarray, ("n",), BodyErrors]  # what errors of steps have led to
    steps: Annotated[np.ndarray, ("n",)]  # size of the next step [s]
    methods: Annotated[np.ndarray, ("n",)]  # 1: its island's steps went on across switches
    wander: Annotated[np.ndarray, ("n",)]  # how far it may stray from a straight path [m]
    first_link: Annotated[np.ndarray, ("after",), np.int64]  # where contacts of a later body begin
    # Contacts of which more is known than where the bodies are; bodies and points by their numbers
    # among all.
    links: Annotated[np.ndarray, ("k",), SavedContact]
    new_motion: Annotated[np.ndarray, ("n", MOTION_COLUMNS)]  # from here on: at the window's end
    new_carried: Annotated[np.ndarray, ("n", MOTION_COLUMNS)]
    new_errors: Annotated[np.ndarray, ("n",), BodyErrors]
    new_steps: Annotated[np.ndarray, ("n",)]
    new_methods: Annotated[np.ndarray, ("n",)]
    stated: Annotated[np.ndarray, ("n",)]  # the stated error of every body [m]
    strayed: Annotated[np.ndarray, ("n",)]  # how far it strayed [m]
    ways: Annotated[np.ndarray, ("n", STRETCHES, BOX_COLUMNS)]  # where it has been
    discs: Annotated[np.ndarray, ("n",), Disc]  # what the sweep for neighbours works on
    order: Annotated[np.ndarray, ("n",), np.int64]  # the same
    starts: Annotated[np.ndarray, ("after",), np.int64]  # the same
    times: Annotated[np.ndarray, (TIME_COUNT,)]  # see BEGIN


def swarm_of(scene: Scene, position: np.ndarray, velocity: np.ndarray, clock: Clock) -> Swarm:
    """The arrays of a swarm at its start: places and velocities (n, 3), nothing touching yet; the
    ``clock`` that its method begins with."""
    n = len(scene.bodies)
    swarm: Swarm = zeros_of(Swarm, n=n, after=n + 1, k=0)._replace(
        bodies=scene.bodies, first=scene.first, vertices=scene.vertices
    )
    swarm.motion[:] = swarm.new_motion[:] = np.hstack([position, velocity])
    swarm.steps[:] = swarm.new_steps[:] = clock.step
    swarm.methods[:] = swarm.new_methods[:] = clock.across
    swarm.order[:] = range(n)
    return swarm


class Found(NamedTuple):
    """What islands have left behind, filled up to ``filled[0]``."""

    links: Annotated[np.ndarray, ("k",), SavedContact]
    filled: Annotated[np.ndarray, (1,), np.int64]


def with_links(swarm: Swarm, links: np.ndarray) -> Swarm:
    """The swarm with these contacts, in the order of their bodies."""
    order = np.lexsort([links[name] for name in ("mode", "edge", "vertex", "earlier", "later")])
    links = SavedContact.joined([links[order]])
    first = np.searchsorted(links["later"], np.arange(len(swarm.bodies) + 1))
    return swarm._replace(links=links, first_link=first.astype(np.int64))
