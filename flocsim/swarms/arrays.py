"""The arrays of a swarm: what is known of every body between two common times."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flocsim.arrays import ACROSS, MOTION_COLUMNS, STEP, Scene
from flocsim.geometry.contact.sweep import DISC_COLUMNS

ERROR_COLUMNS = 8
"""Columns of ``errors``: from ERROR_PLACE to LOST_SPEED of a run."""

BEGIN, END, HORIZON_AT, TIME_COUNT = range(4)
"""Places in ``times``: when the window begins and ends, and when the run does [s]."""

LATER_BODY, EARLIER_BODY, AT_VERTEX, AT_EDGE, MODE, LINK_COLUMNS = range(6)
"""Columns of ``links``: the bodies of a contact of which more is known than where they are, the
later one first; core point of the vertex and first one of the edge, of all bodies'; how it touched
(KEPT_MODE)."""

SLIP, OFFSET, HELD_FORCE, HELD_GAP, MICRO_FLIGHTS, SLIP_COLUMNS = range(6)
"""Columns of ``slips``: the displacement [m] and the error that it is carried with; the tangential
force with which it grazes [N], the gap that counts as none [m], and how often it was apart by next
to nothing (events.grazes)."""

STEPS_TAKEN, STEPS_REJECTED, FORCES_SUMMED, COST_COLUMNS = range(4)
"""Columns of ``costs``, of every island."""

(
    START_X, START_Y, PATH_VX, PATH_VY, SINCE, FURTHEST, HALT, TRACK_COLUMNS,
) = range(8)  # fmt: skip
"""Columns of what an island's observer sees, of every body: the straight path that it is expected
to go, and from when; how far it has strayed from it [m]; of the first one, 1 where the island is
to stop at once, which another thread says."""


class Swarm(NamedTuple):
    """n bodies at a common time.

    ``bodies`` (n, 10), ``first``, ``vertices`` and ``tree``: as in a Scene.  ``motion`` and
    ``carried`` (n, 6), ``errors`` (n, 8), ``steps`` (n,): the state, the vector of its error, what
    the errors of steps and switches have led to, the size of the next step [s].  ``methods`` (n,):
    1 where the steps of its island went on across switches, as ACROSS in a clock.  ``wander``
    (n,): how far a body may stray from a straight path in a window [m].  ``first_link`` (n + 1,),
    ``links`` (k, 5), ``slips`` (k, 5): contacts and what they go by, those of later body b from
    ``first_link[b]`` on.  ``new_motion`` … ``strayed``: the same at the window's end, the stated
    error of every body [m], and how far it strayed.
    ``discs``, ``order``, ``starts``: what the sweep for neighbours works on.  ``times``: see BEGIN.
    """

    bodies: np.ndarray
    first: np.ndarray
    vertices: np.ndarray
    tree: np.ndarray
    motion: np.ndarray
    carried: np.ndarray
    errors: np.ndarray
    steps: np.ndarray
    methods: np.ndarray
    wander: np.ndarray
    first_link: np.ndarray
    links: np.ndarray
    slips: np.ndarray
    new_motion: np.ndarray
    new_carried: np.ndarray
    new_errors: np.ndarray
    new_steps: np.ndarray
    new_methods: np.ndarray
    stated: np.ndarray
    strayed: np.ndarray
    discs: np.ndarray
    order: np.ndarray
    starts: np.ndarray
    times: np.ndarray


def swarm_of(scene: Scene, position: np.ndarray, velocity: np.ndarray, clock: np.ndarray) -> Swarm:
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
        steps=np.full(n, clock[STEP]),
        methods=np.full(n, clock[ACROSS]),
        wander=np.zeros(n),
        first_link=np.zeros(n + 1, dtype=np.int64),
        links=np.zeros((0, LINK_COLUMNS), dtype=np.int64),
        slips=np.zeros((0, SLIP_COLUMNS)),
        new_motion=motion.copy(),
        new_carried=np.zeros((n, MOTION_COLUMNS)),
        new_errors=np.zeros((n, ERROR_COLUMNS)),
        new_steps=np.full(n, clock[STEP]),
        new_methods=np.full(n, clock[ACROSS]),
        stated=np.zeros(n),
        strayed=np.zeros(n),
        discs=np.zeros((n, DISC_COLUMNS)),
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


def with_links(swarm: Swarm, parts: Sequence[tuple[np.ndarray, np.ndarray]]) -> Swarm:
    """The swarm with the contacts (links, slips) of all islands, in the order of their bodies."""
    links = np.concatenate([links for links, _ in parts] or [swarm.links[:0]])
    slips = np.concatenate([slips for _, slips in parts] or [swarm.slips[:0]])
    order = np.lexsort(links.T[::-1])
    links, slips = np.ascontiguousarray(links[order]), np.ascontiguousarray(slips[order])
    first = np.searchsorted(links[:, LATER_BODY], np.arange(len(swarm.bodies) + 1))
    return swarm._replace(links=links, slips=slips, first_link=first.astype(np.int64))
