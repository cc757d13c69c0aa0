"""StudyResults: a results file with its arrays, tables and figures; replicates of it, or of any
study, run again, their motions kept as Trajectories.
"""

import functools
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.collision.draw import FAILURES, Draw
from flocsim.ensembles.collision.outcomes import OBSERVER
from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.config.sources import Allowed, Sources
from flocsim.ensembles.contents import Example, stored_in
from flocsim.ensembles.diagnose.spheres import water_facts
from flocsim.ensembles.kind import flocs_of, study_of
from flocsim.ensembles.pairs.results import CONTENTS
from flocsim.ensembles.storage.identity import differences, identity_of
from flocsim.ensembles.study import Study, says_outcome
from flocsim.errors import ConfigError, FileError, FlocsimError, UsageError
from flocsim.fields import is_whole
from flocsim.geometry.shapes.shape import Shape
from flocsim.integrators.base import Integrator
from flocsim.io.labelled import Labelled, Tables
from flocsim.io.plots.results import FIGURES
from flocsim.io.plots.style import CLASS_WORDS, Figure, add_foot, save
from flocsim.io.results.file import FORMAT, instructive_of_each, read_results
from flocsim.io.results.kernel_group import KERNEL_GROUP
from flocsim.io.results.schema import FLAGS, GROUPS
from flocsim.run import Run
from flocsim.trajectories.figures import motion_data
from flocsim.trajectories.replay import Origin
from flocsim.trajectories.trajectory import Trajectory

Place = tuple[int, int, float]
"""Of a condition: index of the type, N, share of δ_max."""


def place_of(
    config: Config, type: str | None, vertices: int | None, delta: float | None, dashes: str = ""
) -> Place:
    """The condition with these values: by default the first type, the last N, the first δ.
    ``dashes``: before the names of the options, for messages."""
    counts, shares = config.shapes.vertices, config.scene.delta
    return (
        chosen(type, config.scene.names, f"{dashes}type", 0),
        counts[chosen(vertices, counts, f"{dashes}vertices", -1)],
        shares[chosen(delta, shares, f"{dashes}delta", 0)],
    )


def chosen(value: Any, known: Sequence, option: str, default: int) -> int:
    """The place of a value among those that there are; UsageError where it is none of them."""
    known = list(known)
    if value is None:
        value = known[default]
    if value not in known:
        raise UsageError(f"{option} must be one of {', '.join(map(str, known))}, found {value}")
    return known.index(value)


def one_count_study(config: Config, vertex_count: int) -> Study:
    """Return a Study with one number of vertices: the flocs need no fits at the others."""
    shapes = attrs.evolve(config.shapes, vertices=(vertex_count,))
    return study_of(attrs.evolve(config, shapes=shapes))


def begin_replicate(draw: Draw, steps: int, method: Integrator | None, record: bool = False) -> Run:
    """Return a Run of a replicate that has yet to take its first step; see Draw.begin."""
    encounter = draw.encounter
    driver = encounter.system.compose(observer=OBSERVER)
    return draw.begin(driver, steps, integrator=method, record=record)


def replicate_of(replicate: int, place: Place, study: Study) -> Trajectory:
    """Return the Trajectory of one replicate of a `one_count_study`, its ``row`` in words."""
    if not is_whole(replicate) or not replicate >= 0:
        raise UsageError(f"replicate must be a whole number of at least 0, found {replicate!r}")
    began, draw = time.perf_counter(), study.draw(*place, int(replicate))
    system = draw.encounter.system

    def attempt(steps: int, method: Integrator | None = None) -> tuple[dict, Trajectory]:
        fresh = functools.partial(begin_replicate, draw, steps, method)
        run = fresh(record=True)
        status = run.to_end()
        row = draw.row_of_run(run, status)
        origin = Origin(
            system.bodies, system.forces, system.fluid, method or system.integrator, fresh, run,
            ((run.steps, float(run.clock.until)),),
        )  # fmt: skip
        lasted = time.perf_counter() - began
        return row, Trajectory.of(run, status, lasted, row=row_in_words(row), origin=origin)

    row, found = attempt(study.config.integrator.max_steps)
    if again := study.second_attempt(row):
        row, second = attempt(*again)
        return second if says_outcome(row) else found
    return found


def row_in_words(row: dict) -> dict:
    """A row of the table of replicates with the words of its codes."""
    words = {name: dict(zip(*flags, strict=True)) for name, flags in FLAGS.items()}
    words["failure"] = dict(enumerate(FAILURES))
    return {name: words[name][value] if name in words else value for name, value in row.items()}


