"""Thermal motion in islands: every body's kicks are its own, whatever island it is in.

The engine runs uncompiled: a few bodies, a few kicks.
"""

import numpy as np
import pytest

from flocsim import Body, Fluid, Sphere, Swarm, System
from flocsim.compiler.composer import compose
from flocsim.errors import UsageError
from flocsim.forces import Contact, DoubleLayer, StokesDrag, Thermal
from flocsim.integrators import Overdamped
from flocsim.swarms.arrays import swarm_of
from flocsim.swarms.grouping import find_islands, join_islands
from flocsim.swarms.islands import run_islands
from flocsim.swarms.progress import Progress
from flocsim.swarms.runner import Runner, ThreadArrays

WATER = Fluid(viscosity=0.89e-3)
KICK, UNTIL = 1e-3, 7.3e-3
METHOD = Overdamped(1e-10)


def bodies(*places):
    return [Body(Sphere(1e-6), (1e-6 * x, 0.0), density=1050.0) for x in places]


def progress_of(swarm, until):
    """Swarm.begin without a compiler."""
    scene = swarm.system.scene(jit=False)._replace(box=swarm.box)
    runner = Runner(
        compose(find_islands, {}, jit=False), compose(join_islands, {}, jit=False),
        compose(run_islands, swarm.fillings(), jit=False), swarm.integrator,
        [ThreadArrays(scene)], 10**6, swarm.box, swarm.reach,
    )  # fmt: skip
    arrays = swarm_of(scene, *swarm.system.motion(), swarm.integrator.fresh_clock())
    return Progress(runner, arrays, until)


def swarm_end(places, seed=(5, 0), stops=(UNTIL,)):
    forces = [StokesDrag(), Thermal(kick=KICK), Contact(), DoubleLayer(1e-3, 1e-8, cut=5e-7)]
    swarm = Swarm(bodies(*places), forces, METHOD, WATER, seed=seed)
    progress = progress_of(swarm, UNTIL)
    for stop in stops:
        while progress.advance(stop).name == "PAUSED":
            pass
    assert progress.time == UNTIL
    return progress.seen()[1][:, :3]


def alone_end(places, seed=(5, 0)):
    """The same bodies in one System, with nothing between them."""
    system = System(bodies(*places), [StokesDrag(), Thermal(kick=KICK)], METHOD, WATER, seed=seed)
    return system.run(UNTIL, jit=False).position[-1]


@pytest.mark.parametrize("places", [(0.0, 50.0, 100.0), (0.0, 3.2, 100.0)])
def test_bodies_go_where_their_own_kicks_take_them(places):
    """Alone in an island, or two in one: they are too far apart to act on each other."""
    np.testing.assert_allclose(swarm_end(places), alone_end(places), rtol=0.0, atol=1e-10)


def test_common_times_within_a_kick_change_nothing():
    places = (0.0, 50.0)
    parts = swarm_end(places, stops=(0.4e-3, 3.7e-3, UNTIL))
    np.testing.assert_allclose(parts, swarm_end(places), rtol=0.0, atol=1e-10)


def test_replicates_are_kicked_otherwise():
    one, other = (swarm_end((0.0, 50.0), seed=(5, replicate)) for replicate in (0, 1))
    assert np.abs(one - other).max() > 1e-9


@pytest.mark.parametrize("thermal", [Thermal(), Thermal(kick="1 ms", finest="2 nm")])
def test_kicks_that_would_be_halved_are_refused(thermal):
    with pytest.raises(UsageError, match="need kicks of the same duration"):
        Swarm(bodies(0.0, 50.0), [StokesDrag(), thermal, Contact()], METHOD, WATER)
