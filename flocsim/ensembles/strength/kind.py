"""Strengths as a kind of study: a replicate is a bound doublet of a results file, run in flows."""

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import attrs
import numpy as np

from flocsim.ensembles.config.schema import Config, IntegratorConfig, OutputConfig, StopConfig
from flocsim.ensembles.kind import (
    ORDER,
    Code,
    Condition,
    Going,
    Interval,
    Keep,
    Kind,
    Place,
    StudyKind,
    missing,
    places_in,
)
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.storage.identity import physics_digest
from flocsim.ensembles.storage.resume import Beginning
from flocsim.ensembles.storage.row_store import OldTable, ReadOnlyJournal
from flocsim.ensembles.storage.unfinished import Unfinished, store_of
from flocsim.ensembles.strength.opening import FLOWS, Doublet, Halted, Opening
from flocsim.errors import FileError, UsageError
from flocsim.fields import check_whole, is_number
from flocsim.forces.outline import refuse_outlines
from flocsim.io.records import Record
from flocsim.io.results import strength_file
from flocsim.io.results.run_group import SOURCE, now, package_version
from flocsim.io.results.schema import AGGREGATED, AXES, NOT_APPLICABLE, OUTCOMES
from flocsim.io.results.strength_file import FAILED, strengths_in

TESTING = ("ensembles/strength/opening.py",)
"""The code by which a doublet is tested; that by which it is run is part of the study's identity,
without which no replicate is run again."""

AGREED = ("flow", "precision", "study", "study_digest", "flocsim_version", "code")
"""What two surveys have to agree on, so that one can go on with the doublets of the other."""


class Bound(NamedTuple):
    """Where a bound doublet stands in a file: places of type, N and δ, the replicate, its bond."""

    type: int
    vertices: int
    delta: int
    replicate: int
    bond: int


def bound_doublets(results: Any) -> Iterator[Bound]:
    """The doublets that a study has found bound, in the order of the file."""
    outcomes, bonds = results.replicates["outcome"], results.replicates["bond"]
    codes = [OUTCOMES.index(name) for name in AGGREGATED]
    for place in np.argwhere(np.isin(outcomes, codes)).tolist():
        first, second, third, replicate = place
        yield Bound(first, second, third, replicate, int(bonds[tuple(place)]))


@attrs.frozen(eq=False)
class Bonds:
    """What stands in the place of [scene]: the bound doublets of ``results`` in a ``flow``, a key
    of FLOWS; ``count`` of every condition, all for None; ``precision`` of a rate."""

    results: Any
    flow: str = "shear"
    count: int | None = None
    precision: float = 5e-3
    kind: ClassVar[str] = "strength"
    found: list[Bound] = attrs.field(init=False)

    def __attrs_post_init__(self):
        if self.flow not in FLOWS:
            raise UsageError(f"flow must be one of {', '.join(FLOWS)}, found {self.flow!r}")
        if self.count is not None:
            check_whole(self.count, 1, "count")
        if not is_number(self.precision) or not 1e-9 <= self.precision <= 1.0:
            raise UsageError(f"precision must lie between 1e-9 and 1, found {self.precision!r}")
        found = list(bound_doublets(self.results))
        if not found:
            raise UsageError(
                f"{self.results.path} has no bound doublet (class {' or '.join(AGGREGATED)}): "
                "there is no bond to test"
            )
        object.__setattr__(self, "found", found)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.results.types)

    @property
    def delta(self) -> tuple[float, ...]:
        return tuple(float(each) for each in self.results.delta)


def config_of(scene: Any, output: str = "strength.h5") -> Config:
    """What the machine runs: the config of the study, with bonds in the place of collisions."""
    return attrs.evolve(
        scene.results.config, scene=scene, replicates=scene.results.count, stop=StopConfig(),
        integrator=IntegratorConfig(), output=OutputConfig(file=output),
    )  # fmt: skip


