"""Runs a study on the ranks of a team and puts the rows together."""

import numpy as np

from flocsim.ensembles.failures import FAILURES
from flocsim.ensembles.progress import Progress
from flocsim.ensembles.statistics import tabulate
from flocsim.ensembles.study import ROW, Study
from flocsim.ensembles.team import Alone
from flocsim.io.provenance import provenance
from flocsim.io.results_schema import REPLICATES, Results


def own_places(study, team):
    """The places of the study that this rank runs: every ``size``-th, which mixes conditions."""
    return range(team.rank, study.size, team.size)


def run_share(study, team, progress):
    """Rows (k,) of this rank's share of the study."""
    places = own_places(study, team)
    rows = np.zeros(len(places), dtype=ROW)
    for k, place in enumerate(places):
        rows[k] = study.run_place(place)
        progress.report((k + 1) / len(places))
    return rows


def in_order(study, shares):
    """The rows of all ranks as {name: array (type, vertices, delta, replicate)}."""
    rows = np.concatenate(shares)
    rows = rows[np.argsort(rows["place"])]
    return {name: rows[name].reshape(study.shape) for name in REPLICATES}


def results_of(study, replicates, run):
    """The Results of a study from its table of replicates."""
    config = study.config
    return Results(
        types=tuple(name for name, _, _ in config.scene.conditions),
        vertices=np.array(config.shapes.vertices),
        delta=np.array(config.scene.delta),
        replicates=replicates,
        probabilities=tabulate(replicates["outcome"], replicates["inside"]),
        run=run,
        failures=FAILURES,
    )


def compile_in_turn(study, team):
    """Every kind of code is compiled by one rank; then all load what the others made."""
    study.compile(study.kinds[team.rank :: team.size])
    team.wait()
    study.compile(study.kinds)


def run(config, team=None, quiet=True):
    """Run a config's study; the Results on rank 0, None on the others.

    ``team`` is the ranks of the job (default: this process alone). The arrays of the Results are
    the same whatever the number of ranks.
    """
    team = team or Alone()
    study = Study(config)
    progress = Progress(study.size, quiet or team.rank > 0)
    progress.say(describe(study, team))
    compile_in_turn(study, team)
    compiled = progress.finish()
    progress.say(f"compiled or loaded in {compiled:.1f} s")
    progress.began = progress.printed = progress.began + compiled
    shares = team.gather(run_share(study, team, progress))
    if team.rank > 0:
        return None
    seconds = progress.finish()
    facts = provenance(config.text, config.seed)
    facts |= {"ranks": team.size, "wall_time": seconds, "preset": config.preset or ""}
    return results_of(study, in_order(study, shares), facts)


def describe(study, team):
    """One line: what is about to be run."""
    types, vertices, delta, replicates = study.shape
    ranks = f"{team.size} rank{'s' if team.size > 1 else ''}"
    return (
        f"{study.size} replicates: {types} types x {vertices} numbers of vertices x {delta} "
        f"displacements x {replicates}, on {ranks}"
    )
