"""Replicates that run one after another in one call of compiled code.

Python draws them and makes rows of how they have ended. Between two of them it is not needed: each
begins in the arrays of the one before, which are set to zero, and in the record of a clock and of
counters of its own. What becomes of a replicate does not depend on those around it.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import attrs
import numpy as np

from flocsim.compiler.by_pointer import Stacked, address_of, table_and_kinds
from flocsim.compiler.linker import apart
from flocsim.ensembles.collision.draw import (
    FAILURES,
    Draw,
    failed_row,
)
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.outcomes import OBSERVER
from flocsim.ensembles.kind import ROW
from flocsim.integrators.base import Integrator
from flocsim.integrators.loop.driver import FINISHED, NO_ROOM, PAUSED, STOPPED, advance
from flocsim.io.results.schema import FAILED
from flocsim.run import STEPS_AT_A_TIME, UNABLE, extended, force_to_blame, stated_error
from flocsim.state.clock import Clock, Counts
from flocsim.state.declared import block_of
from flocsim.state.records import Record
from flocsim.state.scene import Scene
from flocsim.state.work import NOW, Work, begin, fitting


class Replicate(NamedTuple):
    """What a replicate has of its own."""

    scene: Scene
    observed: np.ndarray  # the observer's array: flocsim.ensembles.collision.outcomes
    clock: Clock
    counts: Counts


class Progress(Record):
    """How far a batch is."""

    at: int  # number of the replicate at hand
    begun: int  # 1 if that has begun
    steps_left: int  # after so many steps the batch pauses


PLACE, VELOCITY = range(2)
"""What a motion has of each body."""


@apart
def clear(block):
    """Set an array of whole numbers to zero."""
    # Apart, as other code knows this memory by other names, and must not read it before.
    for word in range(block.shape[0]):
        block[word] = 0


def put_motion(work, motion, replicate):
    """Place the bodies where a replicate begins."""
    for body in range(motion.shape[2]):
        for axis in range(3):
            work.place[NOW, body, axis] = motion[replicate, PLACE, body, axis]
            work.velocity[NOW, body, axis] = motion[replicate, VELOCITY, body, axis]


def take_motion(work, motion, replicate):
    """Note where the bodies are as a replicate ends."""
    for body in range(motion.shape[2]):
        for axis in range(3):
            motion[replicate, PLACE, body, axis] = work.place[NOW, body, axis]
            motion[replicate, VELOCITY, body, axis] = work.velocity[NOW, body, axis]


def run_all(replicates, work, block, motion, statuses, record, progress):
    """Run replicates, from the one at hand on, until one ends in another way than by its observer,
    or until the steps are up; return a Status.

    Parameters
    ----------
    replicates : Stacked
        A Replicate each.
    work, block : Work, int array
        The arrays in which they run, and their memory.
    motion : (k, 2, 2, 3) array
        Places and velocities of both bodies, at the start or, of those that have ended, at the end.
    statuses : (k,) int array
        Receives how each has ended.
    record : (0, 13) array
        Steps are not recorded.
    progress : Progress
        Where to go on.
    """
    while progress.at < motion.shape[0]:
        at = progress.at
        replicate = replicates[at]
        if progress.begun == 0:
            clear(block)
            begin(replicate.scene, work, True)
            put_motion(work, motion, at)
            progress.begun = 1
        status = advance(
            replicate.scene, work, replicate.observed, replicate.clock, replicate.counts, record
        )
        if status in (NO_ROOM, PAUSED):
            return status
        take_motion(work, motion, at)
        statuses[at] = status
        progress.at, progress.begun = at + 1, 0
        progress.steps_left -= replicate.counts.steps
        if status != STOPPED or progress.steps_left <= 0:
            return status
    return FINISHED


class GivenUp(Exception):
    """The replicates at hand are given up."""


class Prepared(NamedTuple):
    """A Draw that is ready to run, and its number among those that are run with it."""

    number: int
    draw: Draw
    table: bytes  # its scene's, and what tells the types in that
    kinds: Any
    motion: Any  # at the start
    until: float  # [s]


def prepared(number: int, draw: Draw) -> Prepared:
    """Return a Draw that is ready to run."""
    encounter = draw.encounter
    table, kinds = table_and_kinds(encounter.scene)
    motion = encounter.places(draw.angles, draw.share)
    return Prepared(number, draw, table, kinds, motion, encounter.time_limit(draw.share))


Whys = dict[int, str | Exception]
"""{number of a replicate: why it has failed}: an exception, or words on a force."""


@attrs.define(eq=False)
class Batches:
    """Runs replicates of a study, all those of the same compiled code in the same arrays."""

    drivers: dict[tuple, Any] = attrs.field(factory=dict)
    arrays: dict[tuple, Work] = attrs.field(factory=dict)

    def driver(self, encounter: Encounter, method: Integrator) -> Any:
        """Return the compiled `run_all` of such pairs and a method."""
        key = *encounter.kind, type(method)
        if key not in self.drivers:
            system = encounter.system.changed(integrator=method)
            self.drivers[key] = system.compose(run_all, OBSERVER)
        return self.drivers[key]

    def run(
        self, draws: Sequence[Callable[[], Draw]], max_steps: int, method: Integrator,
        halted: Callable[[], bool] = lambda: False,
    ) -> tuple[np.ndarray, Whys]:  # fmt: skip
        """Run replicates, and return their rows and why some have failed.

        ``draws`` make a Draw each. An exception costs the replicate alone in which it comes up, but
        for a lack of memory. Raises GivenUp where ``halted()``, looked at now and then, says so.
        """
        blank = tuple(failed_row("exception").values())
        rows, whys = np.full(len(draws), np.array(blank, ROW)), Whys()
        alike: dict[tuple, list[Prepared]] = {}
        for number, made in enumerate(draws):
            try:
                ready = prepared(number, made())
            except MemoryError:
                raise
            except Exception as error:
                whys[number] = error
            else:
                alike.setdefault((ready.draw.encounter.kind, ready.kinds), []).append(ready)
        groups = list(alike.values())
        while groups:
            group = groups.pop()
            try:
                self.run_alike(group, max_steps, method, halted, rows, whys)
            except (MemoryError, GivenUp):
                raise
            except Exception as error:
                # Each alone shows which one of them it comes from.
                groups += [[each] for each in group] if len(group) > 1 else []
                whys |= {each.number: error for each in group if len(group) == 1}
        return rows, whys

    def run_alike(
        self, group: Sequence[Prepared], max_steps: int, method: Integrator,
        halted: Callable[[], bool], rows: np.ndarray, whys: Whys,
    ) -> None:  # fmt: skip
        """Run replicates of the same compiled code; write their rows, and why some have failed."""
        first, count = group[0].draw.encounter, len(group)
        key = *first.kind, type(method)
        driver = self.driver(first, method)
        work: Any = self.arrays.get(key)
        for each in group:
            work = fitting(work, each.draw.encounter.scene)
        # What each has of its own: rows of arrays.
        clock, counters = method.fresh_clock(), method.fresh_counts(max_steps)
        clocks, counts = Clock.rows(count), Counts.rows(count)
        clocks[:], counts[:] = clock, counters
        clocks["until"] = [each.until for each in group]
        counts["pause_at"] = STEPS_AT_A_TIME
        observed = np.array([each.draw.encounter.given for each in group])
        start = np.array([each.motion for each in group])
        words = stacked([each.table for each in group], observed, clocks, counts)
        replicates = Stacked(words, Replicate(first.scene, first.given, clock, counters))
        motion, statuses = start.copy(), np.zeros(count, np.int64)
        progress, record = Progress.one(), np.zeros((0, 13))
        while progress.at < count:
            progress.steps_left = STEPS_AT_A_TIME
            block = block_of(work)
            status = driver(replicates, work, block, motion, statuses, record, progress)
            if status == NO_ROOM:
                driver, work = extended(driver, work)
                self.drivers[key], self.arrays[key] = driver, work
                continue
            if progress.begun:
                counts["pause_at"][progress.at] += STEPS_AT_A_TIME
            elif status in UNABLE:
                number, draw, *_ = group[progress.at - 1]
                time = clocks["time"][progress.at - 1]
                whys[number] = force_to_blame(draw.encounter.system, work, time)
            if progress.at < count and halted():
                raise GivenUp
        self.arrays[key] = work
        for k, (number, draw, *_) in enumerate(group):
            velocities, sizes = (start[k, VELOCITY], motion[k, VELOCITY]), draw.encounter.radii
            stated = stated_error(clocks["error"][k], *velocities, sizes, clocks["time"][k])
            row = draw.row(int(statuses[k]), observed[k], clocks[k], counts[k], stated)
            if whys.get(number):
                row |= {"outcome": FAILED, "failure": FAILURES.index("not finite")}
            rows[number] = tuple(row.values())


def stacked(tables: Sequence[bytes], *arrays: np.ndarray) -> np.ndarray:
    """Return the words of one table for each row of some arrays: a table, then those rows."""
    count = len(tables)
    columns: list[Any] = [np.frombuffer(b"".join(tables), np.int64).reshape(count, -1)]
    for array in arrays:
        columns.append(address_of(array) + array.strides[0] * np.arange(count))
        # A row that is an array has its length in the table, too.
        columns += [np.full(count, size) for size in array.shape[1:]]
    return np.column_stack(columns)
