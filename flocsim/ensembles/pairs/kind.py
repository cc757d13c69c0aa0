"""Studies of pairs and of rates, as rank 0 has them: checks, what they tell, tables from rows."""

import json
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.ensembles import kind, report
from flocsim.ensembles.collision.draw import FAILURES
from flocsim.ensembles.collision.pairings import class_facts
from flocsim.ensembles.config.kernel_scene import KernelScene
from flocsim.ensembles.config.pair_scene import PAIR_SCENES
from flocsim.ensembles.dry_run import dry_run, sphere_facts
from flocsim.ensembles.estimates import summary
from flocsim.ensembles.estimates.capture import kernel_of
from flocsim.ensembles.estimates.numerical import leading_axes
from flocsim.ensembles.estimates.statistics import COUNTED, StopRule
from flocsim.ensembles.kernels import KernelStudy, study_of
from flocsim.ensembles.kind import Kind
from flocsim.ensembles.parallel.assembly import assemble
from flocsim.ensembles.parallel.communicator import Communicator
from flocsim.ensembles.preflight import check_study, settling_facts, study_doubts
from flocsim.ensembles.storage.identity import PHYSICS, identity_of
from flocsim.ensembles.storage.resume import Beginning
from flocsim.ensembles.storage.row_store import OldTable, ReadOnlyJournal, RowStore
from flocsim.ensembles.storage.unfinished import ASKED, Unfinished, store_of
from flocsim.ensembles.study import Study, flocs_of
from flocsim.errors import FlocsimError
from flocsim.io.groups import run_of
from flocsim.io.records import CHUNK, Record, matches
from flocsim.io.results.checks import check_rows
from flocsim.io.results.file import failures_of, opened
from flocsim.io.results.layout import FORMAT, new_row_file
from flocsim.io.results.schema import Results, as_words
from flocsim.process import WITHHELD


def old_rows(output: str | Path, resources: ExitStack) -> OldTable:
    """The table of replicates of a results file, open until the resources are closed."""
    file = resources.enter_context(opened(output))
    if tuple(failures_of(file)) != as_words(FAILURES):
        raise ValueError("its failure codes have other meanings")
    axes = (file.read(f"replicates/{axis}") for axis in ("type", "vertices", "delta"))
    columns = {name: file.node(f"replicates/{name}") for name in kind.COLUMNS}
    count = file.node("replicates/replicate").shape[0]
    return OldTable(columns, kind.places_in(*axes), count, run_of(file))


def results(
    study: Study, start: Beginning, count: int, run: dict, comm: Communicator,
    output: str | Path | None, warn: Callable[[str], object], in_memory: bool,
) -> Results:  # fmt: skip
    """The Results of so many replicates; written to ``output``, if any, by all ranks."""
    reader = summary.Reader(start.store, (*study.shape[:3], count), study.scrambles)
    kernel = kernel_of(study, start.store, count) if isinstance(study, KernelStudy) else None
    if output is None:
        sums = summary.sums_of(reader.codes, len(study.conditions), 0, count, study.scrambles)
        rows = reader.arrays(kind.COLUMNS) if in_memory else None
        return summary.results_of(study, count, sums, run, rows, kernel)
    # Where the rows go follows from the places of all tables. Of a large study these have no values
    # yet; few rows are counted at once, so that the tables need not be made twice.
    few = count * len(study.conditions) <= summary.BLOCK_ROWS
    first = summary.sums_of(
        reader.codes, len(study.conditions), 0, count if few else 0, study.scrambles
    )
    draft = summary.results_of(study, count, first, run, kernel=kernel)
    with new_row_file(output, draft, start.replacing) as file:
        sums, digests = assemble(reader, file, comm, warn)
        same = few and sums.keys() == first.keys() and all(
            np.array_equal(sums[name], values) for name, values in first.items()
        )  # fmt: skip
        found = draft if same else summary.results_of(study, count, sums, run, kernel=kernel)
        file.complete(found, digests)
    return found


def facts(study: Study) -> dict[str, Any]:
    """What the results say of a study besides their tables."""
    given = study.config, study.flocs
    return {
        report.MOST_UNDECIDED: study.config.stop.undecided,
        report.SCRAMBLES: study.scrambles,
        "size_classes": json.dumps(class_facts(study.pairings)),
        "settling": json.dumps(settling_facts(*given)),
        "equivalent_spheres": json.dumps(sphere_facts(*given)),
    }


