"""Replicates that run one after another in one call of compiled code.

Python draws them and makes rows of how they have ended. Between two of them it is not needed: each
begins in the arrays of the one before, which are set to zero, and in the record of a clock and of
counters of its own. What becomes of a replicate does not depend on those around it.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import attrs
import numpy as np

from flocsim.compiler.by_pointer import Stacked, address_of, table_of
from flocsim.ensembles.collision.draw import BLANK, Draw, failed
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.outcomes import BODY_I, BODY_J, OBSERVER
from flocsim.ensembles.collision.start import Start, place_of
from flocsim.ensembles.kind import ROW
from flocsim.integrators.base import Integrator
from flocsim.integrators.loop.driver import FINISHED, NO_ROOM, PAUSED, STOPPED, advance, clear
from flocsim.integrators.rhs.error import outline_size
from flocsim.run import STEPS_AT_A_TIME, UNABLE, extended, force_to_blame, within_reach
from flocsim.state.bodies import ANGLE, X, Y
from flocsim.state.clock import Clock, Counts
from flocsim.state.declared import block_of
from flocsim.state.records import Record
from flocsim.state.scene import Scene
from flocsim.state.work import NOW, Work, begin, fitting


class Replicate(NamedTuple):
    """What the loop is given of a replicate."""

    scene: Scene
    work: Work  # in which all of them run
    observed: np.ndarray  # the observer's array: flocsim.ensembles.collision.outcomes
    clock: Clock
    counts: Counts


class End(Record):
    """How a replicate has ended."""

    status: int  # of its run: flocsim.integrators.base
    first_speed: float  # largest speed of an outline at the start [m/s]
    last_speed: float  # and at the end


class Progress(Record):
    """How far a batch is."""

    at: int  # number of the replicate at hand
    begun: int  # 1 if that has begun
    steps_left: int  # after so many steps the batch pauses


def put_start(scene, work, start):
    """Place the bodies where a replicate begins."""
    place, velocity = work.place, work.velocity
    place[NOW, BODY_J, X], place[NOW, BODY_J, Y] = place_of(scene, start)
    place[NOW, BODY_I, ANGLE], place[NOW, BODY_J, ANGLE] = start.angle_i, start.angle_j
    velocity[NOW, BODY_I, X], velocity[NOW, BODY_J, X] = start.vx_i, start.vx_j
    velocity[NOW, BODY_I, Y], velocity[NOW, BODY_J, Y] = start.vy_i, start.vy_j
    velocity[NOW, BODY_I, ANGLE], velocity[NOW, BODY_J, ANGLE] = start.spin_i, start.spin_j


def largest_speed(scene, work):
    """Return the largest speed of an outline [m/s]."""
    return max(
        outline_size(scene, work.velocity, NOW, BODY_I),
        outline_size(scene, work.velocity, NOW, BODY_J),
    )


def run_all(replicates, starts, block, ends, record, progress):
    """Run replicates, from the one at hand on, until one ends in another way than by its observer,
    or until the steps are up; return a Status.

    Parameters
    ----------
    replicates : Stacked
        A Replicate each.
    starts : (k,) array of Start
        Where they begin.
    block : int array
        The memory of their work arrays.
    ends : (k,) array of End
        Receives how each has ended.
    record : (0, 13) array
        Steps are not recorded.
    progress : Progress
        Where to go on.
    """
    while progress.at < starts.shape[0]:
        at = progress.at
        replicate, end = replicates[at], ends[at]
        work = replicate.work
        if progress.begun == 0:
            clear(block)
            begin(replicate.scene, work, True)
            put_start(replicate.scene, work, starts[at])
            end.first_speed = largest_speed(replicate.scene, work)
            progress.begun = 1
        status = advance(
            replicate.scene, work, replicate.observed, replicate.clock, replicate.counts, record
        )
        if status in (NO_ROOM, PAUSED):
            return status
        end.status, end.last_speed = status, largest_speed(replicate.scene, work)
        progress.at, progress.begun = at + 1, 0
        progress.steps_left -= replicate.counts.steps
        if status != STOPPED or progress.steps_left <= 0:
            return status
    return FINISHED


class Halted(Exception):
    """Raised where replicates are halted before they have ended."""


Reasons = dict[int, str | Exception]
"""{index of a replicate: why it failed}: an exception, or the force to blame in words."""


class Arrays:
    """Work arrays with their memory and their table."""

    def __init__(self, work: Work) -> None:
        self.work, self.block, (self.table, self.kinds) = work, block_of(work), table_of(work)


@attrs.define(eq=False)
class Batches:
    """Runs replicates of a study, all those of the same compiled code in the same arrays."""

    drivers: dict[tuple, Any] = attrs.field(factory=dict)
    arrays: dict[tuple, Arrays] = attrs.field(factory=dict)

    def arrays_for(self, key: tuple, scenes: Iterable[Scene]) -> Arrays:
        """Return those with room for all of some scenes."""
        known = self.arrays.get(key)
        work: Any = known.work if known else None
        for scene in scenes:
            work = fitting(work, scene)
        if known is None or work is not known.work:
            self.arrays[key] = Arrays(work)
        return self.arrays[key]

    def driver(self, encounter: Encounter, method: Integrator, entry: Callable = run_all) -> Any:
        """Return the engine of such pairs and a method, compiled; ``entry``: where it begins."""
        key = *encounter.kind, type(method), entry
        if key not in self.drivers:
            system = encounter.system.changed(integrator=method)
            self.drivers[key] = system.compose(entry, OBSERVER)
        return self.drivers[key]

    def run(
        self, draws: Sequence[Callable[[], Draw]], max_steps: int, method: Integrator,
        halted: Callable[[], bool] = lambda: False,
    ) -> tuple[np.ndarray, Reasons]:  # fmt: skip
        """Run replicates, and return their rows and why some have failed.

        ``draws`` make a Draw each. An exception costs the replicate alone in which it comes up, but
        for a lack of memory. Raises Halted where ``halted()``, looked at now and then, says so.
        """
        blank = tuple((BLANK | failed("exception")).values())
        rows, reasons = np.full(len(draws), np.array(blank, ROW)), Reasons()
        alike: dict[tuple, dict[int, Draw]] = {}
        for number, made in enumerate(draws):
            try:
                draw = made()
                key = draw.encounter.kind, draw.encounter.table[1]
            except MemoryError:
                raise
            except Exception as error:
                reasons[number] = error
            else:
                alike.setdefault(key, {})[number] = draw
        groups = list(alike.values())
        while groups:
            group = groups.pop()
            try:
                self.run_alike(group, max_steps, method, halted, rows, reasons)
            except (MemoryError, Halted):
                raise
            except Exception as error:
                # Each alone shows which one of them it comes from.
                groups += [{number: draw} for number, draw in group.items()] * (len(group) > 1)
                reasons |= dict.fromkeys(group, error) if len(group) == 1 else {}
        return rows, reasons

    def run_alike(
        self, group: Mapping[int, Draw], max_steps: int, method: Integrator,
        halted: Callable[[], bool], rows: np.ndarray, reasons: Reasons,
    ) -> None:  # fmt: skip
        """Run replicates of the same compiled code; write their rows, and why some have failed."""
        numbers, draws, count = list(group), list(group.values()), len(group)
        pairs = [each.encounter for each in draws]
        key = *pairs[0].kind, type(method), run_all
        driver: Any = self.driver(pairs[0], method)
        # What each has of its own: rows of arrays.
        clock, counters = method.fresh_clock(), method.fresh_counts(max_steps)
        clocks, counts = Clock.rows(count), Counts.rows(count)
        clocks[:], counts[:] = clock, counters
        clocks["until"] = [each.encounter.time_limit(each.share) for each in draws]
        counts["pause_at"] = STEPS_AT_A_TIME
        observed = np.array([each.given for each in pairs])
        starts, ends = Start.rows(count), End.rows(count)
        given = [each.encounter.start(each.angles, each.share) for each in draws]
        for name in Start.dtype.fields or ():
            starts[name] = [each.get(name, 0.0) for each in given]
        progress, record = Progress.one(), np.zeros((0, 13))
        arrays = None
        while progress.at < count:
            if arrays is None:
                arrays = self.arrays_for(key, [each.scene for each in pairs])
                one = Replicate(pairs[0].scene, arrays.work, observed[0], clock, counters)
                kinds = (Replicate, *pairs[0].table[1], *arrays.kinds, *table_of(one[2:])[1])
                tables = [each.table[0] + arrays.table for each in pairs]
                replicates = Stacked(stacked(tables, observed, clocks, counts), kinds, one)
            progress.steps_left = STEPS_AT_A_TIME
            status = driver(replicates, starts, arrays.block, ends, record, progress)
            if status == NO_ROOM:
                driver, work = extended(driver, arrays.work)
                self.drivers[key], self.arrays[key], arrays = driver, Arrays(work), None
                continue
            if progress.begun:
                counts["pause_at"][progress.at] += STEPS_AT_A_TIME
            elif status in UNABLE:
                last = progress.at - 1
                system, time = pairs[last].system, clocks["time"][last]
                reasons[numbers[last]] = force_to_blame(system, arrays.work, time)
            if progress.at < count and halted():
                raise Halted
        sizes = [max(shape.bounding_radius for shape in each.shapes) for each in pairs]
        speeds = np.maximum(ends["first_speed"], ends["last_speed"])
        errors = within_reach(clocks["error"], speeds, sizes, clocks["time"])
        for k, (number, draw) in enumerate(group.items()):
            row = draw.row(int(ends[k].status), observed[k], clocks[k], counts[k], errors[k])
            if reasons.get(number):
                row |= failed("not finite")
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
