"""The results file of an ensemble: HDF5 that xarray, MATLAB, R and Julia can open.

Every group of `schema.GROUPS`, and ``kernel`` (`kernel_group`), holds its own coordinates as
dimension scales, and every dataset a ``units`` and a ``long_name``; codes carry ``flag_values`` and
``flag_meanings``. ``flocs`` has the names of the flocs that ``replicates/floc_i`` and ``floc_j``
number, ``run`` scalars: config text, versions, machine, wall times. All that may differ between two
runs of one config is in ``run``, so the rest can be compared byte for byte. The file ends in
checksums behind the HDF5 data (see `flocsim.io.seals`), is checked before HDF5 parses it, and is
written a block at a time (see `flocsim.io.results.layout`).

A file of an earlier schema version is taken into memory as one of this. What a version added is
listed in ADDED; arrays that an older file lacks are blank: NaN where nobody estimated or measured,
0 where nothing was counted, and codes that say "not applicable"; nothing is computed anew but the
counts of bonds, which stand in the rows. Rows are never added to it: what they mean has changed
since, as `Addition.meaning` says. A file of each version lies in tests/data.
"""

import contextlib
import os
from collections.abc import Iterator, Mapping
from typing import Any

import attrs
import numpy as np

from flocsim.errors import FileError
from flocsim.io.groups import Declared, Group, opened_file, parsed, run_of, text_of, values_of
from flocsim.io.hdf5 import Node
from flocsim.io.results import checks, schema
from flocsim.io.results.checks import check_coordinates, check_structure
from flocsim.io.results.kernel_group import CHANGE, ESTIMATES, KERNEL_GROUP, read_kernel
from flocsim.io.results.layout import FORMAT, SCHEMA_VERSION, image_of
from flocsim.io.results.schema import GROUPS, OUTCOMES, REPLICATES, Results

MOST_ROWS = 2**23
"""Of a file that is taken into memory, 1.5 GB."""

WRITTEN_AS = "written_as_version"
"""Attribute of a file that was made of an older one."""

BY_BOND = ("pr_sticks", "pr_hangs", "pr_bond")


@attrs.frozen
class Addition:
    """What came with a version: {group: names}, and what rows of before it are not."""

    names: Mapping[str, frozenset[str]]
    meaning: str


ADDED = {
    3: Addition(
        {
            "probabilities": frozenset(
                {"n_bond", "n_checked", "n_flipped"}
                | {f"{name}_numerical" for name in schema.PROBABILITIES}
                | {f"{name}{bound}" for name in BY_BOND for bound in schema.BOUNDS}
                | {f"{count}_{name}" for count in schema.CHANGES for name in schema.PROBABILITIES}
            ),
            "pooled": frozenset(
                name for name in schema.POOLED
                if name.endswith("_numerical") or any(each in name for each in BY_BOND)
            ),
            "replicates": frozenset({"checked_outcome", "checked_inside", "checked_bond"}),
        },
        "no replicate was run again for its numerical error",
    ),
    4: Addition(
        {
            "probabilities": frozenset(schema.RADII),
            "pooled": frozenset(schema.RADII),
            "replicates": frozenset({*schema.RADII, "D_0", "d_c_over_D_0"}),
        },
        "they lack the radii and D_0 of each replicate",
    ),
    5: Addition(
        {"probabilities": frozenset({"n_held"})},
        "pairs held apart without touching are not distinguished from those that miss",
    ),
    6: Addition(
        {"replicates": frozenset(schema.SHAPE_COLUMNS)},
        "they lack the shape measures of the bodies",
    ),
    7: Addition(
        {
            "probabilities": frozenset({"n_third", "n_third_flipped"}),
            "replicates": frozenset(
                f"{run}_{name}"
                for run in ("third", *schema.BAND_ENDS)
                for name in ("outcome", "inside", "bond")
            ),
            "kernel": frozenset(f"{name}{end}" for name in ESTIMATES for end in CHANGE),
        },
        "no replicate was run a third time, or with outlines cut closer and wider",
    ),
}  # fmt: skip
"""Version → what it added to that before it."""

VERSIONS = tuple(version - 1 for version in ADDED)


