"""Runs a study on the ranks of a job: from a config to Results, or to a results file.

Rank 0 `lead`s: it knows what is missing, hands it out, takes it in and writes the results. All
others `follow`: they run the chunks that rank 0 gives them. Rank 0 runs chunks as well.
"""

import contextlib
import json
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.compiler.processor import cpu_kind
from flocsim.ensembles.chunks import COLUMNS
from flocsim.ensembles.collision.failures import FAILED, FAILURES
from flocsim.ensembles.collision.pairings import class_facts, class_words
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.doubts import settling_facts, study_doubts
from flocsim.ensembles.equivalent_spheres import sphere_facts
from flocsim.ensembles.estimates.capture import kernel_of
from flocsim.ensembles.estimates.stop_rule import StopRule, borders
from flocsim.ensembles.estimates.summary import Reader, Sums, sums_of, tables_of
from flocsim.ensembles.kernels.study import KernelStudy, study_of
from flocsim.ensembles.parallel.agreement import Facts, disagreement, facts_of
from flocsim.ensembles.parallel.assembly import assemble, assist
from flocsim.ensembles.parallel.communicator import (
    Communicator,
    SerialCommunicator,
    StopRequested,
)
from flocsim.ensembles.parallel.coordinator import Coordinator, RemoteCoordinator
from flocsim.ensembles.parallel.messages import ExitCode, Plan
from flocsim.ensembles.parallel.schedule import Schedule
from flocsim.ensembles.parallel.study_state import StudyState
from flocsim.ensembles.parallel.worker import run_chunks
from flocsim.ensembles.pilot.choice import (
    Choice,
    choice_lines,
    choose,
    first_methods,
    recorded_choice,
)
from flocsim.ensembles.pilot.trials import Job, try_out
from flocsim.ensembles.storage import first_rows
from flocsim.ensembles.storage.cpu_kind import distinct, mixture_warnings
from flocsim.ensembles.storage.identity import arithmetic_digest, identity_of, short
from flocsim.ensembles.storage.plan import refuse_other_part
from flocsim.ensembles.storage.resume import Beginning, begin, claim, recorded_choices
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.study import Study, flocs_of
from flocsim.errors import FlocsimError, UsageError
from flocsim.interruption import INTERRUPTION, STOPPED, stop_requested
from flocsim.io.journal.journal import MemoryJournal
from flocsim.io.provenance import provenance, storable
from flocsim.io.results.file import read_results
from flocsim.io.results.kernel_group import Kernel
from flocsim.io.results.row_file import new_row_file
from flocsim.io.results.schema import Results
from flocsim.io.terminal import Progress, tell

COMPILING = "compiling what no run on this machine has compiled before …"


@attrs.define
class Ended:
    """How a run ended: exit code 0 or STOPPED, on all ranks; on rank 0 the rest as well.

    ``kept``: finished replicates that ``journal`` holds, which is seen to be there; ``count``:
    with how many of each condition the study has ended.
    """

    code: int = 0
    results: Results | None = None
    computed: int = 0
    kept: int = 0
    wall_time: float = 0.0
    journal: str = ""
    count: int = -1


class SharedError(Exception):
    """An error of rank 0, the argument, of which the other ranks have the exit code."""


class RankZeroFailed(Exception):
    """What the other ranks have of it: rank 0 says why; the argument is the exit code."""


