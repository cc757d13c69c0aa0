"""What a results file of pairs holds: outcome codes, its tables, and the Results in memory.

The file itself is read and written by `flocsim.io.results.file`.
"""

from collections.abc import Iterable, Mapping, Sequence

import attrs
import numpy as np

from flocsim.io.groups import Dataset, FileFormat, Group, declared
from flocsim.io.labelled import Labelled
from flocsim.io.results.kernel_group import KERNEL_GROUP, Kernel

OUTCOMES = ("A", "B", "C", "D", "missed", "undecided", "failed", "held")
"""Code of an outcome = its place here. A, C: aggregated; B, D: departed; A, B: inside the zone;
missed, held: the outlines never touched, and the bodies have parted, or rest so."""
FAILED = OUTCOMES.index("failed")
UNKNOWN = ("undecided", "failed")
"""Outcomes of replicates that have come to none."""
CLASSES = OUTCOMES[:4]
AGGREGATED = ("A", "C")
NOT_APPLICABLE = 255
"""In ``inside`` and ``crossed_zone``: the outlines never touched; in ``bond``: nothing is bound; in
``checked_outcome`` and ``third_outcome``: the replicate was not run again, or not a third time."""

AXES = ("type", "vertices", "delta")

SHAPE_MEASURES = {
    "aspect_ratio": "aspect ratio",
    "circularity": "circularity 4 pi A/P^2",
    "solidity": "solidity (area over area of the convex hull)",
}
"""Of the outlines of both bodies, as they were run (`flocsim.geometry.shapes.outline`)."""

BAND_ENDS = ("closer", "wider")
"""How another eye might have cut the outlines of flocs: the two ends of their bands."""
FURTHER_RUNS = ("checked", "third", *BAND_ENDS)
"""What begins the names of columns of a replicate's further runs."""

ENDED = {
    "outcome": "outcome",
    "inside": "centre distance below D_0 at the collision",
    "bond": "what holds an aggregated pair",
}
"""What further runs of a replicate say, in columns of their own."""


def formed(
    texts: Mapping[str, str], forms: Mapping[str, str], kind: str = "f8"
) -> dict[str, tuple[str, str, str]]:
    """Return {name: (kind, unit, long name)} of columns without a unit.

    Each of ``forms``, {form of the name: form of the long name}, is filled with each of ``texts``.
    """
    return {
        form.format(name): (kind, "1", words.format(text))
        for name, text in texts.items()
        for form, words in forms.items()
    }


REPLICATES = {  # name: (dtype, units, long name)
    "angle_i": ("f8", "rad", "orientation drawn for the receiving body i"),
    "angle_j": ("f8", "rad", "orientation drawn for the approaching body j"),
    "r_i": ("f8", "m", "equivalent radius of the receiving body i, as run"),
    "r_j": ("f8", "m", "equivalent radius of the approaching body j, as run"),
    "D_0": ("f8", "m", "centre distance that bounds the attraction zone of the pair"),
    "outcome": ("u1", "1", "outcome of the approach"),
    "inside": ("u1", "1", "centre distance below D_0 at the collision"),
    "crossed_zone": ("u1", "1", "centre distance crossed D_0 after the collision"),
    "bond": ("u1", "1", "what holds an aggregated pair"),
    **formed(ENDED, {"checked_{}": "{}, when run again at a tighter tolerance"}, "u1"),
    **formed(ENDED, {"third_{}": "{}, in the third run, at an even tighter tolerance"}, "u1"),
    "d_c_collision": ("f8", "m", "centre distance at the collision"),
    "d_c_over_D_0": ("f8", "1", "centre distance at the collision over D_0"),
    "d_c_max": ("f8", "m", "largest centre distance after the collision"),
    "d_c_last": ("f8", "m", "last centre distance"),
    "t_collision": ("f8", "s", "time of the collision"),
    "t_end": ("f8", "s", "time at which the outcome was decided"),
    "steps": ("i8", "1", "accepted integrator steps"),
    "rejected": ("i8", "1", "rejected integrator steps"),
    "error": ("f8", "m", "stated error of position at the end"),
    "failure": ("u1", "1", "reason for an undecided or failed outcome"),
    "floc_i": ("i4", "1", "floc of the receiving body, as an index of /flocs; -1: a sphere"),
    "floc_j": ("i4", "1", "floc of the approaching body, as an index of /flocs; -1: a sphere"),
    **formed(SHAPE_MEASURES, {f"{{}}_{body}": f"{{}} of body {body}, as run" for body in "ij"}),
    **formed(ENDED, {"closer_{}": "{}, both outlines cut closer"}, "u1"),
    **formed(ENDED, {"wider_{}": "{}, both outlines cut wider"}, "u1"),
}
BLANKS = {"f8": float("nan"), "u1": NOT_APPLICABLE, "i4": -1, "i8": 0}
"""By its type, what a column of `REPLICATES` holds where there is nothing to say."""