def verdict(found: Results) -> tuple[int, str]:
    """0, or the code of an error where not one replicate has come to an outcome, or where more are
    undecided than may be; and what to say of those that have none."""
    line = report.undecided_line(found)
    if not line:
        return 0, ""
    counts = found.probabilities
    if (counts["n_failed"] + counts["n_undecided"]).sum() == counts["n_total"].sum():
        return FlocsimError.exit_code, line
    return (WITHHELD if report.too_many_undecided(found) else 0), f"warning: {line}"


def so_far(path: Path, sessions: list[dict], found: list[Record]) -> Unfinished:
    """What a journal has of pairs: their counts and probabilities."""
    axes = axes_of(sessions[-1], [
        kind.condition_of(each.description) for each in found
        if each.kind == CHUNK and kind.fits(each.description, each.length)
    ])  # fmt: skip
    checked = partial(check_rows, failures=len(FAILURES), flocs=2**31)
    with ReadOnlyJournal(str(path)) as journal:
        store, notes, unread = store_of(journal, sessions, found, axes, kind.ROW, checked)
        table = tables(store, tuple(len(axes[name]) for name in kind.ORDER))
    made = Results(
        types=axes["types"], vertices=axes["vertices"], delta=axes["delta"], replicates=None,
        probabilities=table, failures=FAILURES, count=int(table["n_total"].max()),
    )  # fmt: skip
    asked = axes["replicates"] * len(store.conditions)
    return Unfinished(path, FORMAT, made, store.there(), asked, notes, sessions, unread)


def axes_of(session: dict, found: list[kind.Condition]) -> dict[str, Any]:
    """ASKED of a session; of one that does not say it, what was found, and 0 replicates."""
    asked = session.get("asked")
    if matches(asked, ASKED):
        assert asked is not None
        return asked
    return {
        "types": list(dict.fromkeys(each.type for each in found)),
        "vertices": sorted({each.vertices for each in found}),
        "delta": sorted({each.delta for each in found}),
        "replicates": 0,
    }


def tables(store: RowStore, shape: tuple[int, ...]) -> dict[str, np.ndarray]:
    """The table of probabilities from all rows of a store, whose conditions have this shape."""
    many = len(store.conditions)
    known = {place: counts_of(store, place) for place in range(many) if store.counts[place]}
    counts = {}
    for name, values in next(iter(known.values())).items():
        axis = leading_axes(name)
        before, behind = values.shape[:axis], values.shape[axis + 3 :]
        every = np.zeros((*before, many, *behind), values.dtype)
        for place, found in known.items():
            every[(slice(None),) * axis + (place,)] = found[name].reshape((*before, *behind))
        counts[name] = every.reshape(*before, *shape, *behind)
    return summary.table_from(counts)


def counts_of(store: RowStore, place: int) -> dict[str, np.ndarray]:
    """What is counted of a condition (…, 1, 1, 1, …), its replicates in whatever pieces they are
    there."""

    def codes(first: int, stop: int) -> tuple[np.ndarray, ...]:
        """Of the rows from the ``first`` of those that there are: their numbers may be anything."""
        columns = {name: np.empty(stop - first, "i8") for name in COUNTED}
        for (a, b), before in zip(runs, begins, strict=True):
            low, high = a + max(first - before, 0), min(b, a + stop - before)
            for number, rows in store.rows(place, low, high, known) if low < high else ():
                start = before + number - a - first
                for name in COUNTED:
                    columns[name][start : start + len(rows[name])] = rows[name]
        return tuple(values.reshape(1, 1, 1, -1) for values in columns.values())

    runs, known = store.intervals(place), store.known(place)
    begins = [0, *accumulate(stop - first for first, stop in runs)][:-1]
    sums = summary.sums_of(codes, 1, 0, kind.total(runs))
    return {
        name: values for name, values in sums.items()
        if name not in (*summary.POOLED_NAMES, summary.JOINT)
        and not name.endswith(summary.OF_OUTLINES)
    }  # fmt: skip


KIND = Kind(
    scenes=(*PAIR_SCENES.values(), KernelScene),
    make=study_of, flocs=flocs_of, identity=identity_of, code=PHYSICS, check=check_study,
    doubts=lambda study: study_doubts(study.config, study.flocs), facts=facts, old_rows=old_rows,
    results=results, total=lambda found: int(found.probabilities["n_total"].sum()),
    verdict=verdict, dry_run=dry_run, so_far=so_far,
    enough=lambda study, store: StopRule(study.config.stop, store),
)  # fmt: skip