def run(config: Config, comm: Communicator | None = None, quiet: bool = True) -> Results | None:
    """Run a config's study in memory; the Results on rank 0, None on the others.

    ``comm`` has the ranks of the job (default: this process alone). The arrays of the Results are
    the same whatever the number of ranks.
    """
    comm = comm or SerialCommunicator()
    try:
        joint = join(config, comm)
        if comm.rank > 0:
            return follow(joint.study, comm).results
        store = RowStore(MemoryJournal(), joint.study.conditions)
        start = Beginning(store, joint.identity, cpus_now=joint.cpus, accuracy=joint.accuracy)
        return lead(joint.study, start, comm, Progress(joint.study.size, quiet)).results
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
        return follow(join(config, comm).study, comm)
    with sharing_errors(comm):
        journal, remarks = claim(output, mode, overwrite)
    with contextlib.ExitStack() as resources:
        resources.callback(journal.release)
        records = recorded_choices(journal) if config.integrator.is_chosen else ()
        joint = join(config, comm, records, quiet)
        progress = Progress(joint.study.size, quiet)
        with sharing_errors(comm):
            if plan is not None:
                refuse_other_part(plan, str(output), joint.identity)
            start = begin(
                joint.study, joint.identity, output, mode, journal, joint.cpus, overwrite,
                joint.accuracy,
            )  # fmt: skip
        resources.enter_context(start.resources)
        # Once nothing else stands in the way: what is refused is refused in one line.
        doubts = study_doubts(config, joint.study.flocs)
        for remark in [*remarks, *start.remarks, *(f"warning: {line}" for line in doubts)]:
            progress.warn(remark)
        ended = lead(joint.study, start, comm, progress, output)
        if ended.code == 0 and start.has_more(ended.count):
            progress.warn(
                f"{journal.path} has rows beyond what was asked for, and stays: --resume takes "
                "them up where more is asked for"
            )
        elif ended.code == 0:
            journal.remove()
    return ended


@attrs.frozen
class Joint:
    """What all ranks have agreed on; ``cpus`` on rank 0 alone: the kinds of CPU of all ranks.

    ``accuracy``: the record of a pilot's choice, where there was one.
    """

    study: Study
    identity: dict
    cpus: list[dict]
    accuracy: dict = attrs.Factory(dict)


def join(
    config: Config, comm: Communicator, records: Sequence[dict] = (), quiet: bool = True
) -> Joint:
    """Make the Study on every rank, and see that all would compute the same rows.

    Rank 0 grows or reads the flocs for all. Where a pilot chooses the methods, all ranks run it,
    unless one of the ``records`` that rank 0 has is of this study. Where any rank would compute
    something else, or has other versions, none goes on: UsageError on rank 0, RankZeroFailed on the
    others.
    """
    with sharing_errors(comm):
        flocs = flocs_of(config) if comm.rank == 0 else None
    study = study_of(config, hear(comm, flocs), first_methods(config))
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
    if not config.integrator.is_chosen:
        return Joint(study, leader.identity, cpus)
    choice = chosen(study, comm, records, quiet)
    study = study.by_methods(choice.methods)
    return Joint(study, identity_of(study), cpus, choice.record)


def chosen(study: Study, comm: Communicator, records: Sequence[dict], quiet: bool) -> Choice:
    """The Choice of a study's methods, on every rank: of a record, or of a pilot that all run."""
    if comm.rank > 0:
        while not isinstance(jobs := hear(comm, None), Choice):
            share_jobs(study, comm, jobs)
        return jobs
    with sharing_errors(comm):
        choice = recorded_choice(study, records)
        if choice is None:
            if not quiet:
                tell(f"a pilot chooses method and tolerance; {COMPILING}")
            choice = choose(study, lambda study, jobs: share_jobs(study, comm, jobs, True))
        if not quiet:
            for line in choice_lines(choice.record):
                tell(line)
    return comm.broadcast(choice)


