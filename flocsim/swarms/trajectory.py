"""SwarmTrajectory: a swarm at the times that were asked for."""

from collections.abc import Callable

import attrs
import numpy as np

from flocsim.body import Body
from flocsim.integrators.base import Status
from flocsim.swarms.progress import Effort
from flocsim.swarms.together.bonds import BondGauge, Bonds
from flocsim.swarms.together.clusters import Clusters
from flocsim.swarms.together.contacts import Gauge, Neighbours


@attrs.frozen(eq=False, repr=False)
class SwarmTrajectory:
    """What became of a swarm of n bodies.

    ``t`` (k,) [s]: the start and the times asked for; ``position`` and ``velocity`` (k, n, 3) as in
    a Trajectory, places going on through a box that repeats itself; ``error`` (k,) [m], the largest
    stated error of a body; ``status`` with which the run ended, and ``failed``, the bodies of the
    island that ended it early; ``effort``, what it took; ``wall_time`` [s]; ``box`` [m].
    """

    t: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    error: np.ndarray
    status: Status
    failed: np.ndarray | None
    effort: Effort
    wall_time: float
    bodies: tuple[Body, ...]
    box: tuple[float, float]
    gauge: Gauge
    bond_gauge: Callable[[], BondGauge]

    def __repr__(self) -> str:
        return (
            f"SwarmTrajectory({len(self.bodies)} bodies, {len(self.t)} times up to "
            f"{self.t[-1]:g} s, {self.status.name})"
        )

    def neighbours(self, at: int = -1, within: float = 0.0) -> Neighbours:
        """The pairs of bodies nearer to each other than a gap [m], touching ones by default, at a
        time of ``t``."""
        return self.gauge.neighbours(self.position[at], within)

    def clusters(self, at: int = -1, within: float = 0.0) -> Clusters:
        """The clusters of bodies that touch, or lie nearer than a gap [m], at a time of ``t``."""
        near = self.neighbours(at, within)
        return Clusters.of(self.bodies, self.position[at], self.velocity[at], near)

    def bonds(self, at: int = -1, within: float = 0.0) -> Bonds:
        """What holds the pairs that touch, or lie nearer than a gap [m], at a time of ``t``: a
        certificate, a hook or a rest since the time of ``t`` before, or nothing that is proved."""
        at = range(len(self.t))[at]
        motion = np.concatenate([self.position, self.velocity], axis=2)
        before = (float(self.t[at - 1]), motion[at - 1]) if at else None
        touching = self.gauge.neighbours(self.position[at], within)
        return self.bond_gauge().bonds(float(self.t[at]), motion[at], touching, before)

    def momentum(self, at: int = -1) -> np.ndarray:
        """Σ m v of all bodies that move (2,) [kg m/s], at a time of ``t``."""
        mass = np.array([0.0 if body.fixed else body.mass for body in self.bodies])
        return mass @ self.velocity[at, :, :2]
