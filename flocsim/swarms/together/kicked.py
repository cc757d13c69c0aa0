"""What holds two bodies of a swarm together against kicks, as ensembles/collision/thermal/kicked.py
has it for two.

No load alone opens a bond then: out of their attraction, against the load, bodies climb with the
energy that they have, and kicks lift them by BARRIER k_B T in no time that matters.

- Certificate: to climb out against SAFETY times the load, and times its leverage where the two may
  be pried open, takes BARRIER k_B T besides what they move with, and twice what their contacts'
  springs hold.
- Rest and hook: as without kicks, and for spheres such a climb against the load itself; for shapes,
  whose hooks no potential tells of, BARRIER k_B T for lifting one by the smaller spheroradius
  against the load.
"""

from typing import Any

import numpy as np

from flocsim.arrays import RADIUS
from flocsim.compiler.composer import compose
from flocsim.integrators.rhs.climb import BARRIER, can_climb
from flocsim.laws import compiled_calls


def hold_in_kicks(scene, time, pairs, ways, loads, needed, held):
    """Which pairs (later, earlier) the energies ``needed`` [J] do not let out of their attraction,
    ``loads`` [N] helping; ``ways``: distances of their centres and gaps [m]."""
    for pair in range(len(pairs)):
        a, b = pairs[pair, 0], pairs[pair, 1]
        distance, gap = ways[pair, 0], ways[pair, 1]
        held[pair] = not can_climb(scene, time, a, b, distance, gap, loads[pair], needed[pair])


class KickedBonds:
    """What kicks of ``energy`` k_B T [J] leave of the bonds of a swarm whose Scene is ``scene``."""

    def __init__(self, swarm: Any, scene: Any, energy: float) -> None:
        self.scene, self.barrier = scene, BARRIER * energy
        self.spheres = swarm.system.spheres_only
        self.climbs = compose(hold_in_kicks, {**compiled_calls(), **swarm.fillings()})

    def held(
        self, time: float, pairs: np.ndarray, ways: np.ndarray, loads: np.ndarray,
        needed: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """Which pairs (m, 2) stay in their attraction; see hold_in_kicks."""
        held = np.zeros(len(pairs), dtype=np.bool_)
        self.climbs(self.scene, time, pairs.astype(np.int64), ways.copy(), loads, needed, held)
        return held

    def certified(
        self, time: float, pairs: np.ndarray, ways: np.ndarray, loads: np.ndarray,
        energy: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """Which pairs not even the ``energy`` that they have (m,) [J] and the barrier lead out of
        their attraction."""
        return self.held(time, pairs, ways, loads, self.barrier + energy)

    def resting(
        self, time: float, pairs: np.ndarray, ways: np.ndarray, loads: np.ndarray
    ) -> np.ndarray:
        """Which pairs, if they keep their pose, do so for longer than kicks let them."""
        if self.spheres:
            return self.held(time, pairs, ways, loads, np.full(len(pairs), self.barrier))
        return loads * self.scene.bodies[pairs, RADIUS].min(axis=1) >= self.barrier
