"""The results file of an ensemble: HDF5 that xarray, MATLAB, R and Julia can open.

Every group of `schema.GROUPS`, and ``kernel`` (`kernel_group`), holds its own coordinates as
dimension scales, and every dataset a ``units`` and a ``long_name``; codes carry ``flag_values`` and
``flag_meanings``. ``flocs`` has the names of the flocs that ``replicates/floc_i`` and ``floc_j``
number, ``run`` scalars: config text, versions, machine, wall times. All that may differ between two
runs of one config is in ``run``, so the rest can be compared byte for byte. The file ends in
a checksum behind the HDF5 data (see `flocsim.io.seals`), is checked before HDF5 parses it, and is
written by `flocsim.io.results.layout`.
"""

import contextlib
import os
from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np

from flocsim.errors import FileError
from flocsim.io.groups import check_version, opened_file, run_of, text_of
from flocsim.io.hdf5 import File
from flocsim.io.results import checks, schema
from flocsim.io.results.kernel_group import read_kernel
from flocsim.io.results.layout import FORMAT, SCHEMA_VERSION
from flocsim.io.results.schema import GROUPS, OUTCOMES, REPLICATES, Results


def results_of(file: File, replicates: bool = True) -> Results:
    """The Results in an open file; ``replicates``: whether their table is read as well."""
    tables = [name for name in GROUPS if name in file and (replicates or name != "replicates")]
    found = {name: GROUPS[name].read(file, name) for name in tables}
    table = found["probabilities"]
    made: Any = {
        name: {column: each[column] for column in GROUPS[name].columns}
        for name, each in found.items()
    }
    run = run_of(file)
    return Results(
        types=table["type"], vertices=table["vertices"], delta=table["delta"], run=run,
        failures=failures_of(file), flocs=file.read("flocs/floc") if "flocs" in file else (),
        count=file.node("replicates/replicate").shape[0],
        radii={name: table[name] for name in schema.SIZES},
        kernel=read_kernel(file, str(run.get("identity", ""))),
        **{"replicates": None, **made},
    )  # fmt: skip


def failures_of(file: File) -> list[str]:
    """The words for the codes of failures."""
    words: str = file.node("replicates/failure").attributes["flag_meanings"]
    return words.split()


BLOCK = 262_144
"""Replicates of a condition that are read together."""


def read_results(path: str | os.PathLike, replicates: bool = True) -> Results:
    """The Results in a file; FileError if it is absent, damaged, of another kind or version.

    With ``replicates=False`` the table of replicates, which may be larger than the memory, stays
    on the disk.
    """
    with opened(path) as file:
        return results_in(file, replicates)


def read_overview(path: str | os.PathLike) -> "Overview":
    """The Results in a file without its table of replicates, but with the Totals of that table.

    For files larger than the memory; FileError as `read_results`.
    """
    with opened(path) as file:
        results = results_in(file, replicates=False)
        totals = totals_in(file, len(results.failures))
        known = {each.name: getattr(results, each.name) for each in attrs.fields(Results)}
        return Overview(**known, totals=totals)


def with_rows(path: str | os.PathLike, results: Results, most: float = np.inf) -> Results:
    """The Results in a file with their table of replicates, unless that has more than ``most``
    rows."""
    rows = int(np.prod(results.shape)) * results.count
    if results.replicates is not None or rows > most:
        return results
    return attrs.evolve(results, replicates=read_results(path).replicates)


def results_in(file, replicates):
    """The Results in an open file."""
    results = results_of(file, replicates)
    checks.check_tables(results)
    if results.replicates is not None:
        column = results.replicates.__getitem__
        checks.check_rows(column, len(results.failures), len(results.flocs))
    return results


