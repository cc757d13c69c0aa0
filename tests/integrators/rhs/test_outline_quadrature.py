"""The sum over an outline against the same integral, halved until it no longer changes."""

import math

import numpy as np
import pytest

from flocsim import SpheroPolygon
from flocsim.compiler.composer import compose
from flocsim.forces import DoubleLayer, VanDerWaals
from flocsim.geometry.shapes.pieces import Pose, at_parameter, ends_of, placed
from flocsim.integrators.rhs.outline_sum import (
    list_around_piece,
    prepare_sum,
    sum_nodes,
    sum_pressure,
)
from tests.helpers.tiers import rest_slow
from tests.integrators.rhs.test_outline_sum import SIZE, Pair, at_gap, rough

D_MIN, PARTS = 3e-10, 64
LEAST = 1e-14
"""A force [N] below which none of these is."""

FORCES = {
    "van der Waals": (VanDerWaals(1e-20, D_MIN, law="outline"),),
    "double layer": (
        VanDerWaals(1e-21, D_MIN, law="outline"),
        DoubleLayer(potential=0.015, debye_length=3.35e-10, law="outline"),
    ),
}


def between(scene, work, piece, low, high, numbers):
    """Gauss's rule on a part of a piece."""
    nodes, half = work.nodes, 0.5 * (high - low)
    for k in range(8):
        parameter = 0.5 * (low + high) + half * work.rules[8, 0, k]
        x, y, nx, ny, metres = at_parameter(piece, parameter)
        nodes.x[k], nodes.y[k] = x, y
        nodes.normal_x[k], nodes.normal_y[k] = nx, ny
        nodes.weight[k] = half * work.rules[8, 1, k] * metres
        nodes.gap[k], nodes.attraction[k] = math.inf, 0.0
    return sum_nodes(scene, work, (0.0, 0.0, 0.0), 8, numbers)


def halved(scene, work, a, b, x, y, cosine, sine, parts, error):
    """(fx, fy) of sum_along by halving: it knows of no feet. ``parts``: scratch."""
    pose = Pose(x, y, cosine, sine)
    numbers = prepare_sum(scene, work, 0.0, a, b, pose)
    _, lens, _, _, sizes = numbers
    depth = sizes[0]
    fx, fy = 0.0, 0.0
    for i in range(work.near.first[0]):
        piece = placed(scene.pieces, work.near.first[1 + i], pose)
        if list_around_piece(scene, work, piece, lens) == 0:
            continue
        first, last = ends_of(piece)
        for k in range(PARTS):
            parts[k, 0] = first + (last - first) * k / PARTS
            parts[k, 1] = first + (last - first) * (k + 1) / PARTS
        count = PARTS
        while count > 0:
            count -= 1
            low, high = parts[count, 0], parts[count, 1]
            middle = 0.5 * (low + high)
            whole = between(scene, work, piece, low, high, numbers)
            one = between(scene, work, piece, low, middle, numbers)
            other = between(scene, work, piece, middle, high, numbers)
            off = abs(whole[0] - one[0] - other[0]) + abs(whole[1] - one[1] - other[1])
            if depth * off > error and high - low > 1e-9 * (last - first):
                parts[count, 0], parts[count, 1] = low, middle
                parts[count + 1, 0], parts[count + 1, 1] = middle, high
                count += 2
            else:
                fx += one[0] + other[0]
                fy += one[1] + other[1]
    return depth * fx, depth * fy


def summed(pair, x, y, angle):
    """(fx, fy) of the sum that runs have, the later body being gone along."""
    entry = compose(sum_pressure, pair.system.compiled_calls)
    where = float(x), float(y), math.cos(angle), math.sin(angle)
    return np.array(entry(pair.scene, pair.work, 0.0, 1, 0, *where)[:2])


def off_by(pair, pose):
    """How far the sum is off, of the force."""
    found = summed(pair, *pose)
    entry, parts = compose(halved, pair.system.compiled_calls), np.zeros((PARTS + 64, 2))
    x, y, angle = map(float, pose)
    error = 1e-8 * max(math.hypot(*found), LEAST)
    where = x, y, math.cos(angle), math.sin(angle)
    wanted = np.array(entry(pair.scene, pair.work, 1, 0, *where, parts, error))
    return math.hypot(*(found - wanted)) / math.hypot(*wanted)


def pairs_at_random(count, forces):
    """(a Pair, its pose) of rough bodies from overlapping within d_min to 30 nm apart."""
    random = np.random.default_rng(7)
    for k in range(count):
        one, other = rough(4 + k % 29, SIZE, k % 11), rough(4 + k % 23, 3.0 * SIZE, 50 + k % 7)
        gap = (-1e-10, 3e-10, 1e-9, 3e-9, 1e-8, 3e-8)[k % 6]
        pose = at_gap(one, other, gap, *random.uniform(0.0, 2.0 * np.pi, 2))
        yield Pair(other, one, pose, *forces), pose


@pytest.mark.parametrize("forces", FORCES.values(), ids=FORCES)
@pytest.mark.parametrize("count", [12, pytest.param(2_000, marks=pytest.mark.slow)])
def test_the_sum_is_the_integral(count, forces):
    """Both parts of the second force are far larger than what is left of them."""
    off = np.array([off_by(*each) for each in pairs_at_random(count, forces)])
    assert np.median(off) < 1e-6
    assert np.quantile(off, 0.99) < 1e-4
    assert off.max() < 5e-3


def comb(long, short):
    """A bar, and below it a long tooth at its right end and a short one in the middle."""
    bar = [(6, 1), (-6, 1), (-6, 0), (-1, 0), (-0.5, -short), (0, 0), (4.6, 0), (4.8, -long)]
    return SpheroPolygon(np.array([*bar, (5.0, 0)]) * 1e-6, 1e-7)


@pytest.mark.parametrize("apart", [1e-9, 3e-10, -1e-10])
def test_a_face_is_seen_at_its_end_though_something_stands_before_its_middle(apart):
    """The long tooth is nearest to the right end of the face, just beyond it, the short one to its
    middle."""
    other = comb(1.0, 1.0 - 6e-3)
    tooth = other.core[np.argmin(other.core[:, 1])] - other.centroid
    corners = np.array([(-3, -0.4), (3, -0.4), (3, 0.4), (-3, 0.4)]) * 1e-6
    one = SpheroPolygon(corners, 1e-7)
    y = tooth[1] - 0.4e-6 - 2e-7 - apart
    pair = Pair(other, one, (tooth[0] - 3e-6, y, 0.0), *FORCES["double layer"])
    along = tooth[0] - 3e-6 + np.linspace(-2e-9, 2e-9, 9)
    assert max(off_by(pair, (x, y, 0.0)) for x in along) < 1e-3


@pytest.mark.parametrize("gap", rest_slow([3e-10, 1.4e-9, 1e-8], lambda gap: gap == 1.4e-9))
def test_it_has_no_jumps(gap):
    """On a way of 1 pm in 100 steps the force changes evenly, whatever pieces and feet come in."""
    for pair, (x, y, angle) in pairs_at_random(3, FORCES["double layer"]):
        later, earlier = (body.shape for body in reversed(pair.system.bodies))
        x, y, angle = at_gap(later, earlier, gap, math.atan2(y, x), angle)
        ways = np.linspace(0.0, 1e-12, 101)
        found = np.array([summed(pair, x + w, y - 0.5 * w, angle + 1e5 * w) for w in ways])
        bent = np.abs(np.diff(found, 2, axis=0)).max()
        assert bent < 1e-5 * np.abs(found).max()
