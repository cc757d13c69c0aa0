"""What a results file must hold: its groups and datasets, and values that can be."""

from collections.abc import Callable, Mapping

import numpy as np

from flocsim.io.groups import hold_against, scalars_in
from flocsim.io.hdf5 import File, Node
from flocsim.io.results import schema
from flocsim.io.results.events import AGGREGATED, HELD, MISSED
from flocsim.io.results.kernel_group import KERNEL_GROUP
from flocsim.io.results.schema import Results

OPTIONAL = ("pooled", "differences", "numerics", "outlines", "flocs", "kernel")
MOST_CONDITIONS = 1_000_000
FURTHER_RUNS = ("checked", "third", *schema.BAND_ENDS)
"""What stands before the names of columns of a replicate's further runs."""
ROUNDING = 1e-9
"""By which a bound of a probability may miss 0 or 1."""

LEAST = {"probabilities": 0, "pooled": 0, "differences": -1, "numerics": -1, "outlines": -1}
"""Least value of what is not counted in a group; the largest is 1."""

WITHIN = {
    "n_collided": "n_total", "n_inside": "n_collided", "n_checked": "n_total",
    "n_flipped": "n_checked", "n_third": "n_checked", "n_third_flipped": "n_third",
}  # fmt: skip
"""What is counted → that of which it is a part."""

INSIDE_OF_CLASS = np.array([1, 1, 0, 0])


def check_structure(nodes: Mapping[str, Node]) -> None:
    """ValueError unless the groups and datasets of a file are those of results."""
    declared = {"kernel": KERNEL_GROUP, **schema.GROUPS, "flocs": schema.FLOCS}
    wanted = {name: group.arrays for name, group in declared.items()}
    wanted["run"] = scalars_in(nodes, "run")
    known = {axis: len(words) for axis, words in schema.WORDS.items()}
    lengths = hold_against(nodes, wanted, wanted.keys() - set(OPTIONAL), known)
    if not 0 < lengths["type"] * lengths["vertices"] * lengths["delta"] <= MOST_CONDITIONS:
        raise ValueError(f"there are no conditions, or more than {MOST_CONDITIONS}")
    if not isinstance(nodes["replicates/failure"].attributes.get("flag_meanings"), str):
        raise ValueError("replicates/failure has no attribute flag_meanings")


def check_coordinates(file: File) -> None:
    """ValueError where two groups of an open file have coordinates that differ."""

    def same(path, first):
        mine, other = file.read(path), file.read(first)
        # Radii may be unknown: NaN is NaN.
        alike = np.array_equal(mine, other, equal_nan=path.endswith(tuple(schema.RADII)))
        if not alike:
            raise ValueError(f"{path} is not {first}")

    for group in file.names(""):
        for axis in {*schema.AXES} & {*file.names(group)}:
            same(f"{group}/{axis}", f"probabilities/{axis}")
    for name in schema.RADII if "pooled" in file else ():
        same(f"pooled/{name}", f"probabilities/{name}")
    lists = {f"{group}/{axis}": words for group in ("probabilities", "numerics", "outlines")
             for axis, words in schema.LAST_AXES.items()}  # fmt: skip
    for path, words in (lists | {"differences/event": schema.EVENTS}).items():
        if path in file and tuple(file.read(path)) != words:
            raise ValueError(f"{path} has other words than {', '.join(words)}")


def check_tables(results: Results) -> None:
    """ValueError for names, counts or probabilities that cannot be."""
    refuse(len(set(results.types)) < len(results.types), "a type twice")
    refuse(not all(name.isprintable() for name in results.types), "types of unprintable names")
    refuse(np.unique(results.vertices).size < results.vertices.size, "a number of vertices twice")
    refuse(np.any(results.vertices < 1), "vertices below 1")
    refuse(not np.isfinite(results.delta).all(), "values of delta that are not numbers")
    refuse(np.unique(results.delta).size < results.delta.size, "a value of delta twice")
    for name, values in results.radii.items():
        refuse(np.any(values <= 0.0) or np.any(np.isinf(values)), f"{name} that are not radii")
    for group, least in LEAST.items():
        for name, values in getattr(results, group).items():
            if name.startswith("n_"):
                refuse(np.any(values < 0), f"negative numbers in {group}/{name}")
            else:
                what = f"values outside [{least}, 1] in {group}/{name}"
                refuse(beyond(values, least, 1.0), what)
    table = results.probabilities
    ended = sum(table[name] for name in ("n_missed", "n_held", "n_undecided", "n_failed"))
    bound = table["n_class"][..., list(AGGREGATED)]
    refuse(
        np.any(table["n_total"] != results.count)
        or np.any(ended + table["n_class"].sum(axis=-1) != results.count)
        or np.any(table["n_bond"].sum(axis=-1) != bound.sum(axis=-1))
        or any(np.any(table[part] > table[whole]) for part, whole in WITHIN.items()),
        "counts that contradict each other",
    )
    refuse(len(results.failures) > 256, "too many reasons")