def read_row(path: str | os.PathLike, place: tuple[int, int, int, int]) -> dict[str, Any]:
    """{column: value} of one replicate, at (type, vertices, delta, replicate); FileError as
    `read_results`, and for values that no run can have given."""
    with opened(path) as file:
        at = (*place[:-1], slice(place[-1], place[-1] + 1))
        found = {name: file.read(f"replicates/{name}", at)[0] for name in REPLICATES}
        checks.check_rows(lambda name: np.asarray(found[name]), len(failures_of(file)), 0)
        return found


SPANNED = ("r_i", "r_j", "D_0", "d_c_over_D_0")


@attrs.define
class Totals:
    """How many replicates had each outcome and each reason, what steps they took, and between
    which values (NaN: none) the columns of SPANNED lie."""

    outcomes: np.ndarray
    failures: np.ndarray
    count: int = 0
    steps: int = 0
    most_steps: int = 0
    rejected: int = 0
    spans: dict[str, tuple[float, float]] = attrs.Factory(dict)


@attrs.frozen(eq=False)
class Overview(Results):
    """Results with the ``totals`` of their replicates."""

    totals: Totals = attrs.field(kw_only=True)


def totals_in(file, reasons):
    """The Totals of the replicates of an open file with so many reasons of failure."""
    found = Totals(np.zeros(len(OUTCOMES), int), np.zeros(reasons, int))
    for part in parts_of(file.node("replicates/outcome").shape):
        columns = {name: file.read(f"replicates/{name}", part) for name in checks.CODED}
        checks.check_codes(columns, reasons)
        outcome, failure, steps, rejected = columns.values()
        found.outcomes += np.bincount(outcome, minlength=len(OUTCOMES))
        found.failures += np.bincount(failure, minlength=reasons)
        found.count += outcome.size
        found.steps += int(steps.sum())
        found.most_steps = max(found.most_steps, int(steps.max(initial=0)))
        found.rejected += int(rejected.sum())
        for name in SPANNED:
            values = file.read(f"replicates/{name}", part)
            known = np.append(values[np.isfinite(values)], found.spans.get(name, ()))
            if known.size:
                found.spans[name] = float(known.min()), float(known.max())
    return found


def first_of_each(path: str | os.PathLike) -> dict[str, tuple[int, int, int, int]]:
    """{outcome: place (type, vertices, delta, replicate)} of its first replicate, where it has one.

    Conditions of the most vertices come first: of an outcome the most detailed flocs are found.
    """
    with opened(path) as file:
        outcome, vertices = file.node("replicates/outcome"), file.read("replicates/vertices")
        order = np.argsort(-vertices, kind="stable")
        found: dict[str, tuple[int, int, int, int]] = {}
        types, _, deltas, count = outcome.shape
        for v, t, d in ((v, t, d) for v in order for t in range(types) for d in range(deltas)):
            for first in range(0, count, BLOCK):
                part = t, v, d, slice(first, first + BLOCK)
                codes = file.read("replicates/outcome", part)
                for code, row in zip(*np.unique(codes, return_index=True), strict=True):
                    if code < len(OUTCOMES):
                        found.setdefault(OUTCOMES[code], (t, int(v), d, first + int(row)))
        return found


def parts_of(shape):
    """Places of an array's values, some of one condition at a time; () of a single value."""
    if not shape:
        yield ()
        return
    *outer, count = shape
    for place in np.ndindex(*outer):
        for first in range(0, count, BLOCK):
            yield (*place, slice(first, first + BLOCK))


@contextlib.contextmanager
def opened(path: str | os.PathLike) -> Iterator[File]:
    """An open file of this schema, once checksum and structure were found right."""
    with opened_file(
        path, lambda reason: f"{path} has no readable results: {reason}; run it again"
    ) as file:
        if text_of(file, "format") != FORMAT:
            what = text_of(file, "format") or text_of(file, "kind")
            found = f", it holds a {what}" if what else ""
            raise FileError(
                f"{path} is not a results file{found}: name one written by flocsim ensemble"
            )
        check_version(path, file, SCHEMA_VERSION)
        checks.check_structure(file)
        checks.check_coordinates(file)
        yield file