REPEATED = ("outcome", "inside", "bond")
"""What of a row has to come out again."""

INDICES = {name: group.index for name, group in GROUPS.items()}


class StudyResults(Tables):
    """Results of a study of pairs or kernels, as `flocsim.open` returns them (docs/results.md).

    Attributes
    ----------
    types, vertices, delta : arrays
        Axes of the conditions; each condition has ``count`` replicates.
    probabilities, pooled, differences, numerics, outlines : dict of str to array
        Tables along these axes.
    replicates : dict of str to (type, vertices, delta, replicate) array
        Every single encounter, read when first used.
    kernel : Kernel or None
        Widths and kernels of a kernel study.
    config : Config
        Config that the study was run with.
    run : dict
        Metadata of the run.
    """

    indices = INDICES
    exported: Sequence[str] = ("probabilities", "replicates")
    format = FORMAT

    def __init__(self, path: str | os.PathLike, allowed: Allowed | None = None) -> None:
        self.results = results = read_results(path)
        self.path, self.allowed = Path(path), allowed or Allowed()
        self.folder = self.allowed.folder or self.path.parent
        self.types, self.vertices, self.delta = results.types, results.vertices, results.delta
        self.count, self.run = results.count, results.run
        self.probabilities, self.pooled = results.probabilities, results.pooled
        self.differences, self.kernel = results.differences, results.kernel
        self.numerics, self.outlines = results.numerics, results.outlines
        if self.kernel is not None:
            self.indices = INDICES | {"kernel": KERNEL_GROUP.index}
            self.exported = ("kernel", *self.exported)
        self.studies: dict[int, Study] = {}

    @functools.cached_property
    def replicates(self) -> dict[str, np.ndarray]:
        """{column: (type, vertices, delta, replicate)} of all replicates, read from the file.

        Raises FileError if another file has replaced it.
        """
        assert self.results.replicates is not None
        return dict(self.results.replicates)

    def load_all(self) -> None:
        """Read all rows now, so that the file can be deleted."""
        self.results = attrs.evolve(self.results, replicates=self.replicates)
        self.path = Path("results in memory")

    @functools.cached_property
    def config(self) -> Config:
        """Config that the study was run with, including command-line values."""
        text = str(self.run.get("config", ""))
        if not text:
            raise FileError(f"{self.path} has no config: it was not written by flocsim ensemble")
        sources = Sources(text, allowed=self.allowed)
        try:
            return load_config(self.folder / "study.toml", self.stored("overrides"), sources)
        except ConfigError as error:
            line, *more = str(error).split("\n")
            further = f" (and {len(more)} more)" if more else ""
            raise ConfigError(
                f"the config in {self.path} cannot be used: {line}{further}"
            ) from error

    def stored(self, name: str) -> dict:
        """Return an entry of the group ``run`` that is stored as JSON."""
        return stored_in(self, name)

    def table(self) -> str:
        """Return the table that `flocsim info` prints: counts and probabilities of every condition.

        Returns
        -------
        str
        """
        return CONTENTS.table(self.results)

    def labelled(self, group: str = "probabilities") -> Labelled:
        """Return the arrays of a group with their axes.

        Parameters
        ----------
        group : str
            "probabilities", "pooled", "replicates", "kernel", or another group of the file.

        Returns
        -------
        Labelled
            Axes and columns with units and meanings; see also `to_xarray` and `to_pandas`.

        Raises
        ------
        UsageError
            If the file has no such group.
        """
        group = self.known(group)
        if self.kernel is not None and group == "kernel":
            found = self.kernel.labelled()
            radii = found.axes.pop("r_eq")
            by_size = {"r_i": radii, "r_j": attrs.evolve(radii, axes=("j",))}
            return attrs.evolve(found, axes=found.axes | by_size)
        if not getattr(self.results, group):
            raise UsageError(f"{self.path} has no group {group}: it was written without it")
        return self.results.labelled(group)

    def plot(
        self, figure: str = "overview", file: str | os.PathLike | None = None, *,
        overwrite: bool = False,
    ) -> Figure:  # fmt: skip
        """Draw one of the figures of `flocsim plot`.

        Parameters
        ----------
        figure : str
            Name of the figure.
        file : path, optional
            Where to write it.
        overwrite : bool
            Whether to rename an existing file instead of raising FileError.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        UsageError
            If the figure is unknown; the message lists those that exist.
        FileError
            If the file exists or cannot be written.
        """
        if figure not in FIGURES:
            raise UsageError(f"figure must be one of {', '.join(FIGURES)}, found {figure!r}")
        drawn = FIGURES[figure](self.results)
        add_foot(drawn, CONTENTS.source(self.results))
        if file is not None:
            save(drawn, Path(file), overwrite)
        return drawn

    def replicate(
        self, replicate: int = 0, type: str | None = None, vertices: int | None = None,
        delta: float | None = None,
    ) -> Trajectory:  # fmt: skip
        """Run one replicate of the file again, and return its motion.

        Parameters
        ----------
        replicate : int
            Index of the replicate, from 0.
        type : str, optional
            Collision type; the first by default.
        vertices : int, optional
            N; the last by default.
        delta : float, optional
            Displacement δ/δ_max; the first by default.

        Returns
        -------
        Trajectory
            Its ``row`` has the row of the table of replicates, in words.

        Raises
        ------
        UsageError
            If the file has no such replicate, if the shape library is not beside the results (see
            ``folder`` of `flocsim.open`), or if this version of flocsim computes other results.
        ConfigError
            If the study has your own class and its module is not allowed (see `flocsim.open`).
        """
        if not is_whole(replicate) or not 0 <= replicate < self.count:
            raise UsageError(
                f"replicate must be a whole number from 0 to {self.count - 1}, found {replicate!r}"
            )
        place = place_of(self.config, type, vertices, delta)
        n, share = self.vertices.tolist().index(place[1]), self.delta.tolist().index(place[2])
        found = replicate_of(int(replicate), place, self.study_with(place[1]))
        assert self.results.replicates is not None and found.row is not None, "rows of a study"
        stored = {name: self.results.replicates[name] for name in REPEATED}
        at = place[0], n, share, int(replicate)
        row = row_in_words({name: column[at] for name, column in stored.items()})
        for name in REPEATED:
            if found.row[name] != row[name]:
                self.refuse(f"{name} is {row[name]} in the file, {found.row[name]} now")
        return found

    def in_water(self) -> list[dict[str, Any]]:
        """Return collision efficiencies of equivalent spheres, with and without hydrodynamics.

        Returns
        -------
        list of dict
            Of each collision type "type", "water" and "alone": fraction of the rectilinear kernel
            that touches with hydrodynamic interaction, and without.

        Raises
        ------
        UsageError
            If the efficiency is not known for such a study.

        Notes
        -----
        Trajectories of spheres in three dimensions without inertia
        (`flocsim.hydrodynamics.Meeting`); takes about a second for each type.
        """
        return water_facts(self.config)

    def study_with(self, vertices: int) -> Study:
        """Return the study of the file with one number of vertices, to run replicates again.

        Raises UsageError if this version of flocsim would compute other results.
        """
        if vertices not in self.studies:
            config, identity = self.config, self.stored("identity")
            study = one_count_study(config, vertices)
            for line in differences(identity, identity_of(study)):
                self.refuse(line)
            self.studies[vertices] = study
        return self.studies[vertices]

    def refuse(self, unlike: str) -> None:
        """Raise UsageError for a difference between the file and this machine."""
        raise UsageError(
            f"{self.path} cannot be reproduced: {unlike}; use the version of flocsim, the files "
            "and the kind of machine that it was made with"
        )


def examples_of(opened: StudyResults) -> list[Example]:
    """Return a replicate of each class that the file has, chosen by `instructive_of_each`."""
    found = []
    for outcome, ((t, v, d, k), why) in instructive_of_each(opened.results).items():
        name, vertices, delta = opened.types[t], int(opened.vertices[v]), float(opened.delta[d])
        heading = CLASS_WORDS[outcome]
        at = "" if opened.kernel else f"δ = {delta:g}, "
        title = f"Type {name}, N = {vertices}, {at}replicate {k}: {why}."
        try:
            run = opened.replicate(k, name, vertices, delta)
            found.append(Example(heading, title, motion_data(run)))
        except FlocsimError as error:
            found.append(Example(heading, title, reason=" ".join(str(error).split())))
    return found


def outlines_of(opened: StudyResults) -> dict[str, Shape]:
    """Return the flocs that the study of a file draws from, by name; none where its config cannot
    be used here."""
    try:
        # Replicates that were run again have read the flocs.
        again = [study.flocs for study in opened.studies.values()]
        flocs = again[0] if again else flocs_of(opened.config)
    except FlocsimError:
        return {}
    return {floc.name: floc.shapes[max(floc.shapes)] for floc in flocs if floc.shapes}
