"""The interface that every kind of study implements: pairs, kernels and swarms.

A chunk is a run of replicates of one condition, the unit that is assigned, written and resumed. A
row holds the results of a finished replicate, in the columns of its kind of study; those of pairs
are ROW. The saved parts of an unfinished replicate have names. Replicates of one condition are
stored as intervals: sorted, disjoint pairs [first, stop).

A kind provides a subclass of StudyKind, with the conditions, draws and runs of its replicates, on
every rank; and Contents (`flocsim.ensembles.contents`), with the results made of its rows and the
output of commands. The journal, distribution to ranks and processes, resuming, identities, signals
and progress exist once and use these two. `kinds` lists all kinds by their scenes.
"""

import json
from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import attrs
import numpy as np

from flocsim.ensembles.config import STUDIES
from flocsim.errors import plural
from flocsim.io.results.run_group import SOURCE, package_version
from flocsim.io.results.schema import REPLICATES

if TYPE_CHECKING:  # a kind in one file is imported before the schema, which has its scene
    from flocsim.ensembles.config.schema import Config

MOST_ROWS = 16_384
"""Rows of the longest chunk, 2.3 MB."""

ROW = np.dtype([(name, f"<{kind}") for name, (kind, _, _) in REPLICATES.items()])
"""One replicate: its row of the results file."""

COLUMNS = tuple(REPLICATES)

PHYSICS = (
    "body.py", "state", "system.py", "fields.py", "constants.py", "hooks.py", "run.py",
    "compiler", "bonds", "hydrodynamics", "forces", "integrators", "geometry/shapes",
    "geometry/contact", "io/results/schema.py", "io/results/events.py",
    "ensembles/collision", "ensembles/study.py",
)  # fmt: skip
"""Modules, or folders of such at any depth, whose code decides what becomes of two bodies.
geometry/fit makes shapes: what it made is compared itself. tests/ensembles/storage/test_identity.py
holds this list against all that a replicate imports."""

LARGEST_REPLICATE = 2**40

ORDER = ("types", "vertices", "delta")
"""Axes of the conditions of a study, as what was asked for names them."""

Interval = tuple[int, int]


Code = tuple[int, int]
"""Place of a collision type, and N: they stand for all that runs the same compiled code."""

Numbers = Sequence[float] | np.ndarray
"""The random numbers of a replicate in [0, 1)."""

Keep = Callable[[str, dict, bytes], object]
"""Saves a part of an unfinished replicate: name, description, data."""

Going = Callable[[str], object]
"""Is told in words how far a replicate is."""


class Overseer(NamedTuple):
    """Who looks after replicates that run: ``halted()``, asked now and then, makes them leave off;
    ``keep`` and ``going`` are for replicates that take long."""

    halted: Callable[[], bool] = lambda: False
    keep: Keep | None = None
    going: Going | None = None


class Condition(NamedTuple):
    """A condition by its name: collision type, number of vertices, share of δ_max."""

    type: str
    vertices: int
    delta: float


def places_in(*axes: Iterable) -> dict[Condition, tuple[int, ...]]:
    """Where each condition stands in arrays along these types, numbers of vertices and δ."""
    found = product(*map(enumerate, axes))
    return {
        Condition(str(name), int(n), float(share)): (t, v, d)
        for (t, name), (v, n), (d, share) in found
    }


class Chunk(NamedTuple):
    """Replicates ``first`` to ``stop`` − 1 of the condition at a place of the study's list; where
    there is one alone, ``left``: where it goes on."""

    condition: int
    first: int
    stop: int
    left: Any = None


def layout(row: np.dtype = ROW) -> str:
    """The columns of a chunk as text, to tell another version's."""
    return json.dumps([[name, row[name].str] for name in row.names or ()])


def merged(intervals: Iterable[Interval]) -> list[Interval]:
    """The union of intervals [first, stop), sorted and disjoint."""
    union: list[Interval] = []
    for first, stop in sorted(intervals):
        if union and first <= union[-1][1]:
            union[-1] = (union[-1][0], max(stop, union[-1][1]))
        elif first < stop:
            union.append((first, stop))
    return union


