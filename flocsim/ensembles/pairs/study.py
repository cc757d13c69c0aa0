"""How the results of studies of pairs and of rates are made of rows, for good or so far."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.ensembles import kind, report
from flocsim.ensembles.collision.draw import FAILURES
from flocsim.ensembles.collision.pairings import class_facts
from flocsim.ensembles.diagnose.spheres import settling_facts, sphere_facts
from flocsim.ensembles.estimates import summary
from flocsim.ensembles.estimates.capture import kernel_of
from flocsim.ensembles.estimates.statistics import COUNTED
from flocsim.ensembles.kind import OldResults
from flocsim.ensembles.parallel.communicator import StopRequested
from flocsim.ensembles.storage.resume import Beginning
from flocsim.ensembles.storage.row_store import RowStore
from flocsim.ensembles.study import KernelStudy, Study
from flocsim.io.groups import run_of
from flocsim.io.results.file import failures_of, write_results
from flocsim.io.results.schema import RESULTS, Results, as_words
from flocsim.process import INTERRUPTION, stop_requested

KINDS = (Study, KernelStudy)


@contextmanager
def old_rows(output: str | Path) -> Iterator[OldResults]:
    """Open a results file that is to be extended, its rows read a condition at a time."""
    with RESULTS.opened(output) as file:
        if tuple(failures_of(file)) != as_words(FAILURES):
            raise ValueError("its failure codes have other meanings")
        places = kind.places_in(
            *(file.read(f"replicates/{axis}") for axis in ("type", "vertices", "delta"))
        )
        count = file.node("replicates/replicate").shape[0]

        def chunks() -> Iterator[tuple[kind.Condition, int, np.ndarray]]:
            for condition, place in places.items():
                for first in range(0, count, kind.MOST_ROWS):
                    stop = min(first + kind.MOST_ROWS, count)
                    rows = np.empty(stop - first, kind.ROW)
                    for name in kind.COLUMNS:
                        rows[name] = file.read(f"replicates/{name}", (*place, slice(first, stop)))
                    yield condition, first, rows

        yield OldResults(list(places), count, chunks(), run_of(file))


def results(study: Study, start: Beginning, count: int, run: dict, output: str | Path) -> Results:
    """Write the results of so many replicates to ``output``, and return all but their rows."""
    reader = summary.Reader(start.store, (*study.shape[:3], count))
    kernel = kernel_of(study, start.store, count) if isinstance(study, KernelStudy) else None
    sums = summary.sums_of(reader.codes, len(study.conditions), 0, count, study.config.scrambles)
    found = summary.results_of(study, count, sums, run, kernel)

    def part(first: int, stop: int) -> np.ndarray:
        if stop_requested():
            raise StopRequested(f"stopped by {INTERRUPTION.name}; continue with --resume")
        return reader.part(first, stop)

    write_results(output, found, start.replacing, part)
    return found


def facts(study: Study) -> dict[str, Any]:
    """What the results say of a study besides their tables."""
    given = study.config, study.flocs
    return {
        report.MOST_UNDECIDED: study.config.stop.undecided,
        report.SCRAMBLES: study.config.scrambles,
        "size_classes": json.dumps(class_facts(study.pairings)),
        "settling": json.dumps(settling_facts(*given)),
        "equivalent_spheres": json.dumps(sphere_facts(*given)),
    }


def so_far(store: RowStore, asked: dict[str, Any]) -> tuple[Results, int, int]:
    """Return Results of the rows that a store has, without single replicates and pooled tables."""
    shape, counts = tuple(len(asked[name]) for name in kind.ORDER), []
    for place in range(len(store.conditions)):
        sums: summary.Sums = {}
        for rows in store.all_rows(place):
            codes = tuple(rows[name].reshape(1, 1, 1, -1) for name in COUNTED)
            sums = summary.added(sums, summary.sums_of(lambda *_, c=codes: c, 1, 0, len(rows)))
        counts.append(summary.part_of(sums, "counted"))
    known = next(each for each in counts if each)  # a condition that has begun
    counted = {
        name: np.stack([each.get(name, np.zeros_like(first)) for each in counts])
        .reshape(*shape, *first.shape[3:])
        for name, first in known.items()
    }  # fmt: skip
    table = summary.table_from(counted)
    made = Results(
        types=asked["types"], vertices=asked["vertices"], delta=asked["delta"], replicates=None,
        probabilities=table, failures=FAILURES, count=int(table["n_total"].max()),
    )  # fmt: skip
    return made, store.there(), asked["replicates"] * len(store.conditions)
