"""Runs a study on the ranks of a job: from a config to Results, or to a results file.

Rank 0 `lead`s: it knows what is missing, hands it out, takes it in and writes the results. All
others `follow`: they run the chunks that rank 0 gives them. Rank 0 runs chunks as well.
"""

import contextlib
import json
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.compiler.processor import cpu_kind
from flocsim.ensembles.config import contents_of
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.config.sources import kept_sources
from flocsim.ensembles.contents import file_kind
from flocsim.ensembles.diagnose.preflight import IMPLIED
from flocsim.ensembles.estimates.statistics import borders
from flocsim.ensembles.kind import (
    MOST_ROWS,
    StudyKind,
    flocs_of,
    study_of,
    total,
)
from flocsim.ensembles.parallel.agreement import Facts, disagreement
from flocsim.ensembles.parallel.communicator import (
    Communicator,
    ExitCode,
)
from flocsim.ensembles.parallel.coordinator import Coordinator, RemoteCoordinator, run_chunks
from flocsim.ensembles.parallel.processes import in_copies
from flocsim.ensembles.parallel.schedule import Schedule, StudyState
from flocsim.ensembles.storage.identity import identity_of
from flocsim.ensembles.storage.resume import Beginning, begin, claim
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.storage.unfinished import refuse_other_part
from flocsim.errors import FlocsimError, UsageError
from flocsim.io.journal import Journal
from flocsim.io.results.run_group import (
    distinct,
    mixture_warnings,
    provenance,
    source_line,
    storable,
)
from flocsim.io.terminal import Progress
from flocsim.process import INTERRUPTION, STOPPED


@attrs.define
class Ended:
    """How a run ended: exit code 0 or STOPPED, on all ranks; on rank 0 the rest as well.

    ``count``: with how many replicates of each condition the study has ended, ``total`` in all.
    """

    code: int = 0
    results: Any = None
    computed: int = 0
    wall_time: float = 0.0
    count: int = -1
    total: int = 0


class SharedError(Exception):
    """An error of rank 0, the argument, of which the other ranks have the exit code."""


class RankZeroFailed(Exception):
    """What the other ranks have of it: rank 0 says why; the argument is the exit code."""


def run(config: Config, comm: Communicator | None = None, quiet: bool = True) -> Any:
    """Run a config's study in memory; its results on rank 0, None on the others.

    ``comm`` has the ranks of the job (default: this process alone). The arrays of the results are
    the same whatever the number of ranks.
    """
    comm = comm or Communicator()
    try:
        study, identity, cpus = join(config, comm)
        if comm.rank > 0:
            return follow(study, comm).results
        store = RowStore(Journal(), study.conditions, study.row)
        start = Beginning(store, identity, cpus_now=cpus)
        return lead(study, start, comm, progress_of(study, quiet)).results
    except SharedError as error:
        raise error.args[0] from None


def run_to_file(
    config: Config, comm: Communicator, output: str | Path, mode: str, quiet: bool = True,
    overwrite: bool = False, plan: str | None = None,
) -> Ended:  # fmt: skip
    """Run a config's study into the results file ``output``: how it Ended.

    ``mode`` says what to do about an unfinished run (flocsim.ensembles.storage.resume). What is
    finished goes into a journal beside the file, and from there into the file when all is. Rank 0
    locks it before it does anything else, and to the end. ``overwrite``: what lies at ``output``
    and is not to be extended is kept under another name. ``plan``: that of a sweep, which says what
    study this has to be.
    """
    if comm.rank > 0:
        return follow(join(config, comm)[0], comm)
    with sharing_errors(comm):
        journal, remarks = claim(output, mode, overwrite)
    with contextlib.ExitStack() as resources:
        resources.callback(journal.release)
        study, identity, cpus = join(config, comm)
        progress = progress_of(study, quiet)
        with sharing_errors(comm):
            if plan is not None:
                refuse_other_part(plan, str(output), identity)
            start = begin(
                study, identity, output, mode, journal, contents_of(study.format).old_rows, cpus,
                overwrite,
            )  # fmt: skip
        # Once nothing else stands in the way: what is refused is refused in one line.
        doubts = study.doubts()
        said = (f"warning: {line}" for line in doubts if line != IMPLIED)
        for remark in [*remarks, *start.remarks, *said]:
            progress.warn(remark)
        ended = lead(study, start, comm, progress, output)
        if ended.code == 0 and (start.unasked or start.farthest > ended.count):
            progress.warn(
                f"{journal.path} has more rows than were asked for, and is kept: --resume uses "
                "them when more are asked for"
            )
        elif ended.code == 0:
            journal.remove()
    return ended