def missing(intervals: Iterable[Interval], first: int, stop: int) -> list[Interval]:
    """What a union leaves out of [first, stop)."""
    gaps, place = [], first
    for start, end in intervals:
        if start >= stop:
            break
        if start > place:
            gaps.append((place, start))
        place = max(place, end)
    if place < stop:
        gaps.append((place, stop))
    return gaps


def total(intervals: Iterable[Interval]) -> int:
    return sum(stop - first for first, stop in intervals)


class StudyKind:
    """A study of one kind: `flocsim.ensembles.contents.Contents` is what becomes of its rows.

    A subclass gives ``scenes``, ``format``, ``row``, `run_task` or `run_some`, and `has_failed`; an
    instance has the ``config`` and the ``flocs`` of a study. All else has a default. All that is
    random follows from (seed, replicate).
    """

    config: "Config"
    flocs: list
    scenes: ClassVar[Sequence[type]]
    """The classes of its [scene]."""
    format: ClassVar[str]
    """What its results files say that they are."""
    code: ClassVar[Sequence[str]] = PHYSICS
    """Modules of flocsim, or folders of such, whose code decides what is in a row."""
    row: ClassVar[np.dtype] = ROW
    """Columns of a finished replicate: numbers."""
    most_rows: ClassVar[int] = MOST_ROWS
    """Of a chunk; where it is 1 a replicate may resume from its parts."""
    noun: ClassVar[str] = "replicates"
    """What progress counts."""
    pieces: int = 1
    """How many of these each replicate has."""
    in_common: ClassVar[Sequence[str]] = ORDER
    """Names in `asked` of what all parts of a sweep have to agree on."""

    def run_task(
        self, condition: Condition, replicate: int, overseer: Overseer, left: Any = None
    ) -> tuple[dict | None, dict | None]:
        """Run one replicate: (row, None), (row, note) where it failed, (None, None) where halted.

        ``left``: what `left_of` found.
        """
        raise NotImplementedError

    def run_some(
        self, condition: Condition, first: int, stop: int, overseer: Overseer, left: Any = None
    ) -> tuple[np.ndarray, list[dict]]:
        """Run replicates from ``first`` on, before ``stop``: one, unless a kind runs several at a
        time. Return their rows, none where halted, and notes on those that have failed."""
        row, note = self.run_task(condition, first, overseer, left)
        rows = [] if row is None else [tuple(row[name] for name in self.row.names or ())]
        return np.array(rows, self.row), [note] if note else []

    def has_failed(self, column: Callable[[str], np.ndarray]) -> np.ndarray:
        """Return flags of the rows of failed replicates; ``column(name)`` gives their values."""
        raise NotImplementedError

    @staticmethod
    def flocs_of(config: "Config") -> list:
        """Grow or read the flocs that a config's study needs."""
        return []

    @staticmethod
    def check(config: "Config") -> None:
        """Raise the FlocsimError that a config's study would meet."""

    def prepare(self) -> None:
        """Raise the FlocsimError that shows only once the study with its flocs is made."""

    def doubts(self) -> list[str]:
        """Return lines on what is implausible in the study."""
        return []

    def identity_facts(self) -> dict[str, Any]:
        """Return what rows follow from besides config, flocs, code and machine: numbers, text,
        and arrays and lists of shapes, which are compared by their digests."""
        return {}

    @property
    def scene(self) -> Any:
        """Return the table [scene] of the config, an instance of one of ``scenes``."""
        return self.config.scene

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Return all conditions in the order of the results file."""
        scene, vertices = self.config.scene, self.config.shapes.vertices
        return tuple(Condition(*each) for each in product(scene.names, vertices, scene.delta))

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Return the numbers of (types, vertex counts, displacements, replicates)."""
        scene = self.config.scene
        counts = (len(scene.names), len(self.config.shapes.vertices), len(scene.delta))
        return (*counts, self.config.replicates)

    @property
    def size(self) -> int:
        """Return the number of replicates of all conditions."""
        return int(np.prod(self.shape))

    @property
    def title(self) -> str:
        """Return the study in a few words, as in "120 replicates: … , on 2 ranks"."""
        types, vertices, delta, replicates = self.shape
        axes = ((types, "type"), (vertices, "vertex count"), (delta, "displacement"))
        words = " x ".join(plural(*axis) for axis in axes)
        return f"{plural(self.size, 'replicate')}: {words} x {replicates}"

    @property
    def flocs_in_words(self) -> str:
        """Return which flocs the study takes."""
        return str(
            self.config.shapes.described(
                len(self.flocs), None, getattr(self.scene, "is_measured", False)
            )
        )

    @property
    def source(self) -> dict[str, Any]:
        """Return the flocs, the preset and the version of flocsim, for `source_line`."""
        found = self.flocs_in_words, self.config.preset or ""
        return dict(zip(SOURCE, (*found, package_version("flocsim")), strict=True))

    @property
    def allowed(self) -> float:
        """Return how many replicates may fail before the study ends with an error."""
        return self.config.stop.failed * self.size

    def asked(self) -> dict[str, Any]:
        """Return the axes and the number of replicates, for readers of the journal."""
        config = self.config
        return {
            "types": list(config.scene.names), "vertices": list(config.shapes.vertices),
            "delta": list(config.scene.delta), "replicates": config.replicates,
        }  # fmt: skip

    @property
    def kinds(self) -> list[Code]:
        """Return one Code for each engine that the study needs to have compiled."""
        return [(0, self.config.shapes.vertices[0])]

    def compile(self, kinds: Iterable[Code]) -> None:
        """Compile these engines, or load them from the disk, by running a replicate of each."""
        for place, vertices in kinds:
            condition = Condition(self.scene.names[place], vertices, self.scene.delta[0])
            self.run_some(condition, 0, 1, Overseer())

    def uncompiled(self, kinds: Iterable[Code]) -> list[Code]:
        """Return those of these engines that are known not to be on the disk yet."""
        return []

    def note(self, condition: Condition, replicate: int, why: str) -> dict[str, Any]:
        """Return what names a failed replicate and its reason, as values that JSON can store."""
        return condition._asdict() | {"replicate": replicate, "why": why}

    def check_whole(self, rows: np.ndarray, parts: Container[str]) -> None:
        """Raise ValueError if saved parts of a finished replicate are missing.

        ``rows``: the row of the replicate; ``parts``: the names of its parts in the journal.
        """

    def counts_part(self, name: str) -> bool:
        """Return True if progress counts a part of this name."""
        return False

    def left_of(self, parts: Any) -> Any:
        """Return the state from which a replicate resumes, by its Parts; None to begin anew."""
        return None


@attrs.frozen(eq=False)
class OldResults:
    """A results file that is to be extended: the replicates of its ``conditions``, of which it has
    ``count`` each, as ``chunks`` (condition, first replicate, rows);
    ``run``, its scalars; ``found``, what else its kind of study takes from it."""

    conditions: Collection[Condition]
    count: int
    chunks: Iterable[tuple[Condition, int, np.ndarray]]
    run: Mapping[str, Any]
    found: Any = None


def kind_of(config: "Config") -> type[StudyKind]:
    """Return the kind of a config's study; rates are pairs with other draws and conditions."""
    folders = {each.scene: each for each in STUDIES.values()}
    folder = folders.get(config.scene.kind, folders[""])
    found = (each for each in folder.part("study").KINDS if type(config.scene) in each.scenes)
    kind: type[StudyKind] = next(found)
    return kind


def study_of(config: "Config", flocs: Sequence | None = None) -> Any:
    """Return the study of a config of any kind; ``flocs`` are grown or read unless given."""
    made: Any = kind_of(config)
    return made(config, flocs_of(config) if flocs is None else list(flocs))


def flocs_of(config: "Config") -> list:
    """Grow or read the flocs that a config's study needs."""
    return kind_of(config).flocs_of(config)