def share_jobs(study: Study, comm: Communicator, jobs: Sequence[Job], leads: bool = False) -> list:
    """The Trials of a pilot's jobs, of which every rank runs its share; all of them on rank 0.

    Rank 0 ``leads``: the others have the jobs from it, and no Trials. StopRequested there where a
    signal has come.
    """
    if leads:
        comm.broadcast(list(jobs))
    trials = []
    for job in jobs[comm.rank :: comm.size]:
        if comm.rank == 0 and stop_requested():
            raise StopRequested(f"stopped by {INTERRUPTION.name}; go on with --resume")
        trials.append(try_out(study, job)[0])
    shares = comm.gather(trials)
    if shares is None:
        return []
    return [shares[place % comm.size][place // comm.size] for place in range(len(jobs))]


def own_facts(study: Study, comm: Communicator) -> tuple[Facts | None, str]:
    """(Facts of this rank, ""), or (None, why there are none); rank 0 speaks for itself."""
    if comm.rank == 0:
        with sharing_errors(comm):
            return facts_of(study), ""
    try:
        return facts_of(study), ""
    except FlocsimError as error:
        return None, f"rank {comm.rank}: {error}"


def hear(comm: Communicator, value: Any) -> Any:
    """Rank 0's value on all ranks; RankZeroFailed where it has none, and says why itself."""
    value = comm.broadcast(value)
    if isinstance(value, ExitCode):
        raise RankZeroFailed(value.code)
    return value


def follow(study: Study, comm: Communicator) -> Ended:
    """What every rank but 0 does: run chunks for rank 0 until there are no more."""
    plan = hear(comm, None)
    if plan.remaining:
        compile_in_turn(study, comm)
    # From here on a signal is rank 0's business, which waits for all ranks to report.
    run_chunks(study, RemoteCoordinator(comm), plan.key)
    code = assist(study, comm).code
    if code not in (0, STOPPED):
        raise RankZeroFailed(code)
    return Ended(code)


def lead(
    study: Study, start: Beginning, comm: Communicator, progress: Progress,
    output: str | Path | None = None,
) -> Ended:  # fmt: skip
    """What rank 0 does: run what is missing, with the others; make the Results.

    They are written into the file ``output`` if given.
    """
    began = time.monotonic()
    with sharing_errors(comm):
        state = make_state(study, start, comm.size)
    remaining = state.schedule.remaining
    key = short(start.identity)
    progress.say(announcement(study, comm.size, study.size - remaining))
    if classes := class_words(class_facts(study.pairings)):
        progress.say(classes)
    comm.broadcast(Plan(remaining, key))
    if remaining:
        for line in mixture_warnings(output, start.cpus_found, start.cpus_now):
            progress.warn(line)
        progress.say(COMPILING)
        compile_in_turn(study, comm, first_rows.stored_rows(study, start.store))
        progress.say(f"compiled or loaded in {time.monotonic() - began:.1f} s")
    progress.start(remaining)
    coordinator = Coordinator(comm, state, progress.report)
    with sharing_errors(comm, coordinator):
        coordinator.start()
        run_chunks(study, coordinator, key)
        coordinator.finish()
        start.journal.sync()
        progress.finish()
        final = state.schedule.final
        kept = start.in_journal()
        ended = Ended(STOPPED if final < 0 else 0, None, state.computed, kept)
        ended.count, ended.journal = final, str(start.journal.path)
        ended.wall_time = time.monotonic() - began
        if ended.code == 0:
            ended.results = make_results(study, start, state, ended, comm, output, progress)
    comm.broadcast(ExitCode(ended.code))
    return ended


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


def compile_in_turn(study, comm, stored=()):
    """Every kind of code is compiled by one rank; then all load what the others made.

    UsageError where the first rows are not the same on all ranks, and as ``stored``.
    """
    study.compile(study.kinds[comm.rank :: comm.size])
    comm.barrier()
    rows = first_rows.packed(study.compile(study.kinds))
    told = comm.gather((rows, arithmetic_digest()))
    with sharing_errors(comm):
        if told and (line := first_rows.difference(study, *zip(*told, strict=True), dict(stored))):
            raise UsageError(line)
    if isinstance(go_on := comm.broadcast(None), ExitCode):
        raise RankZeroFailed(go_on.code)


def make_state(study: Study, start: Beginning, ranks: int) -> StudyState:
    """The StudyState of what is missing, for so many ranks."""
    replicates, stop = study.config.replicates, study.config.stop
    found = start.found(replicates)
    failed = sum(
        int(np.sum(start.store.read(place, "outcome", *interval) == FAILED))
        for place, intervals in enumerate(found)
        for interval in intervals
    )
    return StudyState(
        Schedule.of(found, looks(borders(stop, replicates), start.at_least), ranks),
        start.store,
        StopRule(stop, start.store),
        allowed=stop.failed * study.size,
        failed=failed,
        notes=start.notes,
    )


def looks(borders: list[int], least: int) -> list[int]:
    """Where the rule looks, and nowhere below what the results file has of each condition."""
    return sorted({max(border, least) for border in borders})


def make_results(
    study: Study, start: Beginning, state: StudyState, ended: Ended, comm: Communicator,
    output: str | Path | None, progress: Progress,
) -> Results:  # fmt: skip
    """The Results of a finished study; written to ``output``, by all ranks, where there is one."""
    count, in_memory = state.schedule.final, output is None
    if output and (old := start.store.old) is not None and start.is_covered(count):
        if (tuple(old.places), old.count) == (study.conditions, count):
            return read_results(output, replicates=False)  # as it is: nothing has been added
        output = None  # it has more than was asked for, and keeps it
    reader = Reader(start.store, (*study.shape[:3], count))
    run = facts(study, start, state.notes, ended, comm.size)
    kernel = kernel_of(study, start.store, count) if isinstance(study, KernelStudy) else None
    if output is None:
        sums = sums_of(reader.codes, len(study.conditions), 0, count)
        rows = reader.arrays(COLUMNS) if in_memory else None
        return results_of(study, count, sums, run, rows, kernel)
    nothing = sums_of(reader.codes, len(study.conditions), 0, 0)
    # Its tables have no values yet, but their places: where the rows go follows from them.
    draft = results_of(study, count, nothing, run, kernel=kernel)
    with new_row_file(output, draft, start.replacing) as file:
        sums, digests = assemble(reader, file, comm, progress.warn)
        results = results_of(study, count, sums, run, kernel=kernel)
        file.complete(results, digests)
    return results


def results_of(
    study: Study, count: int, sums: Sums, run: dict, replicates: dict | None = None,
    kernel: Kernel | None = None,
) -> Results:  # fmt: skip
    """The Results of so many replicates of each condition from their Sums."""
    config = study.config
    probabilities, pooled, differences = tables_of(sums)
    return Results(
        types=config.scene.names,
        vertices=np.array(config.shapes.vertices),
        delta=np.array(config.scene.delta),
        replicates=replicates,
        probabilities=probabilities,
        run=run,
        failures=FAILURES,
        flocs=tuple(floc.name for floc in study.flocs),
        pooled=pooled,
        differences=differences,
        count=count,
        radii=study.radii,
        kernel=kernel,
    )


def facts(study, start, notes, ended, ranks):
    config, identity = study.config, start.identity
    added = start.cpus_now if ended.computed else []
    kernels = [value for name, value in identity.items() if name.startswith("kernels.")]
    found = provenance(config.text, config.seed, " ".join(kernels))
    if start.accuracy:
        found["accuracy"] = storable(json.dumps(start.accuracy, sort_keys=True))
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
        "preset": config.preset or "",
        "size_classes": storable(json.dumps(class_facts(study.pairings))),
        "warnings": storable(json.dumps(study_doubts(config, study.flocs))),
        "settling": storable(json.dumps(settling_facts(config, study.flocs))),
        "equivalent_spheres": storable(json.dumps(sphere_facts(config, study.flocs))),
    }


def announcement(study: Study, ranks: int, existing: int = 0) -> str:
    types, vertices, delta, replicates = study.shape
    line = (
        f"{study.size} replicates: {types} types x {vertices} numbers of vertices x {delta} "
        f"displacements x {replicates}, on {ranks} rank{'s' if ranks > 1 else ''}"
    )
    return line + (f"; {existing} of them exist already" if existing else "")
