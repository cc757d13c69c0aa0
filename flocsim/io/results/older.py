"""Results files of earlier schema versions, read as files of this one.

What a version added is listed in ADDED. Arrays that an older file lacks are blank: NaN where nobody
estimated or measured, 0 where nothing was counted, and codes that say "not applicable"; nothing is
computed anew but the counts of bonds, which stand in the rows. A file of each version lies in
tests/data.

All of the file is taken into memory. Its rows are never added to: what they mean has changed since,
as `Addition.meaning` says.
"""

import contextlib
from collections.abc import Iterator, Mapping
from typing import Any

import attrs
import numpy as np

from flocsim.io.groups import Declared, Group, parsed, run_of, values_of
from flocsim.io.hdf5 import Node
from flocsim.io.results import schema
from flocsim.io.results.checks import check_coordinates, check_structure
from flocsim.io.results.kernel_group import CHANGE, ESTIMATES, KERNEL_GROUP, read_kernel
from flocsim.io.results.layout import SCHEMA_VERSION, image_of
from flocsim.io.results.schema import Results

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