BONDS = ("certificate", "hook", "rest")
"""Kinds of bond, from code 1 on: no later load can open it; the contacts carry the load, as statics
shows; the pair has kept its pose under its load, without such a proof."""
LAST_AXES = {"class": CLASSES, "bond": BONDS}
"""The last axis of the arrays of `TABLE` whose names have its name in them, and its words."""


def last_axis(name: str) -> tuple[str, ...]:
    """The last axis of an array of `TABLE`, where it has one more than the conditions; or none."""
    return tuple(axis for axis in LAST_AXES if axis in name)


COUNTS = {
    "n_total": "replicates",
    "n_missed": "replicates whose bodies parted without touching",
    "n_held": "replicates whose bodies come to rest one above the other without touching",
    "n_undecided": "replicates that ran out of time or steps",
    "n_failed": "replicates that ended in an error",
    "n_collided": "replicates whose outlines touched",
    "n_inside": "collisions inside the attraction zone",
    "n_class": "collisions of each class",
    "n_bond": "aggregated replicates of each kind of bond",
    "n_checked": "replicates that were run again at a tighter tolerance",
    "n_flipped": "replicates whose second run had another outcome, or was on the other side of the "
    "zone",
    "n_third": "replicates that were run a third time",
    "n_third_flipped": "replicates whose third run ended differently from the second",
}
PROBABILITIES = {
    "pr_inside": "Pr[inside | collision]",
    "pr_a_given_inside": "Pr[aggregation | decided collision inside]",
    "pr_a_given_outside": "Pr[aggregation | decided collision outside]",
    "pr_a": "Pr[aggregation | decided collision]",
    "pr_sticks": "Pr[aggregation that sticks, by certificate or rest | decided collision]",
    "pr_hangs": "Pr[aggregation that hangs, by a hook | decided collision]",
    "pr_class": "Pr[class | decided collision]",
    "pr_bond": "Pr[bond | aggregation]",
}
CHANGES = {
    "n_checked_{}": "replicates run twice of which either run counts in {}",
    "n_gained_{}": "replicates whose second run raised {}",
    "n_lost_{}": "replicates whose second run lowered {}",
}
"""What is counted for every probability, beside `COUNTS`."""
BOUNDS = {
    "{}": "{}",
    "{}_low": "{}, lower 95 % bound",
    "{}_high": "{}, upper 95 % bound",
    "{}_numerical": "{}, 95 % bound of its change if all runs were exact (numerical error)",
}
TABLE = {
    **formed(COUNTS, {"{}": "{}"}, "i8"),
    **formed(PROBABILITIES, BOUNDS),
    **formed(PROBABILITIES, CHANGES, "i8"),
}
POOLED_PROBABILITIES = tuple(name for name in PROBABILITIES if not last_axis(name))
"""Those that are one number for each condition."""
POOLED_TEXTS = {name: PROBABILITIES[name] for name in POOLED_PROBABILITIES}
POOLED = {
    **formed({k: f"{v}, all displacements pooled" for k, v in POOLED_TEXTS.items()}, BOUNDS),
    **formed(POOLED_TEXTS, {"n_effective_{}": "effective number of independent events of {}"}),
}
CHANGE = "change of {} "
NUMERICS = formed(PROBABILITIES, {
    "{}_change_low": CHANGE + "if all runs were exact: lower 95 % bound",
    "{}_change_high": CHANGE + "if all runs were exact: upper 95 % bound",
})  # fmt: skip
"""The numerical error as a signed change of every probability of `PROBABILITIES`."""
OUTLINES = formed(PROBABILITIES, {
    "{}_closer": CHANGE + "with all outlines cut closer",
    "{}_wider": CHANGE + "with all outlines cut wider",
    "{}_shape_low": CHANGE + "with outlines cut within their bands: lower 95 % bound",
    "{}_shape_high": CHANGE + "with outlines cut within their bands: upper 95 % bound",
})  # fmt: skip
"""The error by the shape: what the ends of the outlines' bands make of every probability."""
PER_APPROACH = "pr_a_per_approach"
"""Of all approaches that were decided, misses among them: what efficiencies are sums of."""

