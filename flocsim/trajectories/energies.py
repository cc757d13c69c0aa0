"""Energies of a run's bodies, and the work that each force has done on them."""

import attrs
import numpy as np

from flocsim.body import Body
from flocsim.forces.base import ContactForce
from flocsim.integrators.overdamped import Overdamped
from flocsim.trajectories.replay import Instant, Origin, Replay

MIDDLE = 0.5


@attrs.frozen(eq=False)
class Energies:
    """Kinetic energies and work over a run.

    ``t`` (k,) [s]; ``kinetic`` (k, n) ½ m v² + ½ I ω² of every body [J]; ``work`` {force: (k,)}
    done on all free bodies since the start [J], by Simpson's rule over each step on the
    integrator's interpolation. Contacts are stiff within steps: theirs, "contact", is what the
    balance Δ(kinetic) = Σ work leaves. ``error`` (k,) [J]: what it leaves where there are no
    contact forces, None else.
    """

    t: np.ndarray
    kinetic: np.ndarray
    work: dict[str, np.ndarray]
    error: np.ndarray | None = None

    def __repr__(self) -> str:
        return f"Energies({len(self.t)} times, work of {', '.join(self.work)})"


def kinetic_energies(bodies: tuple[Body, ...], velocity: np.ndarray) -> np.ndarray:
    """(k, n) kinetic energies [J] from velocities (k, n, 3)."""
    inertias = np.array([(body.mass, body.mass, body.inertia) for body in bodies])
    return 0.5 * np.einsum("nc,knc->kn", inertias, velocity**2)


def energies_of(origin: Origin, times: np.ndarray, velocity: np.ndarray) -> Energies:
    """The Energies of a run with steps at these times (k,), its velocities being (k, n, 3)."""
    replay = Replay(origin)
    smooth = {
        name: scene
        for (name, scene), force in zip(replay.single_scenes.items(), origin.forces, strict=True)
        if not isinstance(force, ContactForce)
    }
    free = np.array([0.0 if body.fixed else 1.0 for body in origin.bodies])[:, None]

    def powers(instant: Instant) -> np.ndarray:
        rates = instant.motion[:, 3:].copy() * free
        return np.array([np.sum(instant.forces(scene) * rates) for scene in smooth.values()])

    middles = times[:-1] + MIDDLE * np.diff(times)
    order = np.sort(np.concatenate([times, middles]))
    found = np.array([powers(each) for each in replay.instants(order, times)])
    found = found.reshape(len(order), len(smooth))
    steps = np.diff(times)[:, None] / 6.0
    parts = steps * (found[:-2:2] + 4.0 * found[1:-1:2] + found[2::2])
    total = np.concatenate([np.zeros((1, len(smooth))), np.cumsum(parts, axis=0)])
    work = {name: total[:, place] for place, name in enumerate(smooth)}
    kinetic = kinetic_energies(origin.bodies, velocity)
    change = (kinetic - kinetic[0]) @ free[:, 0]
    if isinstance(origin.integrator, Overdamped):
        change = np.zeros(len(times))  # without inertia forces balance, and so does their work
    left = change - total.sum(axis=1)
    if len(smooth) == len(origin.forces):
        return Energies(times, kinetic, work, left)
    return Energies(times, kinetic, work | {"contact": left})