def lacking(version: int, group: str) -> frozenset[str]:
    """The names that a group of an older file does not have."""
    since = [each.names.get(group, ()) for number, each in ADDED.items() if number > version]
    return frozenset().union(*since)


def version_of(file: Any) -> int:
    """The version as which an open file was written."""
    return int(file.attrs.get(WRITTEN_AS, SCHEMA_VERSION))


def why_apart(file: Any) -> str:
    """Why no rows are added to those of an open file; "" where they are of this version."""
    version = version_of(file)
    said = [each.meaning for number, each in ADDED.items() if number > version]
    return f"its rows are of schema version {version}: {'; '.join(said)}" if said else ""


def groups_of(version: int) -> dict[str, Group]:
    """The groups as an older version had them."""
    found = {}
    for name, group in (schema.GROUPS | {"kernel": KERNEL_GROUP}).items():
        missing = lacking(version, name)
        columns = {key: each for key, each in group.columns.items() if key not in missing}
        beside = {key: each for key, each in group.beside.items() if key not in missing}
        used = {axis for each in columns.values() for axis in each.axes}
        scales = {axis: each for axis, each in group.scales.items() if axis in used}
        found[name] = Group(columns, scales, beside)
    return found


@contextlib.contextmanager
def as_now(file: Any, nodes: Mapping[str, Node], version: int) -> Iterator[Any]:
    """An open file of an older version as one of this, in memory; ValueError for what no such
    version wrote."""
    groups = groups_of(version)
    check_structure(nodes, groups)
    check_coordinates(file)
    if np.prod(nodes["replicates/outcome"].shape, dtype=object) > MOST_ROWS:
        raise ValueError(
            f"it has more than {MOST_ROWS} rows of schema version {version}: read it with the "
            "version of flocsim that wrote it"
        )
    image = image_of(results_of(file, groups), {WRITTEN_AS: version})
    with parsed(image, len(image.getbuffer())) as (now, _):
        yield now


def results_of(file: Any, groups: Mapping[str, Group], replicates: bool = True) -> Results:
    """The Results in an open file that has these groups; what they lack is blank.

    ``replicates``: whether the table of these is read as well.
    """
    wanted = [name for name in schema.GROUPS if name in file and name != "replicates"]
    found = {name: groups[name].read(file[name]) for name in wanted}
    table, rows = found["probabilities"], file["replicates"]
    lengths = {axis: len(words) for axis, words in schema.WORDS.items()}
    lengths |= {axis: len(table[axis]) for axis in schema.AXES} | {
        "replicate": len(rows["replicate"])
    }
    if replicates:
        found["replicates"] = groups["replicates"].read(rows)
    if "n_bond" not in table:
        kinds = range(1, 1 + len(schema.BONDS))
        table["n_bond"] = np.stack([np.sum(rows["bond"][()] == k, axis=-1) for k in kinds], axis=-1)

    def filled(known: Mapping[str, np.ndarray], declared: Mapping[str, Declared]) -> dict:
        blanks = {
            name: np.full([lengths[str(axis)] for axis in each.axes], schema.BLANKS[each.type])
            for name, each in declared.items() if name not in known
        }  # fmt: skip
        return {name: known.get(name, blanks.get(name)) for name in declared}

    made: Any = {name: filled(each, schema.GROUPS[name].columns) for name, each in found.items()}
    run = run_of(file)
    return Results(
        types=table["type"], vertices=table["vertices"], delta=table["delta"], run=run,
        failures=rows["failure"].attrs["flag_meanings"].split(),
        flocs=values_of(file["flocs/floc"]) if "flocs" in file else (),
        count=lengths["replicate"], radii=filled(table, schema.SIZES),
        kernel=read_kernel(file, str(run.get("identity", "")), groups["kernel"]),
        **{"replicates": None, **made},
    )  # fmt: skip


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
        totals = totals_in(file["replicates"], len(results.failures))
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
    results = results_of(file, {**GROUPS, "kernel": KERNEL_GROUP}, replicates)
    checks.check_tables(results)
    if results.replicates is not None:
        checks.check_rows(
            results.replicates.__getitem__, len(results.failures), len(results.flocs),
            lacking_in(file),
        )  # fmt: skip
    return results


