"""Which pairs count: those of which one body is free, of few bodies and of many."""

import numpy as np
import pytest

from flocsim import Body, Sphere, SpheroPolygon
from flocsim.forces import CentreForce, Contact
from flocsim.geometry.contact.candidates import rebuild_list
from flocsim.state.work import ALL_PAIRS, work_of
from flocsim.system import System

SQUARE = SpheroPolygon([(-1e-5, -1e-5), (1e-5, -1e-5), (1e-5, 1e-5), (-1e-5, 1e-5)], 1e-6)


def crossing(count, free, shape):
    """Bodies, each well inside the next, of which those at some places are free."""
    return [
        Body(shape, (2e-6 * k, 1e-6 * (k % 2)), density=2650.0, fixed=k not in free)
        for k in range(count)
    ]  # fmt: skip


def listed(bodies):
    """(scene, work) of bodies, listed."""
    system = System(bodies, [Contact()])
    scene = system.scene(jit=False)
    work = work_of(scene, *system.motion(), capacity=4096)
    assert rebuild_list(scene, work)
    return scene, work


@pytest.mark.parametrize("shape", [Sphere(1e-5), SQUARE], ids=["spheres", "polygons"])
@pytest.mark.parametrize("count", [2, 3, ALL_PAIRS, ALL_PAIRS + 1, 20])
@pytest.mark.parametrize("free", [(), (0,), (1,), (0, 1)])
def test_pairs_with_a_free_body_are_listed_and_no_others(count, free, shape):
    if shape is SQUARE and count > 3 and free == (0, 1):
        count = min(count, ALL_PAIRS + 1)
    _, work = listed(crossing(count, free, shape))
    pairs = work.pairs[: work.tally.pairs][["later", "earlier"]].tolist()
    near = [
        (a, b) for a in range(count) for b in range(a)
        if (a in free or b in free) and (count <= ALL_PAIRS or 2e-6 * (a - b) < 2e-5)
    ]  # fmt: skip
    assert [pair for pair in near if pair not in pairs] == []
    assert all(a in free or b in free for a, b in pairs)
    rows = work.candidates[: work.tally.candidates][["vertex_body", "edge_body"]].tolist()
    assert all(a in free or b in free for a, b in rows)
    assert bool(rows) == bool(free)


class Push(CentreForce):
    """The same force at every distance."""

    @staticmethod
    def kernel(pair):
        return 1e-12


@pytest.mark.parametrize("count", [2, ALL_PAIRS, ALL_PAIRS + 3])
def test_centre_forces_do_not_act_between_fixed_bodies(count):
    """The force on each free body is the sum over the others; a fixed one feels free ones alone."""
    bodies = [
        Body(Sphere(1e-6), (5e-6 * k, 0.0), density=2650.0, fixed=k > 0) for k in range(count)
    ]
    run = System(bodies, [Push()]).run(1e-9, jit=False)
    found = run.forces()["Push"][0, :, 0]
    assert found[0] == pytest.approx(-1e-12 * (count - 1), rel=1e-3)
    assert found[1:] == pytest.approx(np.full(count - 1, 1e-12), rel=1e-3)
