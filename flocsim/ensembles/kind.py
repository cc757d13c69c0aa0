"""What the machine knows of studies of any kind: their conditions, the chunks in which they are run
and stored, and the contract of a kind, what differs between pairs, rates and swarms.

A chunk is a run of replicates of one condition, the unit of handing out, writing and resuming. A
row is what a finished replicate comes to, of the columns of its kind of study; those of pairs are
ROW. What is saved of an unfinished one are its parts, by name. Replicates of one condition are
kept as intervals: sorted, disjoint pairs [first, stop).

A kind gives a StudyKind, its conditions, draws and runs, which every rank has, and a Kind, the
functions by which rank 0 checks, describes and writes such studies. The journal, dealing to ranks
and processes, resuming, identities, signals and progress exist once and ask these two.
`kinds` has all of them, by their scenes.
"""

import json
from collections.abc import Callable, Collection, Container, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import cache
from itertools import product
from typing import Any, ClassVar, NamedTuple

import attrs
import numpy as np

from flocsim.ensembles.config import STUDIES
from flocsim.ensembles.config.schema import Config
from flocsim.errors import visible
from flocsim.io.results.run_group import SOURCE, package_version
from flocsim.io.results.schema import REPLICATES

MOST_ROWS = 16_384
"""Rows of the longest chunk, 2.3 MB."""

ROW = np.dtype([(name, f"<{kind}") for name, (kind, _, _) in REPLICATES.items()])
"""One replicate: its row of the results file."""

COLUMNS = tuple(REPLICATES)

LARGEST_REPLICATE = 2**40

ORDER = ("types", "vertices", "delta")
"""Axes of the conditions of a study, as what was asked for names them."""

Interval = tuple[int, int]


Code = tuple[int, int]
"""Place of a collision type, and N: they stand for all that runs the same compiled code."""

Place = tuple[int, int, float]
"""Of a condition: place of the type, N, share of δ_max."""

Keep = Callable[[str, dict, bytes], object]
"""Saves a part of an unfinished replicate: name, description, data."""

Going = Callable[[str], object]
"""Is told in words how far a replicate is."""


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


def named(condition: Sequence, first: int, count: int) -> str:
    """Return a chunk for messages: "type I, N = 4, delta 0.5, replicates 0 to 63"."""
    name, vertices, delta = condition
    return (
        f"type {visible(name, keep='')}, N = {vertices}, delta {delta:g}, replicates {first} to "
        f"{first + count - 1}"
    )


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
    """What every rank asks of a study. All that is random follows from (seed, replicate).

    A subclass has ``config`` and ``flocs``, and gives `run_task`, `compile` and `check_rows`; the
    rest has a default. A row is what a finished replicate comes to, numbers of the types ``row``.
    """

    config: Config
    flocs: list
    row: ClassVar[np.dtype] = ROW
    most_rows: ClassVar[int] = MOST_ROWS
    """Of a chunk; where it is 1 a replicate may go on from what was kept of it."""
    noun: ClassVar[str] = "replicates"
    """What progress counts."""

    @property
    def scene(self) -> Any:
        """[scene] of the config, of the class that the kind has."""
        return self.config.scene

    @property
    def pieces(self) -> int:
        """How many of these each replicate has."""
        return 1

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """(types, vertices, delta, replicates): how many there are of each."""
        scene = self.config.scene
        counts = (len(scene.names), len(self.config.shapes.vertices), len(scene.delta))
        return (*counts, self.config.replicates)

    @property
    def size(self) -> int:
        return int(np.prod(self.shape))

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """All conditions, in the order of the results file."""
        scene, vertices = self.config.scene, self.config.shapes.vertices
        return tuple(Condition(*each) for each in product(scene.names, vertices, scene.delta))

    @property
    def places(self) -> tuple[Place, ...]:
        """The Place of every condition."""
        scene, vertices = self.config.scene, self.config.shapes.vertices
        return tuple(product(range(len(scene.names)), vertices, scene.delta))

    @property
    def kinds(self) -> list[Code]:
        """What stands for the kinds of compiled code that the study needs."""
        return [(0, self.config.shapes.vertices[0])]

    @property
    def title(self) -> str:
        """The study in a few words, before "on 2 ranks"."""
        types, vertices, delta, replicates = self.shape
        axes = ((types, "type"), (vertices, "vertex count"), (delta, "displacement"))
        words = " x ".join(f"{count} {noun}{'s' * (count != 1)}" for count, noun in axes)
        return f"{self.size} replicates: {words} x {replicates}"

    @property
    def source(self) -> dict[str, Any]:
        """What `source_line` tells of the study: its flocs, its preset, the version of flocsim."""
        found = self.config.shapes.described(len(self.flocs)), self.config.preset or ""
        return dict(zip(SOURCE, (*found, package_version("flocsim")), strict=True))

    @property
    def remark(self) -> str:
        """A further line on it; "" for none."""
        return ""

    @property
    def allowed(self) -> float:
        """How many replicates may fail before the study is given up."""
        return self.config.stop.failed * self.size

    def asked(self) -> dict[str, Any]:
        """What the study consists of, for those who look into its journal."""
        config = self.config
        return {
            "types": list(config.scene.names), "vertices": list(config.shapes.vertices),
            "delta": list(config.scene.delta), "replicates": config.replicates,
        }  # fmt: skip

    def fixed(self, asked: dict[str, Any]) -> dict[str, Any]:
        """{name: what all parts of a sweep have in common} of what `asked` says of one of them."""
        return {name: asked[name] for name in ORDER}

    def compile(self, kinds: Iterable[Code]) -> None:
        """Compile, or load from the disk, what these kinds need."""
        raise NotImplementedError

    def uncompiled(self, kinds: Iterable[Code]) -> list[Code]:
        """Those that no run on this machine has compiled, as far as can be told before they are
        run."""
        return []

    def run_task(
        self, place: Place, replicate: int, halted: Callable[[], bool], left: Any = None,
        keep: Keep | None = None, going: Going | None = None,
    ) -> tuple[dict | None, dict | None]:  # fmt: skip
        """(row, None) of one replicate; (row, note) where it failed; row None where it was halted.

        ``left``: what `left_of` found; ``keep`` and ``going`` are for replicates that take long.
        """
        raise NotImplementedError

    def note(self, place: Place, replicate: int, why: str) -> dict[str, Any]:
        """What is needed to run a replicate again, and why one would, as JSON can hold it."""
        condition, vertices, share = place
        name = self.config.scene.names[condition]
        about = {"type": name, "vertices": vertices, "delta": share}
        return about | {"replicate": replicate, "why": why}

    def check_rows(self, column: Callable[[str], np.ndarray]) -> None:
        """ValueError for rows that no run can have given."""
        raise NotImplementedError

    def has_failed(self, column: Callable[[str], np.ndarray]) -> np.ndarray:
        """Which rows are of failed replicates."""
        raise NotImplementedError

    def check_part(self, name: str, description: dict, data: bytes) -> None:
        """ValueError for what cannot have been saved of a replicate."""
        raise ValueError("unfinished replicates cannot be saved")

    def check_whole(self, rows: np.ndarray, parts: Container[str]) -> None:
        """ValueError where what is saved of the replicate of a row is not all there; ``parts``:
        the names of what there is."""

    def counts_part(self, name: str) -> bool:
        """Whether progress counts a part."""
        return False

    def left_of(self, parts: Any) -> Any:
        """Where a replicate goes on, by its Parts; None: it begins."""
        return None


