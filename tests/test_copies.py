"""What a pool of processes sends and deepcopy copies: it computes what the original computes."""

import copy
import multiprocessing
import pickle
import warnings

import numpy as np
import pytest

import flocsim
from flocsim import Body, Fluid, Sphere, SpheroPolygon, Swarm, System
from flocsim.forces import Contact, Gravity, StokesDrag, Thermal, VanDerWaals
from flocsim.integrators import DormandPrince54, Implicit

SQUARE = SpheroPolygon([(-3e-6, -3e-6), (3e-6, -3e-6), (3e-6, 3e-6), (-3e-6, 3e-6)], 1e-6)
FORCES = [Gravity(), StokesDrag(), Contact(), VanDerWaals(1e-20)]


def sent(value):
    """What arrives in another process."""
    return pickle.loads(pickle.dumps(value))


COPIES = pytest.mark.parametrize("copied", [sent, copy.deepcopy, copy.copy])


def system_of(shape=None, forces=FORCES, **more):
    """A pair that falls and touches within 1 ms."""
    bodies = [Body(Sphere(10e-6), density=2650.0, fixed=True),
              Body(shape or Sphere(5e-6), position=(1e-6, 15.1e-6), density=2650.0)]  # fmt: skip
    return System(bodies, forces, fluid=Fluid(buoyancy=True), **more)


def end_of(system):
    """Where the bodies are after 1 ms; top of the module, for pools."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return system.run(until=1e-3).position[-1]


SYSTEMS = {
    "spheres": system_of,
    "a polygon": lambda: system_of(SQUARE),
    "explicit": lambda: system_of(integrator=DormandPrince54(tolerance=1e-9)),
    "thermal": lambda: system_of(forces=[*FORCES, Thermal(kick=1e-5)], seed=(3, 7)),
    "other bodies": lambda: system_of().changed(seed=(2,)),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_copied_system_runs_to_the_same_bits(name):
    system = SYSTEMS[name]()
    expected = end_of(system)
    for copied in (sent, copy.deepcopy, copy.copy):
        assert np.array_equal(end_of(copied(system)), expected)


@COPIES
def test_a_copied_trajectory_answers_the_same_and_goes_on(copied):
    run = system_of(SQUARE).run(until=1e-3)
    other = copied(run)
    middle = 0.5 * (run.t[3] + run.t[4])
    assert np.array_equal(other.at(middle).position, run.at(middle).position)
    assert other.contacts(1e-3) == run.contacts(1e-3)
    assert np.array_equal(other.energies().kinetic, run.energies().kinetic)
    longer, expected = other.go_on(2e-3), run.go_on(2e-3)
    assert np.array_equal(longer.position, expected.position)
    # A copy of what was gone on with, and a run that begins at the end of a copy.
    again = copied(longer)
    assert np.array_equal(again.go_on(3e-3).position, expected.go_on(3e-3).position)
    started = system_of(SQUARE).run(until=2e-3, start=other)
    assert np.array_equal(copied(started).at(1.5e-3).position, started.at(1.5e-3).position)


def test_a_replicate_of_a_study_is_sent(tmp_path):
    tables = {"preset": "tang2014", "scene": {"types": ["III"]}, "shapes": {"vertices": [1]}}
    run = flocsim.Study(tables, folder=tmp_path).replicate(0)
    middle = 0.5 * run.t[-1]
    assert np.array_equal(sent(run).at(middle).position, run.at(middle).position)
    assert sent(run).row == run.row


@COPIES
def test_a_copied_swarm_runs_to_the_same_bits(copied):
    bodies = [Body(Sphere(5e-6), position=(0.0, k * 11e-6), density=2650.0) for k in range(3)]
    swarm = Swarm(bodies, FORCES[:3], box=(1e-4, None))
    expected = swarm.run(until=1e-3, every=5e-4)
    other = copied(swarm).run(until=1e-3, every=5e-4)
    assert np.array_equal(other.position, expected.position)
    kept = copied(expected)
    assert np.array_equal(kept.clusters().size, expected.clusters().size)
    assert np.array_equal(kept.bonds().pairs, expected.bonds().pairs)


@pytest.mark.slow
def test_a_pool_of_spawned_processes_maps_over_systems():
    systems = [system_of(forces=[*FORCES, Thermal(kick=1e-5)], seed=k) for k in range(3)]
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = pool.map(end_of, systems)
    assert np.array_equal(found, [end_of(each) for each in systems])


def test_what_is_saved_is_loaded(tmp_path):
    run = system_of(SQUARE, integrator=Implicit(tolerance=1e-9)).run(until=1e-3)
    run.save(tmp_path / "run.h5")
    found = flocsim.Trajectory.load(tmp_path / "run.h5")
    for name in ("t", "position", "velocity"):
        assert np.array_equal(getattr(found, name), getattr(run, name)), name
    assert (found.status, found.steps, found.error) == (run.status, run.steps, run.error)
    assert found.shapes[1].area == pytest.approx(SQUARE.area)
    found.save(tmp_path / "again.h5")
    assert np.allclose(found.at(5e-4).position, run.at(5e-4).position, rtol=0.0, atol=1e-9)
    with pytest.raises(flocsim.errors.UsageError, match="only its motion"):
        found.go_on(2e-3)