def refuse(wrong, text):
    if wrong:
        raise ValueError(f"there are {text}")


def beyond(values, least, most):
    """Whether a value lies outside; NaN, where there was no event, does not."""
    return bool(np.any((values < least - ROUNDING) | (values > most + ROUNDING)))


def check_rows(column: Callable[[str], np.ndarray], failures: int, flocs: int) -> None:
    """ValueError for rows of replicates that no run can have given.

    ``column(name)`` gives the values of a column, all of one shape; ``failures``, ``flocs``: how
    many words and flocs the codes may stand for, no flocs where that is unknown.
    """
    outcome, inside = column("outcome"), column("inside")
    check_codes({name: column(name) for name in CODED}, failures)
    for names, least, most in (
        (("inside", "crossed_zone", *(f"{run}_inside" for run in FURTHER_RUNS)), 0, 1),
        ([f"{run}_outcome" for run in FURTHER_RUNS], 0, len(schema.OUTCOMES) - 1),
        ([f"{run}_bond" for run in FURTHER_RUNS], 1, len(schema.BONDS)),
    ):
        for name in names:
            codes = column(name)
            refuse_row(((codes < least) | (codes > most)) & (codes != schema.NOT_APPLICABLE), name)
    never = column("checked_outcome") == schema.NOT_APPLICABLE
    refuse_row(never & (column("third_outcome") != schema.NOT_APPLICABLE), "third_outcome")
    decided = outcome < len(schema.CLASSES)
    of_class = INSIDE_OF_CLASS[np.where(decided, outcome, 0)]
    refuse_row(decided & (inside != of_class), "inside")
    refuse_row(np.isin(outcome, [MISSED, HELD]) & (inside != schema.NOT_APPLICABLE), "inside")
    bound = np.isin(outcome, AGGREGATED)
    bond = column("bond")
    held = (bond >= 1) & (bond <= len(schema.BONDS))
    refuse_row(np.where(bound, ~held, bond != schema.NOT_APPLICABLE), "bond")
    for name in ("floc_i", "floc_j"):
        places = column(name)
        refuse_row((places < -1) | (places >= (flocs or 2**31)), name)
    ended = outcome != schema.FAILED
    for name in ("angle_i", "angle_j", "d_c_last", "t_end"):
        refuse_row(ended & ~np.isfinite(column(name)), name)
    for name in ("r_i", "r_j", "D_0", *schema.SHAPE_COLUMNS):
        values = column(name)
        refuse_row(ended & ~((values > 0.0) & np.isfinite(values)), name)
    touched = ended & (inside != schema.NOT_APPLICABLE)
    for name in ("d_c_collision", "d_c_max", "t_collision"):
        refuse_row(touched & ~np.isfinite(column(name)), name)
    with np.errstate(invalid="ignore", over="ignore"):
        expected = column("d_c_over_D_0") * column("D_0")
        apart = np.abs(expected - column("d_c_collision"))
        refuse_row(touched & ~(apart <= ROUNDING * expected), "d_c_over_D_0")


CODED = ("outcome", "failure", "steps", "rejected")


def check_codes(columns: Mapping[str, np.ndarray], failures: int) -> None:
    """ValueError for codes without a word, or negative numbers, in columns of CODED."""
    refuse_row(columns["outcome"] >= len(schema.OUTCOMES), "outcome")
    refuse_row(columns["failure"] >= failures, "failure")
    for name in ("steps", "rejected"):
        refuse_row(columns[name] < 0, name)


def refuse_row(wrong, name):
    count = int(np.count_nonzero(wrong))
    if count:
        raise ValueError(f"{count} values of replicates/{name} are impossible")