def join(config: Config, comm: Communicator) -> tuple[StudyKind, dict, list[dict]]:
    """Make the Study on every rank, and check that all would compute the same rows.

    Return (study, identity, the kinds of CPU of all ranks); the kinds are known on rank 0 alone.
    Rank 0 grows or reads the flocs for all. Where any rank would compute something else, or has
    other versions, none continues: UsageError on rank 0, RankZeroFailed on the others.
    """
    with sharing_errors(comm):
        flocs = flocs_of(config) if comm.rank == 0 else None
    study: Any = study_of(config, hear(comm, flocs))
    own, line = own_facts(study, comm)
    leader = hear(comm, own)
    if own is not None:
        line = disagreement(comm.rank, leader, own)
    answers = comm.gather((line, cpu_kind()))
    with sharing_errors(comm):
        unlike = [line for line, _ in answers or [] if line]
        if unlike:
            more = f" ({len(unlike)} ranks differ)" if len(unlike) > 1 else ""
            raise UsageError(unlike[0] + more)
    cpus = distinct([kind for _, kind in answers or []])
    with sharing_errors(comm):
        study.prepare()
    return study, leader.identity, cpus


def own_facts(study: StudyKind, comm: Communicator) -> tuple[Facts | None, str]:
    """(Facts of this rank, ""), or (None, why there are none); rank 0 speaks for itself."""
    try:
        with sharing_errors(comm) if comm.rank == 0 else contextlib.nullcontext():
            return Facts(identity_of(study)), ""
    except FlocsimError as error:
        return None, f"rank {comm.rank}: {error}"


def hear(comm: Communicator, value: Any) -> Any:
    """Rank 0's value on all ranks; RankZeroFailed where it has none, and says why itself."""
    value = comm.broadcast(value)
    if isinstance(value, ExitCode):
        raise RankZeroFailed(value.code)
    return value


def follow(study: StudyKind, comm: Communicator) -> Ended:
    """What every rank but 0 does: run chunks for rank 0 until there are no more."""
    if hear(comm, None):
        compile_in_turn(study, comm)
    # From here on a signal is rank 0's business, which waits for all ranks to report.
    run_chunks(study, RemoteCoordinator(comm))
    code = comm.receive(0, heed_signals=False).code
    if code not in (0, STOPPED):
        raise RankZeroFailed(code)
    return Ended(code)


def lead(
    study: StudyKind, start: Beginning, comm: Communicator, progress: Progress,
    output: str | Path | None = None,
) -> Ended:  # fmt: skip
    """What rank 0 does: run what is missing, with the others; make the Results.

    They are written into the file ``output`` if given.
    """
    began = time.monotonic()
    with sharing_errors(comm):
        state = make_state(study, start, comm.size)
    if output is not None:
        INTERRUPTION.kept = partial(kept_words, start, state)
    remaining = state.schedule.remaining
    progress.say(announcement(study, comm.size, study.size - remaining))
    if study.remark:
        progress.say(study.remark)
    comm.broadcast(remaining)
    if remaining:
        for line in mixture_warnings(output, start.cpus_found, start.cpus_now):
            progress.warn(line)
        compile_in_turn(study, comm)
    progress.start(state.missing)
    coordinator = Coordinator(comm, state, progress.report)
    with sharing_errors(comm, coordinator):
        coordinator.start()
        run_chunks(study, coordinator)
        coordinator.finish()
        start.journal.sync()
        progress.finish()
        final = state.schedule.final
        ended = Ended(STOPPED if final < 0 else 0, None, state.computed, count=final)
        ended.total = final * len(study.conditions)
        ended.wall_time = time.monotonic() - began
        if ended.code == 0:
            ended.results = make_results(study, start, state, ended, comm.size, output)
    comm.broadcast(ExitCode(ended.code))
    return ended


def kept_words(start: Beginning, state: StudyState) -> str:
    """Say what the journal has of a study that is stopped."""
    count, begun = sum(map(total, start.store.computed)), len(state.begun)
    if not count and not begun:
        return "no replicate was finished"
    others = f" and the states of {begun} others" if begun else ""
    return f"{count} finished replicates{others} are in {start.journal.path}"