COMPARED = POOLED_TEXTS | {PER_APPROACH: "Pr[aggregation | decided approach]"}
"""{name: meaning} of the probabilities that are compared."""
DIFFERENCES = {
    "n_pairs": ("i8", "1", "replicates that count in both conditions"),
    "difference": ("f8", "1", "probability in this condition minus that in the compared one"),
    "difference_low": ("f8", "1", "difference, lower 95 % bound of the paired interval"),
    "difference_high": ("f8", "1", "difference, upper 95 % bound of the paired interval"),
}
EVENTS = ("inside", "aggregated")
"""Whose probabilities are compared: a collision is inside; a decided collision aggregates."""
INSIDE_CODES = (0, 1, NOT_APPLICABLE), ("outside", "inside", "not_applicable")
BOND_CODES = (1, 2, 3, NOT_APPLICABLE), (*BONDS, "not_applicable")
FLAGS: dict[str, tuple[tuple[int, ...], tuple[str, ...]]] = {
    "outcome": (tuple(range(len(OUTCOMES))), OUTCOMES),
    "inside": INSIDE_CODES,
    "crossed_zone": ((0, 1, NOT_APPLICABLE), ("no", "yes", "not_applicable")),
    "bond": BOND_CODES,
}
AGAIN_CODES = (*range(len(OUTCOMES)), NOT_APPLICABLE), (*OUTCOMES, "not_run_again")
for run in FURTHER_RUNS:
    FLAGS[f"{run}_outcome"], FLAGS[f"{run}_inside"] = AGAIN_CODES, INSIDE_CODES
    FLAGS[f"{run}_bond"] = BOND_CODES
COORDINATES = {
    "type": ("text", "1", "collision type, pair of equivalent radii (i-j) or of size classes"),
    "vertices": ("i8", "1", "vertices N of each body; 1 is the equivalent sphere"),
    "delta": ("f8", "1", "horizontal displacement of the centres as a fraction of delta_max"),
    "class": (
        "text",
        "1",
        "A, C: aggregated; B, D: departed; A, B: inside the zone; C, D: not",
    ),
    "bond": (
        "text",
        "1",
        "certificate: no later load can open it; hook: statics shows that the contacts carry the "
        "load, which attraction alone could not; rest: the pose was stable under the load, without "
        "such a proof",
    ),
    "replicate": ("i8", "1", "replicate index"),
    "floc": ("text", "1", "name of the floc"),
    "against": ("text", "1", "compared with the condition that comes first along this axis"),
    "event": ("text", "1", "inside: of all collisions; aggregated: of the decided collisions"),
}

RADII = {
    "r_i": ("f8", "m", "equivalent radius of body i; of measured flocs the median"),
    "r_j": ("f8", "m", "equivalent radius of body j; of measured flocs the median"),
}
"""Numbers that stand for each collision type, along the axis `type`."""


def of_conditions(schema: Mapping[str, tuple[str, str, str]]) -> dict[str, Dataset]:
    """Arrays with a value, or one for each word of a last axis, for every condition."""
    return {
        name: Dataset(kind, (*AXES, *last_axis(name)), unit, text)
        for name, (kind, unit, text) in schema.items()
    }


SIZES = declared(RADII, AXES[:1])
ROWS = declared(REPLICATES, (*AXES, "replicate"), FLAGS)
for name in ("steps", "rejected"):
    ROWS[name] = attrs.evolve(ROWS[name], low=0)
for name in ("floc_i", "floc_j"):
    ROWS[name] = attrs.evolve(ROWS[name], low=-1)
GROUPS = {
    "probabilities": Group.of(of_conditions(TABLE), COORDINATES, SIZES),
    "numerics": Group.of(of_conditions(NUMERICS), COORDINATES),
    "outlines": Group.of(of_conditions(OUTLINES), COORDINATES),
    "pooled": Group.of(declared(POOLED, AXES[:2]), COORDINATES, SIZES),
    "differences": Group.of(declared(DIFFERENCES, ("against", "event", *AXES)), COORDINATES),
    "replicates": Group.of(ROWS, COORDINATES),
}  # fmt: skip
"""Groups of a results file; the failure codes of the replicates have words of their own in each."""
FLOCS = Group({}, declared({"floc": COORDINATES["floc"]}, ("floc",)))
"""The group of the flocs' names, which ``floc_i`` and ``floc_j`` of replicates count."""
WORDS = LAST_AXES | {"against": AXES, "event": EVENTS}
"""Axes whose words are the same in every file."""

