"""Trajectory: states between steps, contacts, forces, work, going on. Every run is uncompiled."""

import numpy as np
import pytest

from flocsim import Body, Sphere, System
from flocsim.errors import UsageError
from flocsim.forces import Contact, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import DormandPrince54, Implicit, Status, VelocityVerlet
from flocsim.trajectories.figures import frames_of

FALL = [Gravity(), StokesDrag()]
STICKY = [*FALL, VanDerWaals(hamaker=1e-20), Contact(k_n=20.0, k_t=2.0)]


def falling(method):
    """A lone sphere that falls from rest."""
    return System([Body(Sphere(5e-6), density=2650.0)], FALL, method)


@pytest.fixture(scope="module")
def resting():
    """(System, Trajectory) of a sphere that rolls down another, fixed one, sticking to it."""
    bodies = [
        Body(Sphere(1e-5), density=2650.0, fixed=True),
        Body(Sphere(5e-6), (4e-6, 1.446e-5), density=2650.0),
    ]
    system = System(bodies, STICKY)
    return system, system.run(until=4e-4, jit=False)


@pytest.mark.parametrize(
    ("method", "allowed"),
    [(Implicit(), 2e-9), (DormandPrince54(), 2e-9), (VelocityVerlet(1e-6), 1e-11)],
)
def test_states_between_steps_are_those_of_the_motion(method, allowed):
    system = falling(method)
    run = system.run(until=5e-5, jit=False)
    body, fluid = system.bodies[0], system.fluid
    tau = body.mass / (6.0 * np.pi * fluid.viscosity * 5e-6)
    times = np.linspace(0.0, 5e-5, 41)
    found = run.at(times)
    g = 9.81 * body.buoyant_mass(fluid) / body.mass
    places = -g * tau * (times - tau * (1.0 - np.exp(-times / tau)))
    np.testing.assert_allclose(found.position[:, 0, 1], places, atol=allowed)
    single = run.at(float(times[17]))
    np.testing.assert_allclose(single.position, found.position[17], rtol=1e-12, atol=1e-30)
    at_steps = run.at(run.t)
    assert np.array_equal(at_steps.position, run.position)
    with pytest.raises(UsageError, match="the run covers times from 0 to 5e-05 s"):
        run.at(6e-5)


def test_work_is_what_the_bodies_have():
    run = falling(Implicit(tolerance=1e-13)).run(until=5e-5, jit=False)
    energies = run.energies()
    assert set(energies.work) == {"Gravity", "StokesDrag"}
    scale = np.abs(energies.work["Gravity"]).max()
    assert np.abs(energies.error).max() < 1e-4 * scale
    fallen = run.position[0, 0, 1] - run.position[:, 0, 1]
    weight = 9.81 * Body(Sphere(5e-6), density=2650.0).mass
    np.testing.assert_allclose(energies.work["Gravity"], weight * fallen, rtol=1e-4, atol=1e-30)


def test_contacts_and_forces_balance_at_rest(resting):
    _, run = resting
    [contact] = run.contacts(run.t[-1])
    assert contact.overlap > 0.0 and contact.bodies == (1, 0)
    assert np.hypot(*contact.point) == pytest.approx(1e-5, rel=1e-3)
    assert np.dot(contact.normal, run.position[-1, 1, :2]) > 0.0
    forces = run.forces(run.t[-1])
    n = np.array(contact.normal)
    tangent = np.array([-n[1], n[0]])
    mine = contact.force[0] * n + contact.force[1] * tangent
    np.testing.assert_allclose(forces["Contact"][1, :2], mine, rtol=1e-9)
    total = sum(forces.values())[1, :2]
    assert np.hypot(*total) < 1e-2 * np.hypot(*forces["Contact"][1, :2])
    np.testing.assert_allclose(forces["Contact"][0, :2], -forces["Contact"][1, :2])
    assert run.forces()["Gravity"].shape == (*run.t.shape, 2, 3)
    before = run.contacts(run.t[1])
    assert before == [] or before[0].overlap < 1e-6


def test_a_run_goes_on_with_the_history_of_its_contacts(resting):
    system, run = resting
    longer = run.go_on(8e-4)
    assert longer.t[-1] == 8e-4 and np.array_equal(longer.t[: len(run.t)], run.t)
    [ended], [first] = longer.contacts(4e-4), run.contacts(4e-4)
    assert ended == first and first.slip != 0.0
    again = system.run(until=8e-4, start=run, jit=False)
    assert again.t[0] == 4e-4 and np.array_equal(again.position[0], run.position[-1])
    assert again.contacts(4e-4)[0].slip == first.slip
    without = System(
        [system.bodies[0], Body(Sphere(5e-6), tuple(run.position[-1, 1, :2]), density=2650.0)],
        STICKY,
    ).run(until=1e-5, jit=False)
    assert without.contacts(0.0)[0].slip == 0.0
    slips = [each.contacts(8e-4)[0].slip for each in (longer, again)]
    assert slips[0] == pytest.approx(slips[1], rel=1e-3)


