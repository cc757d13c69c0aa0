"""Runs a study on the ranks of a team: from a config to Results, or to a results file."""

import contextlib
import json
import time

import attrs
import numpy as np

from flocsim.ensembles.chunks import ROW
from flocsim.ensembles.collision.failures import FAILURES
from flocsim.ensembles.estimates.stop_rule import StopRule, borders
from flocsim.ensembles.estimates.summary import Reader, summarize
from flocsim.ensembles.parallel.dealer import Dealer
from flocsim.ensembles.parallel.desk import Desk, FarDesk
from flocsim.ensembles.parallel.team import Alone
from flocsim.ensembles.parallel.worker import FAILED, work
from flocsim.ensembles.progress import Progress
from flocsim.ensembles.storage.identity import identity_of, short
from flocsim.ensembles.storage.index_ranges import total
from flocsim.ensembles.storage.resume import Beginning, begin
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.study import Study, flocs_of
from flocsim.errors import FlocsimError
from flocsim.interruption import STOPPED
from flocsim.io.journal.journal import MemoryJournal
from flocsim.io.provenance import provenance, storable
from flocsim.io.results.file import read_results, write_results
from flocsim.io.results.schema import Results


@attrs.define
class Ended:
    """How a run ended, the same on all ranks: exit code 0 or STOPPED; on rank 0 the results."""

    code: int = 0
    results: Results = None
    computed: int = 0
    kept: int = 0
    wall_time: float = 0.0


def run(config, team=None, quiet=True):
    """Run a config's study in memory; the Results on rank 0, None on the others.

    ``team`` is the ranks of the job (default: this process alone). The arrays of the Results are
    the same whatever the number of ranks.
    """
    team = team or Alone()
    study = make_study(config, team)
    start = None
    if team.rank == 0:
        identity = identity_of(study)
        start = Beginning(RowStore(MemoryJournal(), study.conditions), identity)
    try:
        return run_study(study, start, team, Progress(study.size, quiet or team.rank > 0)).results
    except Told as error:
        raise error.args[0] from None


def run_to_file(config, team, output, mode, quiet=True):
    """Run a config's study into the results file ``output``: how it Ended.

    ``mode`` says what to do about an unfinished run (flocsim.ensembles.storage.resume). What is
    finished goes into a journal beside the file, and from there into the file when all is.
    """
    study = make_study(config, team)
    progress = Progress(study.size, quiet or team.rank > 0)
    start = from_first(team, lambda: begin(study, identity_of(study), output, mode))
    with start.resources if start else contextlib.nullcontext():
        for remark in start.remarks if start else ():
            progress.warn(remark)
        ended = run_study(study, start, team, progress, output)
        if start is not None and ended.code == 0:
            start.journal.remove()
    return ended


def from_first(team, make):
    """What rank 0 makes, None on the others; its error on all ranks."""
    made, error = None, None
    if team.rank == 0:
        try:
            made = make()
        except Exception as problem:
            error = problem
    code = team.share(exit_code_of(error))
    if error is not None:
        raise (Told(error) if code else error) from error
    if code:
        raise OtherRankFailed(code)
    return made


def exit_code_of(error):
    """0 without an error that a user can meet."""
    return error.exit_code if isinstance(error, FlocsimError) else 0


class Told(Exception):
    """An error of rank 0, the argument, that the other ranks know of."""


class OtherRankFailed(Exception):
    """Rank 0 has failed, and says why; the argument is the exit code."""


def make_study(config, team):
    """The Study on every rank; rank 0 grows or reads the flocs for all."""
    flocs = flocs_of(config) if team.rank == 0 else None
    return Study(config, flocs=team.share(flocs))


def compile_in_turn(study, team):
    """Every kind of code is compiled by one rank; then all load what the others made."""
    study.compile(study.kinds[team.rank :: team.size])
    team.wait()
    study.compile(study.kinds)


