"""Two bodies let go near each other, run until they touch or have escaped, again and again."""

import math
from collections.abc import Callable, Sequence

import attrs
import numpy as np

import flocsim.arrays as at
from flocsim import hooks
from flocsim.body import Body, Fluid
from flocsim.errors import UsageError
from flocsim.fields import above_zero, check_whole
from flocsim.forces.base import Force
from flocsim.forces.body_forces import key_of, thermal_in
from flocsim.geometry.contact.near_pairs import gap_between
from flocsim.integrators.base import Integrator, Status
from flocsim.integrators.implicit import Overdamped
from flocsim.integrators.rhs.views import centre_line
from flocsim.io.confidence import wilson
from flocsim.run import Run
from flocsim.system import System

TOUCHED, ESCAPED = 1, 2
"""Codes of the observer."""

ESCAPE, OBSERVED_SIZE = range(2)
"""Places in ``observed``: the centre distance at which bodies have escaped [m]."""

MOST_STEPS = 10_000_000
"""Steps of a run unless given."""


def always(observed):
    """A touch ends a step of any method."""
    return True


def watch_meeting(scene, work, observed, time):
    """The observer: 0 to go on, TOUCHED or ESCAPED."""
    _, _, distance = centre_line(scene, work, at.NOW, 1, 0)
    if distance >= observed[ESCAPE]:
        return ESCAPED
    return TOUCHED if gap_between(scene, work, 1, 0) <= 0.0 else 0


OBSERVER: dict[Callable, Callable] = {hooks.awaits_touch: always, hooks.observe: watch_meeting}


@attrs.frozen
class Meetings:
    """What became of so many pairs: how many ``touched``, ``escaped``, or did neither within their
    steps (``undecided``); ``times`` (k,) [s] at which each ended, ``steps`` that all took."""

    touched: int
    escaped: int
    undecided: int
    times: np.ndarray = attrs.field(eq=attrs.cmp_using(eq=np.array_equal), repr=False)
    steps: int = attrs.field(repr=False)

    @property
    def probability(self) -> float:
        """Share of the decided that touched; NaN where none is decided."""
        decided = self.touched + self.escaped
        return self.touched / decided if decided else math.nan

    def interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """Wilson's interval of the probability."""
        low, high = wilson(self.touched, self.touched + self.escaped, confidence)
        return float(low), float(high)


def brownian_meetings(
    bodies: Sequence[Body], forces: Sequence[Force], release: float | str, escape: float | str,
    replicates: int, *, seed: int = 0, fluid: Fluid | None = None,
    integrator: Integrator | None = None, max_steps: int = MOST_STEPS, jit: bool = True,
) -> Meetings:  # fmt: skip
    """Let two bodies go with their centres ``release`` apart [m] until they touch or escape.

    Each replicate has angles and kicks of its own, by (seed, replicate) alone. ``forces`` have to
    hold a Thermal and a drag; ``integrator``: Overdamped unless given. Places and angles of
    ``bodies`` do not matter. UsageError for anything but two bodies, a Thermal force, a release
    that keeps them apart at any angle, and an escape further away.
    """
    if len(bodies) != 2:
        raise UsageError(f"a meeting is one of two bodies, found {len(bodies)}")
    if not thermal_in(forces):
        raise UsageError("a brownian meeting needs a Thermal force of a temperature above 0 K")
    check_whole(replicates, 1, "replicates")
    near, far = above_zero(release, "m", "release"), above_zero(escape, "m", "escape")
    touch = sum(body.shape.bounding_radius for body in bodies)
    if not touch < near < far:
        raise UsageError(
            f"release must be between {touch:g} m, where the bodies may touch, and escape = "
            f"{far:g} m, found {near:g} m"
        )
    one, other = bodies
    system = System(
        [attrs.evolve(one, position=(0.0, 0.0)), attrs.evolve(other, position=(0.0, near))],
        forces, integrator or Overdamped(), fluid or Fluid(), seed=seed,
    )  # fmt: skip
    first = system.begin(math.inf, max_steps=max_steps, observer=OBSERVER, jit=jit,
                         observed=np.array([far]))  # fmt: skip
    codes, times, steps = [], [], 0
    for replicate in range(replicates):
        run = placed(first, near, seed, replicate)
        status = run.to_end()
        codes.append(run.code if status == Status.STOPPED else 0)
        times.append(run.time)
        steps += run.steps
    touched, escaped, neither = (codes.count(code) for code in (TOUCHED, ESCAPED, 0))
    return Meetings(touched, escaped, neither, np.array(times), steps)


def placed(first: Run, near: float, seed: int, replicate: int) -> Run:
    """A replicate's Run that has yet to take its first step."""
    run = first.copy()
    stream = np.random.SeedSequence(seed, spawn_key=(replicate,))
    numbers = 2.0 * np.pi * np.random.Generator(np.random.Philox(stream)).random(3)
    run.scene = first.scene._replace(key=key_of(seed, replicate))
    run.work.motion[at.NOW] = 0.0
    run.work.motion[at.NOW, :, 2] = numbers[:2]
    run.work.motion[at.NOW, 1, :2] = near * np.cos(numbers[2]), near * np.sin(numbers[2])
    return run
