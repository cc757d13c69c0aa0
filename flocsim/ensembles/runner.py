"""Runs a study on the ranks of a job: from a config to Results, or to a results file.

Rank 0 `lead`s: it knows what is missing, hands it out, takes it in and writes the results. All
others run the chunks that rank 0 gives them. Rank 0 runs chunks as well.
"""

import contextlib
import json
import platform
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from flocsim.compiler.processor import versions
from flocsim.ensembles.config import contents_of
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.config.sources import kept_sources
from flocsim.ensembles.contents import open_kind
from flocsim.ensembles.diagnose.preflight import IMPLIED
from flocsim.ensembles.estimates.statistics import borders
from flocsim.ensembles.kind import StudyKind, flocs_of, study_of
from flocsim.ensembles.parallel.communicator import Communicator, SharedError
from flocsim.ensembles.parallel.coordinator import Coordinator, RemoteCoordinator, run_chunks
from flocsim.ensembles.parallel.processes import in_copies
from flocsim.ensembles.parallel.schedule import Schedule, StudyState
from flocsim.ensembles.storage.identity import identity_of
from flocsim.ensembles.storage.resume import NEW, Beginning, begin, claim
from flocsim.errors import FlocsimError, UsageError, plural
from flocsim.io.results.run_group import provenance, source_line, storable
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


