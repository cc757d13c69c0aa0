"""Trajectory: what happened in a run, at any time of it; drawn, written, and gone on with."""

import functools
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.errors import FileError, UsageError
from flocsim.fields import check_whole, in_unit, is_number
from flocsim.geometry.shapes.shape import Shape
from flocsim.integrators.amplification import MOST_AMPLIFIED
from flocsim.integrators.base import Status
from flocsim.run import Run
from flocsim.state.work import NOW
from flocsim.trajectories.replay import Contact, Energies, Origin, Replay, energies_of, motion_at

ENDED_FOR_GOOD = (Status.STALLED, Status.TOO_DEEP, Status.NOT_FINITE)
"""Ends from which a run would not get any further."""

FRAMES, ANIMATION_FRAMES = 6, 60


@attrs.frozen(eq=False)
class State:
    """Positions and velocities of n bodies at one time, or at k times.

    Attributes
    ----------
    t : float or (k,) float array
        Time [s].
    position : (n, 3) or (k, n, 3) float array
        x, y and angle [m, m, rad].
    velocity : (n, 3) or (k, n, 3) float array
        Velocity and spin [m/s, m/s, rad/s].
    """

    t: Any
    position: np.ndarray
    velocity: np.ndarray

    def __repr__(self) -> str:
        when = f"{self.t:g} s" if np.ndim(self.t) == 0 else f"{len(self.t)} times"
        return f"State({when}, {self.position.shape[-2]} bodies)"


Watch = Callable[[State], Any]
"""Is shown the State between two steps; what counts as true stops the run."""