RESULTS = FileFormat(
    "flocsim results", 7, "results", GROUPS | {"kernel": KERNEL_GROUP, "flocs": FLOCS},
    optional=("pooled", "differences", "numerics", "outlines", "flocs", "kernel"),
    lengths={axis: len(words) for axis, words in WORDS.items()}, remedy="run it again",
)  # fmt: skip
"""The results file of pairs and of rates.

All that may differ between two runs of one config is in the group ``run``.
"""


def as_words(words: Iterable) -> tuple[str, ...]:
    """Return words without blanks, as flag_meanings needs them."""
    return tuple("_".join(str(word).split()) for word in words)


def as_names(names: Iterable) -> tuple[str, ...]:
    """Return names as plain strings."""
    return tuple(map(str, names))


def row_columns(failures: Sequence[str]) -> dict[str, Dataset]:
    """Return the columns of the replicates of a file that has these words for its failures."""
    codes = tuple(range(len(failures))), failures
    return ROWS | {"failure": attrs.evolve(ROWS["failure"], codes=codes)}


@attrs.frozen(eq=False)
class Results:
    """All results of one study of pairs or rates.

    ``types`` names; ``vertices`` N [-]; ``delta`` shares of delta_max [-]; ``replicates`` the
    arrays of `REPLICATES`, each (type, vertices, delta, replicate), or None where there are none
    yet, with their ``count`` then; ``probabilities`` those of `TABLE`, each (type,
    vertices, delta), with `LAST_AXES` last where the name has one; ``run`` plain scalars;
    ``failures`` the words for the codes of ``replicates["failure"]``, the first being "none" (in
    a fixed order, else equal runs differ in bytes); ``flocs`` the names of the flocs; ``pooled``
    the arrays of `POOLED`, (type, vertices), and ``differences`` those of `DIFFERENCES`, (against,
    event, type, vertices, delta), ``numerics`` and ``outlines`` those of `NUMERICS` and
    `OUTLINES`, or nothing; ``radii`` {r_i, r_j: (type,)} [m] those of `RADII`, NaN where they are
    not known; ``kernel`` the rates of a kernel study, None in others.
    """

    types: tuple[str, ...] = attrs.field(converter=as_names)
    vertices: np.ndarray = attrs.field(converter=np.asarray)
    delta: np.ndarray = attrs.field(converter=np.asarray)
    replicates: Mapping[str, np.ndarray] | None
    probabilities: dict[str, np.ndarray]
    run: dict[str, str | int | float] = attrs.field(factory=dict)
    failures: tuple[str, ...] = attrs.field(default=("none",), converter=as_words)
    flocs: tuple[str, ...] = attrs.field(default=(), converter=as_names)
    pooled: dict[str, np.ndarray] = attrs.field(factory=dict)
    differences: dict[str, np.ndarray] = attrs.field(factory=dict)
    numerics: dict[str, np.ndarray] = attrs.field(factory=dict)
    outlines: dict[str, np.ndarray] = attrs.field(factory=dict)
    count: int = 0
    radii: dict[str, np.ndarray] = attrs.field(
        default=attrs.Factory(
            lambda self: {name: np.full(len(self.types), np.nan) for name in RADII},
            takes_self=True,
        )
    )
    kernel: Kernel | None = None

    def __attrs_post_init__(self):
        if not self.count and self.replicates is not None:
            object.__setattr__(self, "count", np.shape(self.replicates["outcome"])[-1])

    def labelled(self, group: str) -> Labelled:
        """Return a group with its axes.

        Replicates that are not in memory yet are zeros that take none.
        """
        declared, values = GROUPS[group], getattr(self, group)
        if group == "replicates":
            columns = row_columns(self.failures)
            declared = attrs.evolve(declared, columns=columns)
            shape = (*self.shape, self.count)
            values = values or {
                name: np.broadcast_to(np.zeros((), each.type), shape)
                for name, each in columns.items()
            }
        axes = {"type": self.types, "vertices": self.vertices, "delta": self.delta}
        axes |= {"replicate": np.arange(self.count), **WORDS, **self.radii}
        return declared.labelled({**axes, **values})

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of types, vertex counts and displacements."""
        return len(self.types), self.vertices.size, self.delta.size
