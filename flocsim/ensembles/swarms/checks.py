"""Whether what a journal says of a swarm can be: it may have been written by anyone."""

from collections.abc import Callable, Mapping
from typing import Any

import attrs
import numpy as np

import flocsim.arrays as at
import flocsim.swarms.arrays as sw
from flocsim.ensembles.swarms.records import BODIES, MOMENT, STATE, Part
from flocsim.fields import is_number, is_whole
from flocsim.io.results.swarm_file import COUNTS, GONE, KIND_COUNT, OF_CLUSTERS
from flocsim.swarms.progress import Effort

EFFORT = tuple(field.name for field in attrs.fields(Effort))
LARGEST = 2**53


@attrs.frozen
class Form:
    """What a study's records look like: how many bodies; radii [m] between the size classes; times
    [s] of the snapshots; axes along which its box repeats itself."""

    bodies: int
    bounds: tuple[float, ...]
    times: tuple[float, ...]
    periodic: str

    @property
    def classes(self) -> int:
        """Number of size classes."""
        return len(self.bounds) + 1

    @property
    def moments(self) -> int:
        """Number of snapshots."""
        return len(self.times)

    def asked(self) -> dict[str, Any]:
        """As JSON has it."""
        return {
            "bodies": self.bodies, "bounds": list(self.bounds), "times": list(self.times),
            "periodic": self.periodic,
        }  # fmt: skip


FORM = {"bodies": int, "bounds": [float], "times": [float], "periodic": str}
"""Form.asked, as a pattern of `flocsim.io.json_text`."""


def check_part(part: Part, form: Form) -> None:
    """ValueError where a Part is none of a study of this Form."""
    checks = {BODIES: check_bodies, MOMENT: check_moment, STATE: check_state}
    checks.get(part.of, refuse)(part, form)


def refuse(part: Part, form: Form) -> None:
    raise ValueError("a record is of an unknown kind")


def shaped(part: Part, shapes: Mapping[str, tuple[str, tuple[int, ...]]]) -> None:
    """ValueError unless a Part has these arrays, {name: (kind, shape)}, all numbers finite."""
    if part.arrays.keys() != shapes.keys():
        raise ValueError("a record has other arrays")
    for name, (kind, shape) in shapes.items():
        array = part.arrays[name]
        if array.dtype.str[1:] != kind or array.shape != shape:
            raise ValueError(f"the array {name} of a record has an unknown form")
        if kind == "f8" and not np.isfinite(array).all():
            raise ValueError(f"the array {name} of a record has values that are not numbers")


def demand(condition: Any, name: str) -> None:
    if not condition:
        raise ValueError(f"{name} of a record is impossible")


def is_count(value: Any, most: int = LARGEST) -> bool:
    return is_whole(value) and 0 <= value <= most


def check_bodies(part: Part, form: Form) -> None:
    n, points = form.bodies, len(np.atleast_1d(part.arrays.get("points", 0)))
    shaped(part, {
        "r_eq": ("f8", (n,)), "spheroradius": ("f8", (n,)), "mass": ("f8", (n,)),
        "floc": ("i4", (n,)), "count": ("i8", (n,)), "points": ("f8", (points, 2)),
        "point_part": ("i4", (points,)), "point_ring": ("i4", (points,)),
        "point_radius": ("f8", (points,)), "box": ("f8", (2,)),
    })  # fmt: skip
    for name in ("r_eq", "spheroradius", "mass", "point_radius", "box"):
        demand(np.all(part.arrays[name] > 0.0), name)
    counts = part.arrays["count"]
    demand(np.all((counts >= 1) & (counts <= points)) and counts.sum() == points, "count")


def check_moment(part: Part, form: Form) -> None:
    n = form.bodies
    bonds = part.arrays.get("bonds", np.zeros((0, 3)))
    many = len(bonds) if bonds.ndim else 0
    found = part.arrays.get("clusters", np.zeros((0, 0)))
    shaped(part, {
        "motion": ("f8", (n, 6)), "cluster": ("i4", (n,)), "counts": ("i8", (form.classes,)),
        "bonds": ("i4", (many, 3)),
        "clusters": ("f8", (len(found) if found.ndim else 0, len(OF_CLUSTERS))),
    })  # fmt: skip
    demand(np.all((bonds >= 0) & (bonds < [n, n, KIND_COUNT])), "bonds")
    labels = part.arrays["cluster"]
    demand(np.all((labels >= GONE) & (labels < n)), "cluster")
    demand(len(found) == labels.max(initial=-1) + 1, "clusters")
    demand(np.all((part.arrays["counts"] >= 0) & (part.arrays["counts"] <= n)), "counts")
    demand(is_count(part.facts.get("place"), form.moments - 1), "place")
    for name in COUNTS:
        value = part.facts.get(name)
        demand(value is None or is_number(value), name)


def check_state(part: Part, form: Form) -> None:
    n, links = form.bodies, part.arrays.get("links", np.zeros((0, sw.LINK_COLUMNS)))
    count = len(links) if links.ndim else 0
    one: tuple[int, ...] = ()
    shaped(part, {
        "seen": ("f8", (n, 6)),
        "motion": ("f8", (n, 6)), "carried": ("f8", (n, 6)),
        "errors": ("f8", (n, sw.ERROR_COLUMNS)),
        "steps": ("f8", (n,)), "wander": ("f8", (n,)),
        "methods": ("f8", (n,)), "links": ("i8", (count, sw.LINK_COLUMNS)),
        "slips": ("f8", (count, sw.SLIP_COLUMNS)), "time": ("f8", one), "span": ("f8", one),
        "stated": ("f8", (n,)), "effort": ("i8", (len(EFFORT),)),
        "gone": ("i8", (n,)), "returns": ("i8", (n,)),
    })  # fmt: skip
    for name in ("steps", "wander"):
        demand(np.all(part.arrays[name] > 0.0), name)
    methods = part.arrays["methods"]
    demand(np.all((methods == 0.0) | (methods == 1.0)), "methods")
    demand(0.0 <= part.arrays["time"] <= form.times[-1] and part.arrays["span"] > 0.0, "time")
    gone, returns = part.arrays["gone"], part.arrays["returns"]
    demand(np.all((gone >= 0) & (gone <= 1)) and np.all(returns >= 0), "gone")
    bodies, points = (
        links[:, [sw.LATER_BODY, sw.EARLIER_BODY]],
        links[:, [sw.AT_VERTEX, sw.AT_EDGE]],
    )
    demand(np.all((bodies >= 0) & (bodies < n)) and np.all(points >= 0), "links")
    demand(np.all(np.diff(links[:, sw.LATER_BODY]) >= 0), "links")
    demand(np.all((links[:, sw.MODE] >= at.OPEN) & (links[:, sw.MODE] <= at.GRAZES)), "links")
    demand(is_count(part.facts.get("moments"), form.moments), "moments")
    demand(part.facts["moments"] >= 1, "moments")


def check_ends(column: Callable[[str], np.ndarray]) -> None:
    """ValueError for rows of replicates that no run can have given; ``column(name)`` of ENDS."""
    demand(np.all((column("finished") >= 0) & (column("finished") <= 1)), "finished")
    demand(np.all(np.isfinite(column("end_time")) & (column("end_time") >= 0.0)), "end_time")
    for name in ("steps", "rejected", "body_steps", "windows"):
        demand(np.all(column(name) >= 0), name)
