"""Mechanical energy of two bodies that nothing drives: kinetic, ½ k_n Δ² and ½ k_t ξ² of contacts.

With damping and drag it only falls. What one contact hands on to the next must not add to it.
"""

import math

import numpy as np
import pytest

from flocsim import Body, System
from flocsim.forces import Contact, StokesDrag
from flocsim.integrators import Implicit, Status
from flocsim.state.work import NOW
from tests.helpers.methods import ADAPTIVE, name_of
from tests.helpers.tiers import rest_slow
from tests.helpers.trial_scenes import encounter, hook, star

K_N, K_T = 20.0, 15.0


def energies(run):
    """(kinetic, normal, tangential) energy [J] of a Run now, its greatest overlap [m], and how many
    contacts it has."""
    work, bodies = run.work, run.scene.bodies
    velocity, listed = work.velocity[NOW], int(work.tally.candidates)
    speeds = bodies["mass"] * (velocity[:, 0] ** 2 + velocity[:, 1] ** 2)
    kinetic = 0.5 * np.sum(speeds + bodies["inertia"] * velocity[:, 2] ** 2)
    closed = work.candidates[:listed]["contact_mode"] > 0
    overlap = -work.geometry[NOW, :listed]["gap"][closed]
    slip = work.slip[NOW, :listed][closed]
    parts = kinetic, 0.5 * K_N * np.sum(overlap**2), 0.5 * K_T * np.sum(slip**2)
    return parts, overlap.max(initial=0.0), int(closed.sum())


def caged(rng):
    """A star that bounces about within a hook."""
    outer, points = hook(size=10e-6), int(rng.integers(3, 9))
    middle = outer.vertices[0] - [10e-6, 0.0]
    return [
        Body(outer, spin=1e2 * rng.normal(), surface_density=2.0),
        Body(
            star(points, size=2.8e-6, radius=0.5e-6), tuple(middle + 1e-7 * rng.normal(size=2)),
            rng.uniform(0.0, 7.0), tuple(0.1 * rng.normal(size=2)), 3e4 * rng.normal(),
            surface_density=2.0,
        ),
    ]  # fmt: skip


def watch(bodies, friction, integrator, until):
    """(greatest growth of the energy beyond the stated error, greatest share of it in ξ, contacts
    that closed) in a run, looked at after every step."""
    law = Contact(K_N, K_T, damping_n=2e4, damping_t=0.0, friction=friction)
    run = System(bodies, [law, StokesDrag()], integrator).begin(until, max_steps=20_000)
    least, growth, share, contacts, before = math.inf, -math.inf, 0.0, 0, 0
    status = Status.PAUSED
    while status is Status.PAUSED:
        parts, overlap, touching = energies(run)
        whole = sum(parts)
        # What a place that is wrong by the stated error does to the contacts' energy.
        growth = max(growth, whole - least - K_N * overlap * run.error)
        least, share = min(least, whole), max(share, parts[2] / whole)
        contacts, before = contacts + max(touching - before, 0), touching
        status = run.advance(1)
    assert status is Status.FINISHED
    return growth, share, contacts


@pytest.mark.parametrize(
    "integrator", rest_slow(ADAPTIVE, lambda each: isinstance(each, Implicit)), ids=name_of
)
@pytest.mark.parametrize("friction", rest_slow(["none", 0.3], lambda friction: friction == 0.3))
def test_energy_never_grows(integrator, friction):
    contacts = 0
    for seed in range(6):
        bodies = caged(np.random.default_rng([seed, 3]))
        growth, share, closed = watch(bodies, friction, integrator, 2e-3)
        assert growth <= 0.0
        contacts += closed
        assert closed == 0 or share > 0.0
    growth, _, closed = watch(encounter(), friction, integrator, 1e-3)
    assert growth <= 0.0 and closed > 0
    assert contacts > 25
