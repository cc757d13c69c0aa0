"""Random scenes reach their end with numbers, and are the same in every process."""

import subprocess
import sys

import numpy as np
import pytest

from benchmarks.accuracy.random_scenes import FAMILIES, family_of, scene_of
from benchmarks.reporting import ROOT
from flocsim import System
from tests.helpers.tiers import rest_slow

FEW_ENGINES = (
    "spheres with friction", "polygons with friction", "without drag", "stiff contacts", "walls",
    "inclines", "columns", "kicks",
)  # fmt: skip
"""Families of the default run: they share three compiled engines."""

SAMPLE = range(60)

DESCRIBE = (
    "from benchmarks.accuracy.random_scenes import scene_of\n"
    "for number in {numbers}:\n"
    "    scene = scene_of(number)\n"
    "    system = getattr(scene.system, 'system', scene.system)\n"
    "    print(scene.family, scene.until, system.seed, system.integrator, system.forces)\n"
    "    for body in system.bodies:\n"
    "        print(body.position, body.angle, body.velocity, body.shape.vertices.tolist())\n"
    "    print('end of scene')\n"
)


def test_any_numbers_in_a_row_have_all_families():
    count = len(FAMILIES)
    for first in (0, 7, 1_000_003):
        assert {family_of(first + k) for k in range(count)} == set(FAMILIES)


def test_scene_depends_on_its_number_alone():
    numbers = [7, 3, 11, 9]
    found = [
        subprocess.run(
            [sys.executable, "-c", DESCRIBE.format(numbers=each)], cwd=ROOT, check=True,
            capture_output=True, text=True,
        ).stdout.split("end of scene\n")[:-1]
        for each in (numbers, numbers[::-1])
    ]  # fmt: skip
    forwards, backwards = found
    assert len(set(forwards)) == len(numbers)
    assert forwards == backwards[::-1]


def test_scene_runs_to_the_same_end_twice():
    ends = [scene_of(1).run() for _ in range(2)]
    assert ends[0] == ends[1]
    np.testing.assert_array_equal(ends[0].position, ends[1].position)


def test_numbers_make_different_scenes():
    systems = [scene_of(1 + len(FAMILIES) * k).system for k in range(5)]
    assert all(isinstance(each, System) for each in systems)
    assert len({each.bodies[1].position for each in systems}) == len(systems)


@pytest.mark.parametrize(
    "number", rest_slow(SAMPLE, lambda number: family_of(number) in FEW_ENGINES)
)
def test_scene_reaches_its_end_with_numbers(number):
    end = scene_of(number).run()
    assert end.is_right, f"scene {number} ({family_of(number)}): {end.status}"
    assert np.isfinite(end.error)
    assert end.steps > 0
