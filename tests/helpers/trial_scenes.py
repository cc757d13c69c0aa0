"""Scenes, a user's own forces, and a watched run, shared by the tests of motion.

Few combinations of forces, because each is compiled once; their values vary freely.
"""

import math

import attrs
import numpy as np

from flocsim import Body, Sphere, SpheroPolygon, System, hooks
from flocsim.forces import BodyForce, CentreForce, Contact, ContactForce, SurfaceForce
from flocsim.geometry.contact.points import least_listed_gap
from flocsim.integrators import Status
from flocsim.state.work import NOW, motion_of, work_of

WATER_VISCOSITY = 8.9e-4


@attrs.frozen
class Spring(CentreForce):
    """F = −k (gap − rest) along the line of centres; k [N/m], rest [m]."""

    stiffness: float = 0.0
    rest: float = 0.0

    @staticmethod
    def kernel(pair, stiffness, rest):
        return -stiffness * (pair.gap - rest)


@attrs.frozen
class Trap(BodyForce):
    """A harmonic trap about the origin, with a weak torque that turns bodies upright."""

    pull: float = 0.0
    upright: float = 0.0

    @staticmethod
    def kernel(body, pull, upright):
        return -pull * body.x, -pull * body.y, -upright * math.sin(body.angle)


@attrs.frozen
class Lubrication(SurfaceForce):
    """Squeezed film: F = −6πγ r*² ġ/max(gap, roughness), left out beyond a gap of ``film``."""

    roughness: float = 1e-8
    film: float = 2e-6

    @property
    def reach(self):
        return self.film

    @staticmethod
    def kernel(pair, viscosity, roughness):
        squeeze = 6.0 * math.pi * viscosity * pair.reduced_radius**2
        return -squeeze * pair.gap_rate / max(pair.gap, roughness)


@attrs.frozen
class Hertz(ContactForce):
    """Normal E Δ^1.5 with dissipation as in Hunt and Crossley; tangential spring −k_t ξ."""

    modulus: float = 1e4
    loss: float = 0.0
    k_t: float = 0.0

    @staticmethod
    def kernel(contact, modulus, loss, k_t):
        load = modulus * contact.overlap * math.sqrt(max(contact.overlap, 0.0))
        return load * (1.0 + loss * contact.overlap_rate), -k_t * contact.slip


@attrs.frozen(eq=False)
class PolygonSystem(System):
    """A System that treats spheres by the code for polygons."""

    spheres_only = False


ELASTIC = Contact(k_n=20.0, k_t=0.0, damping_n=0.0, damping_t=0.0)

AWAITED, TOUCHING, CONTACTS, DEEPEST, TOUCH_TIME, TOUCH_GAP, OBSERVED_SIZE = range(7)


def is_awaited(observed):
    """Whether a touch is awaited."""
    return observed[AWAITED] != 0.0


def watch(scene, work, observed, time):
    """Counts touches of the bodies, keeps the deepest overlap, notes the awaited touch."""
    least = least_listed_gap(work)
    touching = 1.0 if least < 0.0 else 0.0
    if touching > observed[TOUCHING]:
        observed[CONTACTS] += 1.0
    observed[TOUCHING] = touching
    observed[DEEPEST] = max(observed[DEEPEST], -least)
    if observed[AWAITED] != 0.0 and least < 0.0:
        observed[AWAITED] = 0.0
        observed[TOUCH_TIME] = time
        observed[TOUCH_GAP] = least
    return 0


WATCH = {hooks.awaits_touch: is_awaited, hooks.observe: watch}


@attrs.frozen(eq=False)
class Watched:
    """End of a watched run: motion (n, 6) as x, y, angle, vx, vy, spin, and what was seen."""

    motion: np.ndarray
    status: Status
    time: float
    steps: int
    rejected: int
    error: float
    contacts: int
    deepest: float
    touch_time: float
    touch_gap: float

    @property
    def position(self):
        return self.motion[:, :3]

    @property
    def velocity(self):
        return self.motion[:, 3:]


def watched(
    system, until, *, max_steps=10**12, awaited=False, capacity=256, jit=True, largest_step=None
):
    """Run a system to a time under the observer above, nothing recorded."""
    observed = np.zeros(OBSERVED_SIZE)
    observed[AWAITED] = float(awaited)
    run = system.begin(until, max_steps=max_steps, observer=WATCH, observed=observed, jit=jit)
    run.work = work_of(run.scene, *system.motion(), capacity)
    if largest_step is not None:
        run.clock.largest_step = min(run.clock.largest_step, largest_step)
    status = run.to_end()
    return Watched(
        motion=motion_of(run.work, NOW), status=status, time=run.time, steps=run.steps,
        rejected=run.rejected, error=run.error,
        contacts=int(observed[CONTACTS]), deepest=float(observed[DEEPEST]),
        touch_time=float(observed[TOUCH_TIME]), touch_gap=float(observed[TOUCH_GAP]),
    )  # fmt: skip


def star(points=7, size=6e-6, radius=1e-6, inner=0.45):
    """A non-convex star with rays of unequal length."""
    angles = np.arange(2 * points) * np.pi / points
    lengths = np.where(np.arange(2 * points) % 2, inner, 1.0 + 0.15 * np.cos(3 * angles))
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    return SpheroPolygon(size * lengths[:, None] * rays, radius)


def hook(size=7e-6, radius=0.8e-6):
    """A non-convex C."""
    angles = np.linspace(0.0, 1.4 * np.pi, 9)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    return SpheroPolygon(size * np.concatenate([ring, 0.55 * ring[::-1]]), radius)


def comb(teeth=50, pitch=5e-6, depth=8e-6, radius=0.5e-6):
    """A comb with its teeth up: 4 · teeth vertices, the back included."""
    x = np.repeat(np.arange(teeth), 4) + np.tile([0.0, 0.05, 0.2, 0.25], teeth)
    y = np.tile([0.0, 1.0, 1.0, 0.0], teeth)
    x, y = np.append(x, [x[-1], 0.0]), np.append(y, [-0.3, -0.3])
    return SpheroPolygon(np.column_stack([pitch * x, depth * y]), radius)


def head_on(v0=1e-3, gap=1e-7, r=5e-6, fixed=False):
    """Two equal spheres of 2 kg/m² on the x axis, the left one flying into the right one."""
    left = Body(Sphere(r), (-r - gap / 2, 0.0), velocity=(v0, 0.0), surface_density=2.0)
    right = Body(Sphere(r), (r + gap / 2, 0.0), surface_density=2.0, fixed=fixed)
    return [left, right]


def encounter(spin=2e3):
    """A star and a hook that run into each other off their middles."""
    return [
        Body(star(), (0.0, 0.0), velocity=(0.05, 0.0), spin=spin, surface_density=2.0),
        Body(hook(), (22e-6, -4e-6), 1.0, velocity=(-0.05, 0.0), surface_density=2.0),
    ]


def masses(bodies):
    """(n, 3): m, m, I."""
    return np.array([[body.mass, body.mass, body.inertia] for body in bodies])


def kinetic_energy(bodies, velocity):
    """½ Σ m v² + I ω² [J]."""
    return 0.5 * float(np.sum(masses(bodies) * velocity**2))


def momenta(bodies, position, velocity):
    """Momentum (2,) [kg m/s] and angular momentum about the origin [kg m²/s]."""
    m = masses(bodies)
    (x, y, _), (vx, vy, spin) = position.T, velocity.T
    angular = np.sum(m[:, 0] * (x * vy - y * vx) + m[:, 2] * spin)
    return np.array([*np.sum(m * velocity, axis=0)[:2], angular])