@attrs.define(eq=False)
class StrengthStudy(StudyKind):
    """Every bound doublet of a file as a replicate, its number that of the file."""

    config: Config
    flocs: list = attrs.Factory(list)
    bonds: dict[tuple[int, int], int] = attrs.field(init=False)
    wanted: dict[int, list[int]] = attrs.field(init=False)
    rows: dict[Code, dict[str, Any]] = attrs.field(init=False, factory=dict)
    row: ClassVar[np.dtype] = strength_file.ROW
    most_rows: ClassVar[int] = 1
    noun: ClassVar[str] = "doublets"
    check_rows = staticmethod(strength_file.check_opened)

    def __attrs_post_init__(self):
        refuse_outlines(self.config.forces, "the strength of a bond")
        shape = self.shape[:3]
        self.bonds = {
            (int(np.ravel_multi_index(each[:3], shape)), each.replicate): each.bond
            for each in self.scene.found
        }
        self.wanted = {place: [] for place in range(math.prod(shape))}
        for place, replicate in self.bonds:
            if self.scene.count is None or len(self.wanted[place]) < self.scene.count:
                self.wanted[place].append(replicate)

    @property
    def size(self) -> int:
        return sum(map(len, self.wanted.values()))

    @property
    def allowed(self) -> float:
        """The file says which have failed."""
        return math.inf

    @property
    def title(self) -> str:
        return f"{self.size} bound doublets of {self.scene.results.path} in {self.scene.flow}"

    @property
    def source(self) -> dict[str, Any]:
        """That of the study, as far as its file says it."""
        return {name: self.scene.results.run.get(name, "") for name in SOURCE}

    def unneeded(self, place: int) -> list[Interval]:
        """Replicates that are not bound, or not asked for."""
        each = [(replicate, replicate + 1) for replicate in self.wanted[place]]
        return missing(each, 0, self.config.replicates)

    @property
    def kinds(self) -> list[Code]:
        """The first doublet stands for all."""
        place, _ = self.first
        return [self.places[place][:2]]

    @property
    def first(self) -> tuple[int, int]:
        """(place of the condition, replicate) of the first that is wanted."""
        return next((place, each[0]) for place, each in self.wanted.items() if each)

    def asked(self) -> dict[str, Any]:
        """What the study consists of, with how many of each condition are bound."""
        counts = np.zeros(len(self.wanted), int)
        np.add.at(counts, [place for place, _ in self.bonds], 1)
        return super().asked() | {
            "strength": {"bound": counts.tolist(), "wanted": self.size, "about": about_of(self)}
        }

    def compile(self, kinds: Iterable[Code]) -> None:
        """Test the first doublet, once."""
        place, replicate = self.first
        for code in kinds:
            self.rows[code] = self.rows.get(code) or self.tested(self.places[place], replicate)

    def tested(
        self, place: Place, replicate: int, halted: Callable[[], bool] = lambda: False
    ) -> dict[str, Any]:
        """The row of a doublet: it is run again until it is bound, and then in flows."""
        index = self.places.index(place)
        if self.rows and (index, replicate) == self.first:
            return next(iter(self.rows.values()))
        name, n, delta = self.conditions[index]
        start = self.scene.results.replicate(replicate, name, n, delta)
        opening = Doublet(start, self.scene.flow).opening(self.scene.precision, halted)
        return attrs.asdict(opening) | {"bond": self.bonds[index, replicate]}

    def run_task(
        self, place: Place, replicate: int, halted: Callable[[], bool], left: Any = None,
        keep: Keep | None = None, going: Going | None = None,
    ) -> tuple[dict | None, dict | None]:  # fmt: skip
        """The row of a doublet; it is told in words."""
        try:
            row = self.tested(place, replicate, halted)
        except Halted:
            return None, None
        name, n, delta = self.conditions[self.places.index(place)]
        words = in_words(Opening(**{each: row[each] for each in row if each != "bond"}))
        if going is not None:
            going(f"type {name}, N = {n}, delta {delta:g}, replicate {replicate}: {words}")
        return row, self.note(place, replicate, words) if row["status"] == FAILED else None

    def has_failed(self, column: Callable[[str], np.ndarray]) -> np.ndarray:
        return column("status") == FAILED


def about_of(study: StrengthStudy, machine: dict | None = None) -> dict[str, Any]:
    """What two surveys have to agree on."""
    scene = study.scene
    return {
        "flow": scene.flow, "precision": scene.precision, "study": Path(scene.results.path).name,
        "study_digest": digest_of(scene.results), "flocsim_version": package_version("flocsim"),
        "code": physics_digest(names=TESTING),
    }  # fmt: skip


