"""What the forces between bodies must not care about: place, direction, sense, and numbering."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from tests.helpers.fast_scene import FORCES, FastScene, random_case, silenced
from tests.helpers.tiers import rest_slow
from tests.reference.samples import SEEDS
from tests.reference.shapes import Scene, rotation

by_scene = pytest.mark.parametrize("seed", rest_slow(SEEDS, lambda seed: seed < 12))

BETWEEN_BODIES = [name for name in FORCES if name not in ("gravity", "drag")]


def pair_loads(case):
    """Loads (n, 3) of all forces between bodies."""
    return FastScene(silenced(case, *BETWEEN_BODIES)).loads(case.slips)


def assert_same_loads(found, wanted):
    """Forces to 1e-9 of the greatest, torques to that times 30 µm, the largest body's size."""
    scale = np.abs(wanted[:, :2]).max()
    assert np.abs(found - wanted)[:, :2].max() <= 1e-9 * scale
    assert np.abs(found - wanted)[:, 2].max() <= 1e-9 * scale * 30e-6


def renamed(slips, vertex, edge, body=lambda b: b):
    """Slips under the new numbers of vertices, edges and bodies."""
    return {
        (body(a), vertex(a, v), body(b), edge(b, e)): slip for (a, v, b, e), slip in slips.items()
    }


@by_scene
def test_action_equals_reaction_and_turns_nothing(seed):
    case = random_case(seed)
    loads = pair_loads(case)
    x, y, _ = case.plain.positions.T
    scale = np.abs(loads[:, :2]).max()
    assert np.abs(loads[:, :2].sum(axis=0)).max() <= 1e-12 * scale
    moments = x * loads[:, 1] - y * loads[:, 0] + loads[:, 2]
    assert abs(moments.sum()) <= 1e-11 * scale * np.abs(case.plain.positions[:, :2]).max()


@by_scene
def test_loads_of_three_bodies_are_those_of_every_two(seed):
    case = random_case(seed)
    total = np.zeros((len(case.plain.bodies), 3))
    for two in combinations(range(len(total)), 2):
        plain = Scene(
            tuple(case.plain.bodies[k] for k in two),
            case.plain.positions[list(two)],
            case.plain.velocities[list(two)],
        )
        slips = {key: slip for key, slip in case.slips.items() if set(key[::2]) == set(two)}
        slips = renamed(slips, lambda a, v: v, lambda b, e: e, two.index)
        total[list(two)] += pair_loads(replace(case, plain=plain, slips=slips))
    assert_same_loads(pair_loads(case), total)


@by_scene
def test_turning_and_shifting_the_scene_turns_the_forces(seed):
    case, turn = random_case(seed), rotation(2.1)
    positions, velocities = case.plain.positions.copy(), case.plain.velocities.copy()
    positions[:, :2] = positions[:, :2] @ turn.T + (3e-5, -1e-5)
    positions[:, 2] += 2.1
    velocities[:, :2] = velocities[:, :2] @ turn.T
    loads = pair_loads(case)
    loads[:, :2] = loads[:, :2] @ turn.T
    moved = replace(case, plain=Scene(case.plain.bodies, positions, velocities))
    assert_same_loads(pair_loads(moved), loads)


def backwards(count):
    """New numbers of vertices and edges when all but the first vertex are listed in reverse."""

    def edge(e):
        return (count - e - 1) % count if count > 2 else e

    return lambda v: -v % count, edge


@by_scene
def test_the_mirrored_scene_has_mirrored_forces(seed):
    case = random_case(seed)
    flip, turn = np.array([-1.0, 1.0]), np.array([-1.0, 1.0, -1.0])
    bodies = tuple(
        replace(body, vertices=np.roll((body.vertices * flip)[::-1], 1, axis=0))
        for body in case.plain.bodies
    )
    plain = Scene(bodies, case.plain.positions * turn, case.plain.velocities * turn)
    numbers = [backwards(len(body.vertices)) for body in bodies]
    slips = renamed(case.slips, lambda a, v: numbers[a][0](v), lambda b, e: numbers[b][1](e))
    slips = {key: -slip for key, slip in slips.items()}
    assert_same_loads(pair_loads(replace(case, plain=plain, slips=slips)), pair_loads(case) * turn)


@by_scene
def test_the_order_of_bodies_does_not_matter(seed):
    case = random_case(seed)
    last = len(case.plain.bodies) - 1
    plain = Scene(case.plain.bodies[::-1], case.plain.positions[::-1], case.plain.velocities[::-1])
    slips = renamed(case.slips, lambda a, v: v, lambda b, e: e, lambda body: last - body)
    assert_same_loads(pair_loads(replace(case, plain=plain, slips=slips))[::-1], pair_loads(case))


@by_scene
def test_the_first_vertex_does_not_matter(seed):
    case = random_case(seed)
    # A segment's one edge would run backwards, which its shape does not know as renumbering.
    counts = [len(body.vertices) for body in case.plain.bodies]
    shifts = [0 if count == 2 else seed % count for count in counts]
    bodies = tuple(
        replace(body, vertices=np.roll(body.vertices, -shift, axis=0))
        for body, shift in zip(case.plain.bodies, shifts, strict=True)
    )

    def number(body, k):
        return (k - shifts[body]) % len(bodies[body].vertices)

    slips = renamed(case.slips, number, number)
    plain = Scene(bodies, case.plain.positions, case.plain.velocities)
    assert_same_loads(pair_loads(replace(case, plain=plain, slips=slips)), pair_loads(case))