@attrs.frozen(eq=False, repr=False)
class Trajectory:
    """The motion of n bodies in a run, and what can be computed from it.

    Attributes
    ----------
    t : (k,) float array
        Times of the start and of every accepted step [s].
    position, velocity : (k, n, 3) float array
        [m, m, rad] and [m/s, m/s, rad/s] at these times.
    status : Status
        How the run ended; its ``reason`` says so in words.
    steps, rejected, evaluations : int
        Numbers of accepted and of rejected steps, and of force evaluations.
    error : float
        Stated error of position at the end [m], propagated from all steps; inf if it is not known,
        as its bound exceeds the distance that the bodies can have moved; NaN if the method does
        not estimate it.
    wall_time : float
        [s]
    amplification : float or None
        Factor by which the motion amplifies a perturbation; None if it was not asked for. Above
        10 the error is not guaranteed, and ``error_text``, which measures it, says so.
    row : dict or None
        Of a replicate of a study: its row of the table of replicates, in words.
    """

    t: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    status: Status
    steps: int
    rejected: int
    evaluations: int
    error: float
    wall_time: float
    amplification: float | None = None
    row: dict | None = None
    origin: Origin | None = None
    stored_shapes: tuple[Shape, ...] = ()

    def __repr__(self) -> str:
        n = self.position.shape[1]
        return (
            f"Trajectory({n} {'body' if n == 1 else 'bodies'}, {self.t[0]:g} to {self.t[-1]:g} s, "
            f"{self.steps} steps, {self.status.name})"
        )

    @functools.cached_property
    def growth(self) -> float | None:
        """Amplification, measured now by a companion run if it has not been; None if it cannot
        be."""
        if self.amplification is None and self.origin is not None and self.origin.measure_growth:
            return self.origin.measure_growth()
        return self.amplification

    @property
    def error_text(self) -> str:
        """Description of the stated error at the end, and of what the motion amplifies.

        Takes as long as the run itself, unless its amplification is known.
        """
        if np.isnan(self.error):
            return "the method does not estimate its error"
        if np.isinf(self.error):
            return "the error is not known: its bound is beyond the reach of the bodies"
        stated = f"stated error {self.error:.2g} m"
        growth = self.growth
        if growth is None:
            return stated
        if growth > MOST_AMPLIFIED:
            return (
                f"{stated}, which is not a guarantee: the motion amplifies a perturbation "
                f"{growth:.2g} times"
            )
        return f"{stated}; the motion amplifies a perturbation {growth:.2g} times"

    @classmethod
    def of(
        cls, run: Run, status: Status, wall_time: float, amplification: float | None = None,
        row: dict | None = None, origin: Origin | None = None,
    ) -> "Trajectory":  # fmt: skip
        """Return the Trajectory of a Run."""
        counts = run.steps, run.rejected, run.evaluations
        error = run.error if np.isfinite(run.clock.tolerance) else float("nan")
        return cls(*run.motion(), status, *counts, error, wall_time, amplification, row, origin)

    def known(self) -> Origin:
        """Return the Origin of the run; raise UsageError for one read from a file."""
        if self.origin is None:
            raise UsageError(
                "this Trajectory has only its motion: run it again with System.run for more"
            )
        return self.origin

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """Shapes of the bodies."""
        return self.stored_shapes or tuple(body.shape for body in self.known().bodies)

    @functools.cached_property
    def all_steps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (k,), positions and velocities of the start and of every step, recorded or not."""
        if len(self.t) == self.steps + 1:
            return self.t, self.position, self.velocity
        replay = Replay(self.known())
        rows = [replay.run.row_now()]
        for step in range(1, self.steps + 1):
            replay.to_step(step)
            rows.append(replay.run.row_now())
        found = np.concatenate(rows)
        states = found[:, 1:].reshape(len(found), -1, 6)
        return found[:, 0], states[:, :, :3], states[:, :, 3:]

    def checked_times(self, times: Any) -> np.ndarray:
        """Return times as an array (k,) [s]; raise UsageError unless the run covers all of them."""
        if isinstance(times, str):
            times = in_unit(times, "s", "t")
        try:
            found = np.atleast_1d(np.asarray(times, dtype=float))
        except (TypeError, ValueError):
            raise UsageError(f"a time must be a number of seconds, found {times!r}") from None
        outside = ~((found >= self.t[0]) & (found <= self.t[-1]))
        if found.ndim != 1 or outside.any():
            wrong = found[outside][0] if outside.any() else times
            raise UsageError(
                f"the run covers times from {self.t[0]:g} to {self.t[-1]:g} s, found {wrong}"
            )
        return found

    def at(self, t: Any) -> State:
        """Return the State at a time, or at several.

        Parameters
        ----------
        t : float, str or (k,) float array
            Time [s], a text such as "5 ms", or an array of times [s].

        Returns
        -------
        State
            With arrays (n, 3) for a single time, else (k, n, 3).

        Raises
        ------
        UsageError
            If the run does not cover a time.

        Notes
        -----
        At a step the state is the computed one. Between two steps it follows from the interpolation
        of the method: for Implicit and Overdamped the power series of the step, or the cubic
        through its stages, whose error is below a quarter of the estimate for that step where the
        motion is smooth; for all others Hermite's cubic, whose error is of order h⁴ in positions.
        """
        wanted = self.checked_times(t)
        times, position, velocity = self.all_steps
        states = np.concatenate([position, velocity], axis=2)
        found = np.empty((len(wanted), *states.shape[1:]))
        implicit = self.origin is not None and self.origin.has_stages
        replay = None
        for place in np.argsort(wanted, kind="stable"):
            time_ = wanted[place]
            step = int(np.searchsorted(times, time_, side="right")) - 1
            if implicit and times[step] != time_:
                replay = replay or Replay(self.known())
                found[place] = replay.within(float(time_), step, times)[0]
            else:
                found[place] = motion_at(times, states, time_)
        if np.ndim(t) == 0:
            return State(float(wanted[0]), found[0, :, :3], found[0, :, 3:])
        return State(wanted, found[:, :, :3], found[:, :, 3:])

    def contacts(self, t: float) -> list[Contact]:
        """Return all contact points at a time.

        Parameters
        ----------
        t : float or str
            Time [s], or a text such as "5 ms".

        Returns
        -------
        list of Contact
            Position, overlap, elastic tangential displacement ξ, and force of each contact point.

        Raises
        ------
        UsageError
            If the run does not cover the time, or was read from a file.

        Notes
        -----
        At a step they are those of the run. Between two steps they follow from the state of `at`,
        with ξ interpolated linearly.
        """
        wanted = self.checked_times(t)
        if len(wanted) != 1:
            raise UsageError("contacts are given for one time: ask for one time after another")
        return next(Replay(self.known()).instants(wanted, self.all_steps[0])).contacts()

    def forces(self, t: Any = None) -> dict[str, np.ndarray]:
        """Return the force and torque of each force on every body.

        Parameters
        ----------
        t : float, str or (k,) float array, optional
            Times [s]; all of ``t`` by default.

        Returns
        -------
        dict of str to (k, n, 3) float array
            Force and torque [N, N, N m] by name; (n, 3) for a single time. Forces have the names of
            their classes; a second one of a class is "Pull (2)".

        Raises
        ------
        UsageError
            If the run does not cover a time, or was read from a file.

        Notes
        -----
        At a step they are those that moved the bodies. Between two steps they follow from the state
        of `at`, whose error stiff contacts amplify.
        """
        wanted = self.checked_times(self.t if t is None else t)
        replay, order = Replay(self.known()), np.argsort(wanted, kind="stable")
        found = {name: np.zeros((len(wanted), *self.position.shape[1:]))
                 for name in replay.single_scenes}  # fmt: skip
        instants = replay.instants(wanted[order], self.all_steps[0])
        for place, instant in zip(order, instants, strict=True):
            for name, scene in replay.single_scenes.items():
                found[name][place] = instant.forces(scene)
        single = t is not None and np.ndim(t) == 0
        return {name: values[0] for name, values in found.items()} if single else found

    def energies(self) -> Energies:
        """Return kinetic energies, and the work of each kind of force, at every step.

        Returns
        -------
        Energies
            Arrays (k,) [J].

        Raises
        ------
        UsageError
            If the run was read from a file.
        """
        times, _, velocity = self.all_steps
        return energies_of(self.known(), times, velocity)

    def go_on(
        self, until: float | str, *, max_steps: int = 1_000_000, watch: Watch | None = None
    ) -> "Trajectory":
        """Continue the same run, and return the Trajectory from its start.

        Parameters
        ----------
        until : float or str
            New end time [s], or a text such as "20 ms".
        max_steps : int
            Largest number of further steps.
        watch : callable, optional
            Function of a State that stops the run, as in `System.run`.

        Returns
        -------
        Trajectory
            The whole run. Contacts continue with their history ξ, the method with its step.

        Raises
        ------
        UsageError
            If the run cannot continue, was read from a file, or has already passed ``until``.
        """
        origin = self.known()
        end: float = in_unit(until, "s", "until")
        if not is_number(end) or not end > self.t[-1]:
            raise UsageError(f"until must be a time above {self.t[-1]:g} s, found {until!r}")
        check_whole(max_steps, 0, "max_steps")
        if self.status in ENDED_FOR_GOOD or self.row is not None:
            reason = self.status.reason if self.row is None else "its study has decided it"
            raise UsageError(f"this run cannot continue: {reason}")
        began, run = time.perf_counter(), origin.ended.revived(origin.begin).copy()
        run.clock.until = end
        run.counts.max_steps += max_steps
        status = watched(run, watch)
        legs = *origin.legs, (run.steps, end)
        # What a companion would be compared with has moved on.
        made = attrs.evolve(origin, ended=run, legs=legs, measure_growth=None)
        return Trajectory.of(run, status, self.wall_time + time.perf_counter() - began, origin=made)

    def plot(
        self, figure: str = "strip", file: str | os.PathLike | None = None, frames: int = FRAMES,
        *, overwrite: bool = False,
    ) -> Any:  # fmt: skip
        """Draw a figure.

        Parameters
        ----------
        figure : str
            "strip" of frames, "energies" (work of each force, and kinetic energy), or, for a pair,
            "distance" of the centres or "forces": those on the second body along the line of
            centres, positive in repulsion.
        file : path, optional
            Where to write the figure.
        frames : int
            Number of frames of the strip.
        overwrite : bool
            Whether to rename an existing file instead of raising FileError.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        UsageError
            If the figure is unknown, or needs two bodies.
        FileError
            If the file exists or cannot be written.
        """
        from flocsim.io.plots.style import save
        from flocsim.trajectories.figures import drawn

        made = drawn(self, figure, frames)
        if file is not None:
            save(made, Path(file), overwrite)
        return made

    def animate(
        self, file: str | os.PathLike, frames: int = ANIMATION_FRAMES, *, overwrite: bool = False
    ) -> None:
        """Write an animation of a pair as a GIF.

        Parameters
        ----------
        file : path
            Name of the GIF.
        frames : int
            Number of frames.
        overwrite : bool
            Whether to rename an existing file instead of raising FileError.

        Raises
        ------
        UsageError
            If there are not two bodies.
        FileError
            If the file exists or cannot be written.
        """
        from flocsim.trajectories.figures import animated

        animated(self, Path(file), frames, rule=overwrite)

    def save(self, file: str | os.PathLike, *, overwrite: bool = False) -> None:
        """Write the motion to HDF5, which `flocsim info`, `flocsim plot` and xarray can read.

        Parameters
        ----------
        file : path
            Name of the file.
        overwrite : bool
            Whether to rename an existing file instead of raising FileError.

        Raises
        ------
        FileError
            If the file exists or cannot be written.
        """
        from flocsim.io.outputs import check_outputs
        from flocsim.io.trajectory import write_trajectory

        check_outputs([file], overwrite)
        facts: dict[str, str | float] = {
            "status": self.status.name, "steps": self.steps, "rejected": self.rejected,
            "error": self.error,
        }  # fmt: skip
        motion = self.t, self.position, self.velocity, self.shapes
        write_trajectory(Path(file), motion, facts, overwrite)

    @classmethod
    def load(cls, file: str | os.PathLike) -> "Trajectory":
        """Read a file of `save`, or of `flocsim trajectory --save`.

        Parameters
        ----------
        file : path
            Name of the file.

        Returns
        -------
        Trajectory
            Motion and shapes, for `at`, `plot` and `export`. Forces, contacts and `go_on` need the
            System and are not available.

        Raises
        ------
        FileError
            If the file is absent, damaged or of another kind.
        """
        from flocsim.io.trajectory import read_trajectory

        found = read_trajectory(file)
        said = found.facts.get
        try:
            status, error = Status[said("status", "FINISHED")], float(said("error", np.nan))
            counts = int(said("steps", len(found.t) - 1)), int(said("rejected", 0)), 0
        except (KeyError, TypeError, ValueError, OverflowError) as wrong:
            raise FileError(f"{file} has no readable trajectory: {wrong}") from wrong
        motion = found.t, found.position, found.velocity
        return cls(*motion, status, *counts, error, np.nan, stored_shapes=found.shapes)

    def export(self, file: str | os.PathLike, *, overwrite: bool = False) -> None:
        """Write the motion for OVITO and HOOMD (.gsd), or for ParaView (.vtkhdf).

        Parameters
        ----------
        file : path
            Name of the file; its ending determines the format.
        overwrite : bool
            Whether to rename an existing file instead of raising FileError.

        Raises
        ------
        UsageError
            If the ending is another one, or gsd is not installed (``pip install
            'flocsim[formats]'``).
        FileError
            If the file exists or cannot be written.

        Notes
        -----
        In GSD lengths are in µm, times in s, and shapes are polygons without holes.
        """
        from flocsim.io.outputs import check_outputs
        from flocsim.io.trajectory import WRITERS

        path, rule = Path(file), overwrite
        write = WRITERS.get(path.suffix.lower())
        if write is None:
            raise UsageError(f"{path}: an exported file must end in {' or '.join(WRITERS)}")
        check_outputs([path], rule)
        write(path, (self.t, self.position, self.velocity, self.shapes), rule)


def watched(run: Run, watch: Watch | None) -> Status:
    """Let a run go on to its end, shown to ``watch`` between all steps: how it ended."""
    if watch is None:
        return run.to_end()
    while (status := run.advance(1)) == Status.PAUSED:
        place, velocity = run.work.place[NOW].copy(), run.work.velocity[NOW].copy()
        if watch(State(float(run.clock.time), place, velocity)):
            return Status.STOPPED
    return status