@contextlib.contextmanager
def sharing_errors(comm: Communicator, coordinator: Coordinator | None = None) -> Iterator[None]:
    """An error of rank 0 ends the other ranks in good order, so that all have one exit code.

    With a ``coordinator`` they have to be called back from their work first.
    """
    try:
        yield
    except FlocsimError as error:
        if coordinator is not None and not coordinator.give_up():
            raise
        comm.broadcast(ExitCode(error.exit_code))
        raise SharedError(error) from error


def compile_in_turn(study, comm):
    """Compile every kind of code on one rank, in a copy of it; then load it on all ranks."""
    own = study.kinds[comm.rank :: comm.size]
    in_copies([partial(study.compile, [kind]) for kind in study.uncompiled(own)])
    study.compile(own)
    comm.barrier()
    study.compile(study.kinds)


def make_state(study: StudyKind, start: Beginning, ranks: int) -> StudyState:
    """The StudyState of what is missing, for so many ranks."""
    replicates, stop = study.config.replicates, study.config.stop
    found, failed = start.found(replicates), 0
    for place, intervals in enumerate(found):
        for first, stop_at in intervals:
            for low in range(first, stop_at, MOST_ROWS):
                rows = start.store.rows(place, low, min(low + MOST_ROWS, stop_at))
                failed += int(np.sum(study.has_failed(rows.__getitem__)))
    # Where the rule looks, and nowhere below what the results file has of each condition.
    looks = sorted({max(border, start.at_least) for border in borders(stop, replicates)})
    state = StudyState(
        Schedule.of(found, looks, ranks, study.most_rows),
        start.store,
        contents_of(study.format).stop_rule(study, start.store),
        allowed=study.allowed,
        failed=failed,
        notes=start.notes,
        pieces=study.pieces,
        left_of=study.left_of,
        counts_part=study.counts_part,
        about=start.about,
    )
    for task, parts in start.store.parts.items():
        place, replicate = task
        there = any(first <= replicate < end for first, end in found[place])
        if replicate < replicates and not there:
            state.begun[task] = sum(map(study.counts_part, parts.ids))
    return state


def make_results(
    study: StudyKind, start: Beginning, state: StudyState, ended: Ended, ranks: int,
    output: str | Path | None,
) -> Any:  # fmt: skip
    """The results of a finished study; written to ``output``, where there is one."""
    count, in_memory = state.schedule.final, output is None
    if output and (old := start.old) is not None and start.is_covered(count):
        if (tuple(old.conditions), old.count) == (study.conditions, count):
            return file_kind(output).read(output)  # as it is: nothing has been added
        output = None  # it has more than was asked for, and keeps it
    run = facts(study, start, state.notes, ended, ranks)
    return contents_of(study.format).results(study, start, count, run, output, in_memory)


def facts(study, start, notes, ended, ranks):
    config, identity = study.config, start.identity
    more = contents_of(study.format).facts(study)
    added = start.cpus_now if ended.computed else []
    kernels = [value for name, value in identity.items() if name.startswith("kernels.")]
    found = provenance(config.text, config.seed, " ".join(kernels))
    if config.modules:
        found["modules"] = storable(kept_sources(config.modules))
    return found | {
        "overrides": storable(json.dumps(config.overrides)),
        "identity": storable(json.dumps(identity, sort_keys=True)),
        "failed": storable(json.dumps(notes)),
        "ranks": ranks,
        "cpus": storable(json.dumps(distinct([*start.cpus_found, *added]))),
        "sessions": 1 + len(start.history),
        "history": storable(json.dumps(start.history)),
        "computed": ended.computed,
        "wall_time": ended.wall_time,
        **{name: storable(each) for name, each in study.source.items()},
        "warnings": storable(json.dumps(study.doubts())),
        **{k: storable(v) if isinstance(v, str) else v for k, v in more.items()},
    }


def progress_of(study: StudyKind, quiet: bool) -> Progress:
    """What tells how far a study is."""
    return Progress(study.size * study.pieces, quiet, noun=study.noun)


def announcement(study: StudyKind, ranks: int, existing: int = 0) -> str:
    line = f"{study.title}, on {ranks} rank{'s' if ranks > 1 else ''}"
    line += f"; {existing} of them exist already" if existing else ""
    return f"{line}; {source_line(study.source)}"