def run_study(study, start, team, progress, output=None):
    """Run what is missing; on rank 0 make the results, into the file ``output`` if given."""
    began = time.monotonic()
    dealer = make_dealer(study, start, team) if start else None
    if team.rank == 0:
        progress.say(describe(study, team, study.size - dealer.left))
    if team.share(dealer.left if dealer else None):
        compile_in_turn(study, team)
        progress.say(f"compiled or loaded in {time.monotonic() - began:.1f} s")
    progress.start(dealer.left if dealer else 0)
    # From here on a signal is the desk's business, which waits for all ranks to report.
    key = team.share(short(start.identity) if start else None, heed_signals=False)
    if team.rank > 0:
        work(study, FarDesk(team), key)
        return Ended(told_by_first(team))
    desk = make_desk(study, start, team, dealer, progress)
    with telling_others(team, desk):
        desk.open()
        work(study, desk, key)
        desk.close()
        start.journal.sync()
        progress.finish()
        kept = sum(total(each) for each in start.found(study.config.replicates))
        ended = Ended(STOPPED if dealer.final < 0 else 0, None, desk.computed, kept)
        ended.wall_time = time.monotonic() - began
        if ended.code == 0:
            ended.results = make_results(study, start, team, desk, ended, output)
    team.share(ended.code)
    return ended


def told_by_first(team):
    """How rank 0 says that the run has ended; OtherRankFailed where that is with an error."""
    code = team.receive(0, heed_signals=False)
    if code not in (0, STOPPED):
        raise OtherRankFailed(code)
    return code


@contextlib.contextmanager
def telling_others(team, desk):
    """An error of rank 0 ends the other ranks in good order, so that all have one exit code."""
    try:
        yield
    except FlocsimError as error:
        if desk.give_up():
            team.share(error.exit_code)
            raise Told(error) from error
        raise


def make_dealer(study, start, team):
    """The Dealer of what is missing."""
    replicates = study.config.replicates
    return Dealer.of(start.found(replicates), borders(study.config.stop, replicates), team.size)


def make_desk(study, start, team, dealer, progress):
    """Rank 0's desk."""
    stop = study.config.stop
    return Desk(
        team, dealer, start.store, StopRule(stop, start.store), stop.failed * study.size,
        progress.report, failed=count_failed(start, study.config.replicates), notes=start.notes,
    )  # fmt: skip


def count_failed(start, replicates):
    """How many of the rows found at the start are of failed replicates."""
    store = start.store
    return sum(
        int(np.sum(store.read(place, "outcome", *interval) == FAILED))
        for place, found in enumerate(start.found(replicates))
        for interval in found
    )


def make_results(study, start, team, desk, ended, output):
    """The Results of a finished study; written to ``output`` where there is one."""
    if output and start.complete == (study.conditions, desk.dealer.final):
        return read_results(output, replicates=False)  # as it is: nothing has been added
    config = study.config
    reader = Reader(start.store, (*study.shape[:3], desk.dealer.final))
    probabilities, pooled, differences = summarize(reader)
    results = Results(
        types=tuple(name for name, _, _ in config.scene.conditions),
        vertices=np.array(config.shapes.vertices),
        delta=np.array(config.scene.delta),
        replicates=None if output else reader.arrays(ROW.names),
        probabilities=probabilities,
        run=facts(study, start, team, desk, ended),
        failures=FAILURES,
        flocs=[floc.name for floc in study.flocs],
        pooled=pooled,
        differences=differences,
        count=desk.dealer.final,
    )
    if output:
        write_results(output, results, reader.column)
    return results


def facts(study, start, team, desk, ended):
    """The scalars of the group ``run``."""
    config, identity = study.config, start.identity
    kernels = [value for name, value in identity.items() if name.startswith("kernels.")]
    found = provenance(config.text, config.seed, " ".join(kernels))
    return found | {
        "overrides": storable(json.dumps(config.overrides)),
        "identity": storable(json.dumps(identity, sort_keys=True)),
        "failed": storable(json.dumps(desk.notes)),
        "ranks": team.size,
        "sessions": 1 + len(start.history),
        "history": storable(json.dumps(start.history)),
        "computed": ended.computed,
        "wall_time": ended.wall_time,
        "preset": config.preset or "",
    }


def describe(study, team, existing=0):
    """One line: what is about to be run."""
    types, vertices, delta, replicates = study.shape
    ranks = f"{team.size} rank{'s' if team.size > 1 else ''}"
    line = (
        f"{study.size} replicates: {types} types x {vertices} numbers of vertices x {delta} "
        f"displacements x {replicates}, on {ranks}"
    )
    return line + (f"; {existing} of them exist already" if existing else "")