def run(config: Config) -> Any:
    """Run a config's study in this process, and return its results in memory.

    Parameters
    ----------
    config : Config
        As from `load_config`.

    Returns
    -------
    Results, SwarmResults or another class, or None
        Depends on the kind of study; None if a signal stopped it.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "results.h5")
        try:
            if run_to_file(config, Communicator(), path, NEW).code != 0:
                return None
        except SharedError as error:
            raise error.args[0] from None
        kind, file = open_kind(path)
        found = kind.read(file)
        # A table of replicates is read from its file when asked for, and the file goes.
        rows = getattr(found, "replicates", None)
        return found if rows is None else attrs.evolve(found, replicates=dict(rows))


def run_to_file(
    config: Config, comm: Communicator, output: str | Path, mode: str, quiet: bool = True,
    overwrite: bool = False,
) -> Ended:  # fmt: skip
    """Run a config's study into the results file ``output``: how it Ended.

    ``mode`` says what to do about an unfinished run (flocsim.ensembles.storage.resume). What is
    finished goes into a journal beside the file, and from there into the file when all is. Rank 0
    locks it before it does anything else, and to the end. ``overwrite``: what lies at ``output``
    and is not to be extended is kept under another name.
    """
    if comm.rank > 0:
        study, _ = join(config, comm)
        if comm.broadcast(None):
            compile_in_turn(study, comm)
        # From here on a signal is rank 0's business, which waits for all ranks to report.
        run_chunks(study, RemoteCoordinator(comm))
        return Ended(comm.receive(0, heed_signals=False))
    with comm.sharing_errors():
        journal, remarks = claim(output, mode, overwrite)
    with contextlib.ExitStack() as resources:
        resources.callback(journal.release)
        study, identity = join(config, comm)
        progress = Progress(study.size * study.pieces, quiet, noun=study.noun)
        with comm.sharing_errors():
            start = begin(study, identity, output, mode, journal, overwrite)
        # Once nothing else stands in the way: what is refused is refused in one line.
        doubts = study.doubts()
        said = (f"warning: {line}" for line in doubts if line != IMPLIED)
        for remark in [*remarks, *start.remarks, *said]:
            progress.warn(remark)
        ended = lead(study, start, comm, progress, output)
        if ended.code == 0 and start.has_more(ended.count):
            progress.warn(
                f"{journal.path} has more rows than this run needs, and is kept: a larger run uses "
                "them with --resume"
            )
        elif ended.code == 0:
            journal.remove()
    return ended


def join(config: Config, comm: Communicator) -> tuple[StudyKind, dict]:
    """Make the study on every rank, and check that all would compute the same rows.

    Return (study, identity). Rank 0 grows or reads the flocs for all. Where any rank would compute
    something else, or has other versions, none continues: SharedError on all ranks.
    """
    with comm.sharing_errors():
        flocs = flocs_of(config) if comm.rank == 0 else None
    study: Any = study_of(config, comm.broadcast(flocs))
    own, problem = None, None
    with comm.sharing_errors():
        try:
            own = versions() | identity_of(study)
        except FlocsimError as error:
            if comm.rank == 0:
                raise
            problem = type(error)(f"rank {comm.rank}: {error}")
    # Every rank compares its own table with rank 0's; a difference anywhere stops all.
    leader = comm.broadcast(own)
    if own is not None and (line := first_difference(comm.rank, leader, own)):
        problem = UsageError(line)
    comm.agree(problem)
    with comm.sharing_errors():
        study.prepare()
    return study, {name: leader[name] for name in leader if name not in versions()}


def first_difference(rank: int, leader: dict, own: dict) -> str:
    """Return in what a rank would compute something else than rank 0, in one line; "" for nothing.

    Other versions come first: they are why code is another.
    """
    for name in [*versions(), *sorted(leader.keys() | own.keys())]:
        if (there := leader.get(name)) != (here := own.get(name)):
            return (
                f"rank {rank} on {platform.node()} differs from rank 0 in {name} ({here!r:.60}, on "
                f"rank 0 {there!r:.60}): nothing was run; start all ranks with the same arguments, "
                "files and installation, on one kind of processor"
            )
    return ""


def lead(
    study: StudyKind, start: Beginning, comm: Communicator, progress: Progress,
    output: str | Path,
) -> Ended:  # fmt: skip
    """Run what is missing, together with the other ranks, and write the results into the file
    ``output``, as rank 0 does."""
    began = time.monotonic()
    with comm.sharing_errors():
        state = make_state(study, start, comm.size)
    INTERRUPTION.kept = partial(kept_words, start, state)
    remaining = state.schedule.remaining
    ranks, existing = comm.size, study.size - remaining
    line = f"{study.title}, on {plural(ranks, 'rank')}"
    line += f"; {existing} already exist" if existing else ""
    progress.say(f"{line}; {source_line(study.source)}")
    comm.broadcast(remaining)
    if remaining:
        compile_in_turn(study, comm)
    progress.start(state.missing)
    coordinator = Coordinator(comm, state, progress.report)
    with comm.sharing_errors(coordinator.give_up):
        coordinator.start()
        run_chunks(study, coordinator)
        coordinator.finish()
        start.store.journal.sync()
        progress.finish()
        final = state.schedule.final
        ended = Ended(STOPPED if final < 0 else 0, None, state.computed, count=final)
        ended.total = final * len(study.conditions)
        ended.wall_time = time.monotonic() - began
        if ended.code == 0:
            kind = contents_of(study.format)
            if start.is_covered(final):
                ended.results = kind.read(output)  # it has all that was asked for, and stays
            else:
                found = facts(study, start, ended, comm.size)
                ended.results = kind.results(study, start, final, found, output)
    comm.broadcast(ended.code)
    return ended


def kept_words(start: Beginning, state: StudyState) -> str:
    """Say what the journal has of a study that is stopped."""
    count, begun = start.store.computed, len(state.begun)
    if not count and not begun:
        return "no replicate was finished"
    others = f" and the states of {plural(begun, 'unfinished one')}" if begun else ""
    return f"{plural(count, 'finished replicate')}{others} saved in {start.store.journal.path}"


def compile_in_turn(study, comm):
    """Compile every kind of code on one rank, in a copy of it; then load it on all ranks."""
    own = study.uncompiled(study.kinds[comm.rank :: comm.size])
    in_copies([partial(study.compile, [kind]) for kind in own])
    comm.barrier()
    study.compile(study.kinds)


def make_state(study: StudyKind, start: Beginning, ranks: int) -> StudyState:
    """Return the StudyState of what is missing, for so many ranks."""
    replicates, stop = study.config.replicates, study.config.stop
    store = start.store
    # Failed replicates of earlier runs count towards stop.failed as well.
    failed = sum(
        int(np.sum(study.has_failed(rows.__getitem__)))
        for place in range(len(study.conditions)) for rows in store.all_rows(place)
    )  # fmt: skip
    # Where the rule looks, and nowhere below what the results file has of each condition.
    looks = sorted({max(border, start.at_least) for border in borders(stop, replicates)})
    is_enough = contents_of(study.format).stop_rule(study, store)
    schedule = Schedule.of(store.runs, looks, ranks, study.most_rows)
    state = StudyState(schedule, store, study, is_enough, failed)
    # Saved parts of replicates that are still missing: progress counts them.
    for task, parts in store.parts.items():
        place, replicate = task
        there = any(first <= replicate < end for first, end in store.runs[place])
        if replicate < replicates and not there:
            state.begun[task] = sum(map(study.counts_part, parts.ids))
    return state


def facts(study, start, ended, ranks):
    """Return the scalars of the group ``run`` of the results file."""
    config, identity = study.config, start.identity
    more = contents_of(study.format).facts(study)
    kernels = [value for name, value in identity.items() if name.startswith("kernels.")]
    found = provenance(config.text, config.seed, " ".join(kernels))
    if config.modules:
        found["modules"] = kept_sources(config.modules)
    found |= {
        "overrides": json.dumps(config.overrides),
        "identity": json.dumps(identity, sort_keys=True),
        "failed": json.dumps(start.store.notes),
        "ranks": ranks,
        "sessions": 1 + len(start.history),
        "history": json.dumps(start.history),
        "computed": ended.computed,
        "wall_time": ended.wall_time,
        **study.source,
        "warnings": json.dumps(study.doubts()),
        **more,
    }
    return {name: storable(value) for name, value in found.items()}