@attrs.frozen(eq=False)
class OldResults:
    """A results file that is to be extended: the replicates of its ``conditions``, of which it has
    ``count`` each (where not ``sparse``), as ``chunks`` (condition, first replicate, rows);
    ``run``, its scalars; ``found``, what else its kind of study takes from it."""

    conditions: Collection[Condition]
    count: int
    chunks: Iterable[tuple[Condition, int, np.ndarray]]
    run: Mapping[str, Any]
    found: Any = None
    sparse: bool = False


@attrs.frozen(eq=False)
class Kind:
    """What rank 0 asks about a kind of study; ``study`` is a StudyKind, ``results`` what the kind
    makes of one."""

    scenes: Sequence[type]
    """The classes of its [scene]."""
    make: Callable[..., Any]
    """(config, flocs) → study."""
    identity: Callable[..., dict]
    """(study, facts of the machine or None) → all that its rows follow from."""
    code: Sequence[str]
    """Modules of flocsim whose code decides what is in a row."""
    old_rows: Callable[[Any], AbstractContextManager["OldResults"]]
    """(path) → its results file that is to be extended, open as OldResults."""
    results: Callable[..., Any]
    """(study, beginning, count, run, output or None, whether all rows are to be in memory) →
    results, written to the output."""
    total: Callable[[Any], int]
    """How many replicates results have."""
    so_far: Callable[..., Any]
    """(journal, sessions) → Unfinished, what it has so far."""
    flocs: Callable[[Config], list] = lambda config: []
    """The flocs that a config's study needs, grown or read."""
    check: Callable[[Config], object] = lambda config: None
    """Raises the FlocsimError that a config's study would meet."""
    prepare: Callable[[Any, Any], object] = lambda study, comm: None
    """(study, communicator): the same, of what takes all ranks to look at."""
    doubts: Callable[[Any], list[str]] = lambda study: []
    """Lines on what is implausible in a study."""
    facts: Callable[[Any], dict[str, Any]] = lambda study: {}
    """(study) → what the results say of it besides their tables, as JSON can hold it."""
    verdict: Callable[[Any], tuple[int, str]] = lambda found: (0, "")
    """(exit code, what to say of replicates without an outcome; "" for nothing)."""
    dry_run: Callable[[Config, int, bool], str] = lambda config, *_: study_of(config, []).title
    """(config, ranks, with a pilot) → what a study would do."""
    asked: dict[str, Any] = attrs.Factory(dict)
    """What a session of a study of this kind alone says of what was asked, as a pattern."""
    enough: Callable[[Any, Any], Callable[[int], bool]] = lambda study, store: lambda count: False
    """(study, store) → whether so many replicates of each condition are enough."""


@cache
def kinds() -> dict[type, Kind]:
    """Class of [scene] → its Kind; rates are pairs with other draws and conditions."""
    found = [folder.part("kind").KIND for folder in STUDIES.values()]
    return {scene: each for each in found for scene in each.scenes}


def kind_of(config: Config) -> Kind:
    """The Kind of a config's study."""
    return kinds()[type(config.scene)]


def study_of(config: Config, flocs: list | None = None) -> StudyKind:
    """The study of a config of any kind; ``flocs`` are grown or read unless given."""
    study: Any = kind_of(config).make(config, flocs_of(config) if flocs is None else flocs)
    return study


def flocs_of(config: Config) -> list:
    """The flocs that a config's study needs, grown or read."""
    return kind_of(config).flocs(config)


def identity_of(study: StudyKind, machine: dict | None = None) -> dict:
    """{name: text or number} of all that the rows of a study follow from."""
    return kind_of(study.config).identity(study, machine)
