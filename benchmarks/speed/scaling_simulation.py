"""Replays measured costs of replicates on simulated ranks, which share the real Schedule."""

import heapq
import time

import attrs
import numpy as np

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.kind import ROW, Condition
from flocsim.ensembles.parallel.communicator import SLEEP, ChunkResult
from flocsim.ensembles.parallel.schedule import Schedule, StudyState, chunk_seconds
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.study import Study
from flocsim.io.journal import Journal

LATENCY = SLEEP + 1e-4
"""Seconds between a rank's request and its arrival, half a look for messages each way included."""

EXACT = 512
"""Replicates of a chunk up to which every cost is drawn; longer ones by their mean and spread."""


@attrs.frozen
class Costs:
    """Measured seconds of single replicates, by condition."""

    conditions: list

    @property
    def number(self):
        """How many were measured."""
        return sum(map(len, self.conditions))

    @property
    def mean(self):
        """Mean [s] over the conditions."""
        return float(np.mean([np.mean(each) for each in self.conditions]))

    @property
    def spread(self):
        """The largest over the median."""
        every = np.concatenate(self.conditions)
        return float(every.max() / np.median(every))


@attrs.frozen
class RankZeroCosts:
    """``answer`` [s] to take in a chunk and hand out another; ``rows`` written [1/s]."""

    answer: float
    rows: float


def measure_costs(count):
    """The Costs of replicates of the paper's types, N = 1 to 64, three displacements."""
    overrides = {
        "replicates": count,
        "scene": {"types": ["I", "II", "III"], "delta": [0.0, 0.4, 0.8]},
    }
    from pathlib import Path

    examples = Path(__file__).resolve().parents[2] / "examples"
    study = Study(load_config(examples / "quickstart.toml", overrides))
    study.compile(study.kinds)
    return Costs([[timed(study, place, k) for k in range(count)] for place in study.places])


def timed(study, place, replicate):
    """Seconds of a processor for a replicate, its shapes made beforehand."""
    from flocsim.ensembles.collision.draw import draws

    study.encounter(*place[:2], draws(study.config.seed, replicate))
    began = time.process_time()
    study.run(*place, replicate)
    return time.process_time() - began


def measure_rank_zero(folder):
    """What rank 0 needs for a chunk: records of 1 row and of 8192, taken in one by one."""
    conditions = (Condition("I", 4, 0.0),)
    rates = {}
    for rows, count in ((1, 2000), (8192, 60)):
        path = folder / f"chunks{rows}.journal"
        store = RowStore(Journal(path), conditions)
        schedule = Schedule.of([[]], [10**9], 1000)
        state = StudyState(schedule, store, lambda stop: False, 1e9)
        table = np.zeros(rows, ROW)
        began = time.perf_counter()
        for _ in range(count):
            chunk = state.next_chunk()
            chunk = chunk._replace(stop=chunk.first + rows)
            state.take_in(ChunkResult(chunk, table))
        store.journal.sync()
        rates[rows] = (time.perf_counter() - began) / count
    per_row = (rates[8192] - rates[1]) / 8191
    return RankZeroCosts(rates[1], 1.0 / per_row)


def run_length(cost, chunk, seconds, rng):
    """(replicates done, seconds taken) of a chunk that is given back when its time is up."""
    count = chunk.stop - chunk.first
    if count <= EXACT:
        ends = np.cumsum(rng.choice(cost, count))
        done = min(int(np.searchsorted(ends, seconds)) + 1, count)
        return done, float(ends[done - 1])
    took = count * cost.mean() + np.sqrt(count) * cost.std() * rng.standard_normal()
    if took <= seconds:
        return count, took
    done = max(int(count * seconds / took), 1)
    return done, took * done / count


def simulate(ranks, replicates, costs, rank_zero):
    """A row of the table: a study of so many replicates on so many ranks."""
    rng = np.random.default_rng(ranks)
    every = [np.array(each) for each in costs.conditions]
    per_condition = max(replicates // len(every), 1)
    schedule = Schedule.of([[] for _ in every], [per_condition], ranks)
    seconds = chunk_seconds(ranks)
    # (time at which a request arrives, rank, its chunk, how much of that is done)
    requests = [(LATENCY, rank, None, 0) for rank in range(ranks)]
    free, busy, work, idle = 0.0, 0.0, 0.0, []
    while requests:
        now, rank, chunk, done = heapq.heappop(requests)
        served = rank_zero.answer + done / rank_zero.rows
        free, busy = max(now, free) + served, busy + served
        if chunk is not None:
            schedule.give_back(chunk, done)
        idle.append(rank)
        while idle and (new := schedule.take()) is not None:
            count, took = run_length(every[new.condition], new, seconds, rng)
            work += took
            heapq.heappush(requests, (free + took + 2.0 * LATENCY, idle.pop(), new, count))
    ideal = work / ranks
    return ranks, f"{replicates:.0e}", ideal, free, ideal / free, busy / free
