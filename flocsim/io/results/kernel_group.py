"""Group `kernel` of a results file: rates of encounters by mechanism, N and two size classes."""

from collections.abc import Mapping
from typing import Any

import attrs
import numpy as np

from flocsim.io.groups import Group, declared
from flocsim.io.labelled import Labelled

AXES = ("mechanism", "vertices", "i", "j")

WHAT = {"c": "that touch", "inside": "that touch inside the zone", "a": "that aggregate"}
"""Encounters by what becomes of them."""

ESTIMATES = {
    **{f"width_{k}": ("f8", "m", f"capture width of encounters {v}") for k, v in WHAT.items()},
    "beta2_c": ("f8", "m2 s-1", "kernel of encounters that touch, in the plane"),
    "beta2": ("f8", "m2 s-1", "kernel of encounters that aggregate, in the plane"),
    "beta3_c": ("f8", "m3 s-1", "kernel of encounters that touch, closed for three dimensions"),
    "beta3": ("f8", "m3 s-1", "kernel of encounters that aggregate, closed for three dimensions"),
    "alpha": (
        "f8",
        "1",
        "efficiency: fraction of touching encounters that aggregate, in the plane",
    ),
    "efficiency2": ("f8", "1", "beta2 over beta2_reference"),
    "efficiency3": ("f8", "1", "beta3 over beta3_reference"),
}
BOUNDS = {
    "": "",
    "_low": ", lower 95 % bound, undecided and failed points counted as misses",
    "_high": ", upper 95 % bound, undecided and failed points counted as captures",
    "_numerical": ", 95 % bound of its change if all runs were exact (numerical error)",
    "_change_low": ", change if all runs were exact: lower 95 % bound",
    "_change_high": ", change if all runs were exact: upper 95 % bound",
}
FLIPS = {
    f"flips_{k}": ("f8", "1", f"fraction of points run again that flip: encounters {v}, or not")
    for k, v in WHAT.items()
}
BESIDES = {
    "beta2_reference": ("f8", "m2 s-1", "rectilinear kernel of the equivalent spheres, in a plane"),
    "beta3_reference": ("f8", "m3 s-1", "rectilinear kernel of the equivalent spheres"),
    "speed": ("f8", "m s-1", "relative settling speed; in a flow, its rate times r_i + r_j"),
    "checked": ("f8", "1", "points that were run again at a tighter tolerance"),
    "undecided": ("f8", "1", "fraction of the sampled flux that is undecided or failed"),
    "edge": ("f8", "1", "fraction of aggregating encounters from the outermost tenth of the "
        "offsets sampled because of attraction; if not 0, the width may be cut off"),
}  # fmt: skip
KERNEL = {
    name + suffix: (kind, unit, text + bound)
    for name, (kind, unit, text) in ESTIMATES.items()
    for suffix, bound in BOUNDS.items()
} | FLIPS | BESIDES  # fmt: skip
"""{name: (type, units, long name)} of arrays (mechanism, vertices, i, j)."""

SCALES = {
    "mechanism": ("text", "1", "what brings the bodies together"),
    "vertices": ("i8", "1", "vertices N of each body; 1 is the equivalent sphere"),
    "i": ("text", "1", "size class of one body"),
    "j": ("text", "1", "size class of the other body"),
}
RADIUS = {"r_eq": ("f8", "m", "equivalent radius of the size class; of measured flocs the median")}
KERNEL_GROUP = Group.of(declared(KERNEL, AXES), SCALES, declared(RADIUS, ("i",)))


@attrs.frozen(eq=False)
class Kernel:
    """The group: ``mechanisms``, ``vertices`` and the ``labels`` of its size classes, of ``radii``
    [m]; ``arrays`` {name: (mechanism, vertices, i, j)} as in KERNEL, symmetric in i and j.

    NaN where a pair was not run: bodies of one size do not meet by settling, and all of theirs is
    0 but efficiencies, which are not known. ``water``: whether the bodies moved the water around
    each other.
    """

    mechanisms: tuple[str, ...]
    vertices: np.ndarray
    labels: tuple[str, ...]
    radii: np.ndarray
    arrays: dict[str, np.ndarray]
    water: bool = False

    def labelled(self) -> Labelled:
        """Return the arrays with their axes."""
        return KERNEL_GROUP.labelled({
            "mechanism": self.mechanisms, "vertices": self.vertices, "i": self.labels,
            "j": self.labels, "r_eq": self.radii, **self.arrays,
        })  # fmt: skip


def kernel_in(values: Mapping[str, Any], identity: str) -> Kernel:
    """Return the Kernel of what the group of a file holds; ``identity``: the text of what its rows
    follow from."""
    return Kernel(
        tuple(values["mechanism"]), values["vertices"], tuple(values["i"]), values["r_eq"],
        {name: values[name] for name in KERNEL}, '"PairResistance"' in identity,
    )  # fmt: skip