def digest_of(results: Any) -> str:
    """A hash of what the doublets of a file follow from, and of which are bound by what."""
    found = hashlib.blake2b(digest_size=16)
    facts = results.stored("identity"), list(results.types)
    found.update(json.dumps(facts, sort_keys=True).encode())
    rows = results.replicates["outcome"], results.replicates["bond"]
    for values in (results.vertices, results.delta, *rows):
        array = np.ascontiguousarray(values)
        found.update(f"{array.shape} {array.dtype.str}".encode())
        found.update(array.tobytes())
    return found.hexdigest()


def old_rows(output: str | Path, resources: ExitStack) -> OldTable:
    """The doublets of an earlier survey, in arrays of all replicates."""
    found = strength_file.read_strengths(output)
    axes = [found.conditions.axes[name].values.tolist() for name in AXES]
    at = tuple(found.column(name) for name in (*AXES, "replicate"))
    count = int(at[3].max(initial=-1)) + 1
    if len(set(zip(*at, strict=True))) < len(at[0]) or np.any(at[3] < 0):
        raise ValueError("it has the same doublet twice")
    columns = {}
    for name in strength_file.ROW.fields or ():
        blank = NOT_APPLICABLE if name == "bond" else 0
        columns[name] = np.full((*map(len, axes), count), blank, strength_file.ROW[name])
        columns[name][at] = found.column(name)
    places = places_in(*axes)
    there: dict[Condition, list[Interval]] = {condition: [] for condition in places}
    by_place = {place: condition for condition, place in places.items()}
    for t, v, d, replicate in zip(*(each.tolist() for each in at), strict=True):
        there[by_place[t, v, d]].append((replicate, replicate + 1))
    run = {"identity": json.dumps({name: found.about.get(name) for name in AGREED})}
    run |= {name: str(found.about[name]) for name in ("date", "cpus") if name in found.about}
    return OldTable(columns, places, count, run, found, there)


def results(
    study: StrengthStudy, start: Beginning, count: int, run: dict, comm: Communicator,
    output: str | Path | None, warn: Callable[[str], object], in_memory: bool,
) -> strength_file.Strengths:  # fmt: skip
    """The Strengths of all that was tested, in the order of the study."""
    store, bound = start.store, np.array(study.asked()["strength"]["bound"])
    about = study.source | start.identity | {"complete": True, "cpus": run["cpus"]}
    about["date"] = store.old.more.about.get("date") if store.old else now()
    found = strengths_in(store, bound.reshape(study.shape[:3]), about, study.bonds)
    if output is not None:
        strength_file.write_strengths(output, found, start.replacing)
    return found


def in_words(opening: Opening) -> str:
    """What was found of one doublet, in words."""
    runs = f"({opening.runs} runs)"
    word = strength_file.STATUS[opening.status]
    if word == "opened":
        return f"opens at {opening.opens:.4g} 1/s {runs}"
    if word == "opens_at_least_rate":
        return f"opens at {opening.opens:.4g} 1/s already, the lowest rate {runs}"
    if word == "holds_at_most_rate":
        return f"holds up to {opening.holds:.4g} 1/s, the highest rate {runs}"
    return f"a run failed above {opening.holds:.4g} 1/s {runs}"


SURVEY = {"bound": [int], "wanted": int, "about": {}}
"""What a session says of strengths, as a pattern."""


def so_far(path: Path, sessions: list[dict], found: list[Record]) -> Unfinished:
    """What a journal has of the strengths of bonds."""
    asked = sessions[-1]["asked"]
    survey, shape = asked["strength"], tuple(len(asked[name]) for name in ORDER)
    if len(survey["bound"]) != np.prod(shape):
        raise FileError(f"{path} does not record what is bound")
    bound = np.array(survey["bound"], dtype=np.int64).reshape(shape)
    about = survey["about"] | {"asked": survey["wanted"], "complete": False}
    with ReadOnlyJournal(str(path)) as journal:
        store, notes, unread = store_of(
            journal, sessions, found, asked, strength_file.ROW, strength_file.check_opened
        )
        made = strengths_in(store, bound, about)
    done, wanted = store.there(), survey["wanted"]
    return Unfinished(
        path, strength_file.FORMAT, made, done, wanted, notes, sessions, unread, "doublets"
    )


KIND = Kind(
    scenes=(Bonds,),
    make=lambda config, flocs: StrengthStudy(config), identity=about_of, code=TESTING,
    old_rows=old_rows, results=results,
    total=lambda found: len(found.column("status")), so_far=so_far, asked={"strength": SURVEY},
)  # fmt: skip