def test_a_run_stopped_and_gone_on_with_is_the_undisturbed_one(resting):
    system, run = resting
    seen = []

    def watch(state):
        seen.append(state.t)
        return state.t > 1e-4

    stopped = system.run(until=4e-4, watch=watch, jit=False)
    assert stopped.status == Status.STOPPED and stopped.t[-1] == seen[-1] > 1e-4
    assert seen == stopped.t[1:].tolist()
    whole = stopped.go_on(4e-4)
    assert np.array_equal(whole.position, run.position) and whole.status == Status.FINISHED
    middle = 0.5 * (run.t[3] + run.t[4])
    assert np.array_equal(whole.at(middle).position, run.at(middle).position)


def test_what_was_not_recorded_is_found_again(resting):
    system, run = resting
    brief = system.run(until=4e-4, record=False, jit=False)
    assert len(brief.t) == 2
    assert np.array_equal(brief.at(run.t[5]).position, run.position[5])


def test_what_cannot_be_is_told(resting):
    system, run = resting
    with pytest.raises(UsageError, match=r"until must be a time above 0.0004 s"):
        run.go_on(1e-4)
    with pytest.raises(UsageError, match="start must be a run of the same shapes"):
        falling(Implicit()).run(until=1.0, start=run, jit=False)
    with pytest.raises(UsageError, match="the end of start"):
        system.run(until=1e-4, start=run, jit=False)
    with pytest.raises(UsageError, match=r"start must be a Trajectory, .* found State"):
        system.run(until=1.0, start=run.at("0.2 ms"), jit=False)
    with pytest.raises(UsageError, match="watch must be a function"):
        system.run(until=1e-4, watch=3)
    with pytest.raises(UsageError, match="t must be a time such as '5 s', found 'now'"):
        run.at("now")
    with pytest.raises(UsageError, match="figure must be one of strip, distance, forces, energies"):
        run.plot("histogram")


def test_figures_and_words(resting, tmp_path):
    _, run = resting
    for figure in ("strip", "distance", "forces"):
        assert run.plot(figure, file=tmp_path / f"{figure}.png").axes
        assert (tmp_path / f"{figure}.png").stat().st_size > 1000
    run.animate(tmp_path / "m.gif", frames=3)
    assert (tmp_path / "m.gif").read_bytes()[:3] == b"GIF"
    assert repr(run).startswith("Trajectory(2 bodies, 0 to 0.0004 s, ")
    assert str(run.status) == "FINISHED: the end time was reached"
    assert len(repr(run)) < 80 and len(repr(run.at(0.0))) < 60


def test_frames_are_as_many_as_were_asked_for(resting):
    """Of few long steps, between them too, evenly along the way; of a body that stays, in time."""
    lone = falling(Implicit()).run(until=5e-3, jit=False)
    for frames in (2, 6, 40):
        found = frames_of(lone, frames)
        assert len(found.times) == len(found.outlines) == frames
        ways = np.array([each[0][0].mean(axis=0)[1] for each in found.outlines])
        np.testing.assert_allclose(np.diff(ways), ways[-1] / (frames - 1), rtol=0.05)
    assert [found.times[0], found.times[-1]] == [0.0, 5e-3]
    at_rest = System([Body(Sphere(1e-5), fixed=True, density=2650.0)], FALL).run(1e-3, jit=False)
    assert frames_of(at_rest, 5).times.tolist() == [0.0, 1e-3]


def test_a_saved_motion_opens_in_xarray(resting, tmp_path):
    xarray = pytest.importorskip("xarray")
    _, run = resting
    run.save(tmp_path / "m.h5")
    with xarray.open_dataset(tmp_path / "m.h5", engine="h5netcdf") as data:
        assert data["position"].dims == ("time", "body", "component")
        assert data["component"].values.tolist() == ["x", "y", "angle"]
        np.testing.assert_array_equal(data["position"].sel(body=1, component="y"),
                                      run.position[:, 1, 1])  # fmt: skip
        np.testing.assert_array_equal(data["time"], run.t)
    with pytest.raises(UsageError, match=r"already exists .*in Python overwrite=True"):
        run.save(tmp_path / "m.h5")


def test_an_exported_motion_opens_in_gsd(resting, tmp_path):
    hoomd = pytest.importorskip("gsd.hoomd", reason="needs flocsim[formats]")
    _, run = resting
    run.export(tmp_path / "m.gsd")
    with hoomd.open(tmp_path / "m.gsd") as frames:
        assert len(frames) == len(run.t)
        places = frames[-1].particles.position[:, :2]
    np.testing.assert_allclose(places, 1e6 * run.position[-1, :, :2], rtol=1e-6, atol=1e-9)
    with pytest.raises(UsageError, match="already exists"):
        run.export(tmp_path / "m.gsd")
    with pytest.raises(UsageError, match=r"must end in \.gsd"):
        run.export(tmp_path / "m.vtk")