def lacking_in(file):
    """The columns that the replicates of an open file do not have, as it is of an older version."""
    return lacking(version_of(file), "replicates")


def read_row(path: str | os.PathLike, place: tuple[int, int, int, int]) -> dict[str, Any]:
    """{column: value} of one replicate, at (type, vertices, delta, replicate); FileError as
    `read_results`, and for values that no run can have given."""
    with opened(path) as file:
        rows = file["replicates"]
        found = {name: rows[name][place] for name in REPLICATES}
        reasons = len(rows["failure"].attrs["flag_meanings"].split())
        checks.check_rows(lambda name: np.asarray(found[name]), reasons, 0, lacking_in(file))
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


def totals_in(rows, reasons):
    """The Totals of an open table of replicates with so many reasons of failure."""
    found = Totals(np.zeros(len(OUTCOMES), int), np.zeros(reasons, int))
    for part in parts_of(rows["outcome"].shape):
        columns = {name: rows[name][part] for name in checks.CODED}
        checks.check_codes(columns, reasons)
        outcome, failure, steps, rejected = columns.values()
        found.outcomes += np.bincount(outcome, minlength=len(OUTCOMES))
        found.failures += np.bincount(failure, minlength=reasons)
        found.count += outcome.size
        found.steps += int(steps.sum())
        found.most_steps = max(found.most_steps, int(steps.max(initial=0)))
        found.rejected += int(rejected.sum())
        for name in SPANNED:
            values = rows[name][part]
            known = np.append(values[np.isfinite(values)], found.spans.get(name, ()))
            if known.size:
                found.spans[name] = float(known.min()), float(known.max())
    return found


def first_of_each(path: str | os.PathLike) -> dict[str, tuple[int, int, int, int]]:
    """{outcome: place (type, vertices, delta, replicate)} of its first replicate, where it has one.

    Conditions of the most vertices come first: of an outcome the most detailed flocs are found.
    """
    with opened(path) as file:
        outcome, vertices = file["replicates/outcome"], file["replicates/vertices"][()]
        order = np.argsort(-vertices, kind="stable")
        found: dict[str, tuple[int, int, int, int]] = {}
        types, _, deltas, count = outcome.shape
        for v, t, d in ((v, t, d) for v in order for t in range(types) for d in range(deltas)):
            for first in range(0, count, BLOCK):
                codes = outcome[t, v, d, first : first + BLOCK]
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
def opened(path: str | os.PathLike) -> Iterator[Any]:
    """An open h5py file of this schema, once the checksum over all of it was found right.

    And once its structure was found to be one that flocsim writes: HDF5 sees no other. A file of an
    older schema is made into one of this in memory.
    """
    with opened_file(
        path, lambda reason: f"{path} has no readable results: {reason}; run it again"
    ) as (file, nodes):
        known = nodes[""].attributes
        if text_of(file, nodes, "format") != FORMAT:
            what = text_of(file, nodes, "format") or text_of(file, nodes, "kind")
            found = f", it holds a {what}" if what else ""
            raise FileError(
                f"{path} is not a results file{found}: name one written by flocsim ensemble"
            )
        version = read_version(file, known)
        if version in VERSIONS:
            with as_now(file, nodes, int(version)) as now:
                yield now
            return
        if version != SCHEMA_VERSION:
            raise FileError(
                f"{path} has results of schema version {version}; this flocsim reads "
                f"{VERSIONS[0]} to {SCHEMA_VERSION}: read it with the version that wrote it"
            )
        if WRITTEN_AS in known:
            raise ValueError(f"it has an attribute {WRITTEN_AS}, which no file of flocsim has")
        checks.check_structure(nodes)
        checks.check_coordinates(file)
        yield file


def read_version(file, known):
    """The schema version of an open file; "unknown" where it is not a number or word."""
    if known.get("schema_version") not in (("i8", ()), ("text", ())):
        return "unknown"
    version = file.attrs["schema_version"]
    return str(version)[:20] if isinstance(version, str) else int(version)
