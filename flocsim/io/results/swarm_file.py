"""The results file of a swarm study: HDF5 with a checksum behind, groups with dimension scales.

- ``counts``     numbers on the clusters of every replicate over time, and clusters by size class
- ``snapshots``  places, velocities and clusters of all bodies at every time
- ``bodies``     the bodies of every replicate: sizes, masses, core points, and its box
- ``bonds``      the pairs that touch, and what holds them, at every time
- ``clusters``   every cluster at every time: size, radii, speed, porosity, bonds
- ``events``     mergers and break-ups of clusters from one time to the next
- ``ends``       how every replicate ended, and what it took
- ``run``        scalars: config text, versions, machine
"""

import numpy as np

from flocsim.io.groups import FileFormat, Group, Stored, declared
from flocsim.io.terminal import aligned

WALL = -2
"""In `bodies/floc`: a wall."""

MOMENTS = ("replicate", "time")
COUNTS = {
    "clusters": ("f8", "1", "clusters, including single bodies"),
    "largest": ("f8", "1", "bodies of the largest cluster"),
    "mean_size": ("f8", "1", "body-weighted mean cluster size"),
    "percolating": ("f8", "1", "clusters connected to their own images around the box"),
    "gyration": ("f8", "m", "mass-weighted mean radius of gyration, without percolating clusters"),
    "porosity": ("f8", "1", "mean of 1 - area/area of the convex hull, likewise"),
    "fractal_dimension": ("f8", "1", "slope of log mass against log radius of gyration"),
    "settling": ("f8", "m s-1", "mass-weighted mean downward velocity of clusters"),
    "bonds_certificate": ("f8", "1", "touching pairs that no later load can separate"),
    "bonds_hook": ("f8", "1", "touching pairs at rest whose contacts carry the load"),
    "bonds_rest": ("f8", "1", "touching pairs with a stable pose, without such a proof"),
    "bonds_touching": ("f8", "1", "touching pairs without a known bond"),
    "removed": ("f8", "1", "bodies that have left the box for good"),
    "reentered": ("f8", "1", "number of times that bodies left the box and re-entered"),
    "median_error": ("f8", "m", "median over bodies of the stated error of position"),
    "error": ("f8", "m", "largest stated error of position of a body"),
}  # fmt: skip
"""Columns (replicate, time) of `counts`: {name: (type, units, long name)}."""

SNAPSHOTS = {
    "position": ("f8", "m, m, rad", "x, y and angle; positions continue through a periodic box"),
    "velocity": ("f8", "m s-1, m s-1, rad s-1", "velocity and spin"),
}
"""Columns (replicate, time, body, component)."""

CLUSTER = {"cluster": ("i4", "1", "cluster of a body; -1: a wall, or unknown; -2: left the box")}
GONE = -2
"""The cluster of a body that has left the box for good."""

BONDS = {
    "bond_replicate": ("i4", "1", "replicate of the pair"),
    "bond_time": ("i4", "1", "index of the snapshot along the times"),
    "bond_later": ("i4", "1", "second of two bodies that touch"),
    "bond_earlier": ("i4", "1", "first of the two"),
    "bond_kind": ("i4", "1", "0 touching, 1 certificate, 2 hook, 3 rest"),
}
"""Columns (bond,): the pairs that touch at all times of all replicates."""

CLUSTERS = {
    "cluster_replicate": ("i4", "1", "replicate of the cluster"),
    "cluster_time": ("i4", "1", "index of the snapshot along the times"),
    "cluster_number": ("i4", "1", "number of the cluster in snapshots/cluster"),
    "cluster_bodies": ("i4", "1", "bodies of the cluster"),
    "cluster_mass": ("f8", "kg", "mass"),
    "cluster_gyration": ("f8", "m", "radius of gyration; NaN: it percolates"),
    "cluster_hydrodynamic": ("f8", "m", "hydrodynamic radius of spheres of r_eq; NaN: percolates"),
    "cluster_speed": ("f8", "m s-1", "downward velocity of the centre of mass"),
    "cluster_porosity": ("f8", "1", "1 - area/area of the convex hull; NaN: it percolates"),
    "cluster_bonds": ("i4", "1", "touching pairs in the cluster"),
}  # fmt: skip
"""Columns (row,): every cluster at all times of all replicates."""

EVENTS = {
    "event_replicate": ("i4", "1", "replicate of the clusters"),
    "event_time": ("i4", "1", "index of the first snapshot after it"),
    "event_before": ("i4", "1", "clusters before"),
    "event_after": ("i4", "1", "clusters after; fewer: they merged, more: they broke up"),
    "event_bodies": ("i4", "1", "bodies of these clusters"),
    "event_largest": ("i4", "1", "bodies of the largest cluster on the side with more clusters"),
    "event_second": ("i4", "1", "bodies of the second largest cluster on that side"),
}  # fmt: skip
"""Columns (event,)."""

BODIES = {
    "r_eq": ("f8", "m", "equivalent radius"),
    "spheroradius": ("f8", "m", "radius of the disk that sweeps the core (smallest part)"),
    "mass": ("f8", "kg", "mass"),
    "floc": ("i4", "1", "index of the floc in the library or the pool; -1: a sphere, -2: a wall"),
    "first_point": ("i8", "1", "index of the first core point in points"),
    "point_count": ("i8", "1", "number of core points"),
}
"""Columns (replicate, body)."""

POINTS = {"points": ("f8", "m", "core points of all bodies, about their centroids")}
RINGS = {
    "point_part": ("i4", "1", "part of its body that a core point belongs to"),
    "point_ring": ("i4", "1", "ring of the part: 0 its outline, from 1 its holes"),
    "point_radius": ("f8", "m", "radius of the disk that sweeps the part"),
}
"""Columns (replicate, point)."""

BOX = {"box": ("f8", "m", "width and height of the box")}
ENDS = {
    "finished": ("i4", "1", "1: finished; 0: stopped early"),
    "end_time": ("f8", "s", "time at which the replicate ended"),
    "steps": ("i8", "1", "accepted steps of islands"),
    "rejected": ("i8", "1", "rejected steps of islands"),
    "body_steps": ("i8", "1", "accepted steps times the bodies of their islands"),
    "windows": ("i8", "1", "common times"),
}
"""Columns (replicate,)."""
ROW = np.dtype([(name, f"<{kind}") for name, (kind, *_) in ENDS.items()])
"""How a replicate ended."""

SCALES = {
    "replicate": ("i8", "1", "number of the replicate"),
    "time": ("f8", "s", "time since the start"),
    "class": ("f8", "m", "smallest equivalent radius of the size class"),
    "body": ("i8", "1", "number of the body"),
    "component": ("text", "1", "component of the position or velocity"),
    "axis": ("text", "1", "coordinate of a point"),
    "point": ("i8", "1", "number of the core point"),
    "bond": ("i8", "1", "number of the pair"),
    "row": ("i8", "1", "number of the row"),
    "event": ("i8", "1", "number of the event"),
}
COMPONENTS, AXES = ("x", "y", "angle"), ("x", "y")

PLACES = {
    "bond_replicate": "replicate", "bond_time": "time", "bond_later": "body",
    "bond_earlier": "body", "cluster_replicate": "replicate", "cluster_time": "time",
    "cluster_number": "body", "event_replicate": "replicate", "event_time": "time",
    "first_point": "point",
}  # fmt: skip
"""Columns that hold places along an axis."""

GROUPS = {
    "counts": Group.of(
        declared(COUNTS, MOMENTS)
        | declared({"n_class": ("f8", "1", "clusters of each size class")}, (*MOMENTS, "class")),
        SCALES,
    ),
    "snapshots": Group.of(
        declared(SNAPSHOTS, (*MOMENTS, "body", "component"))
        | declared(CLUSTER, (*MOMENTS, "body"), low=GONE, along={"cluster": "body"}), SCALES,
    ),
    "bodies": Group.of(
        declared(BODIES, ("replicate", "body"), low=WALL, along=PLACES)
        | declared(POINTS, ("replicate", "point", "axis"))
        | declared(RINGS, ("replicate", "point"), low=0)
        | declared(BOX, ("replicate", "axis"), low=0), SCALES,
    ),
    "bonds": Group.of(declared(BONDS, ("bond",), low=0, along=PLACES), SCALES),
    "clusters": Group.of(declared(CLUSTERS, ("row",), along=PLACES), SCALES),
    "events": Group.of(declared(EVENTS, ("event",), low=0, along=PLACES), SCALES),
    "ends": Group.of(declared(ENDS, ("replicate",), low=0), SCALES),
}  # fmt: skip


class SwarmResults(Stored):
    """Results of a swarm study, as `flocsim.open` returns them.

    Attributes
    ----------
    scales : dict of str to array
        Axes and their values.
    groups : dict of str to dict of str to array
        Columns of each group: counts, snapshots, clusters, bonds, events and others.
    run : dict
        Metadata of the run.
    """

    exported = ("counts", "clusters", "events")


SWARMS = FileFormat("flocsim swarm", 6, "results of a swarm", GROUPS, view=SwarmResults)
"""(path) → SwarmResults; FileError for a file that is absent, damaged or of another kind."""


def mean(values: np.ndarray) -> np.ndarray:
    """Return the mean over replicates that got so far; NaN where none did."""
    reached = ~np.isnan(values)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(reached, values, 0.0).sum(axis=0) / reached.sum(axis=0)


def error_text(error: float) -> str:
    """Return a stated error [m] as text; inf is one that is not known."""
    return "not known" if np.isinf(error) else f"{error:.1e}"


def events_of(labels: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of EVENTS that follow from the clusters of all bodies.

    ``labels`` (replicates, times, bodies): below 0 for a body of no cluster; what left in between
    does not count.

    Clusters of two snapshots that share bodies belong together, with all that these share bodies
    with. What happened and was undone between two snapshots is not seen.
    """
    rows = [
        (replicate, place, *event)
        for replicate, own in enumerate(labels)
        for place in range(1, len(own))
        for event in events_between(own[place - 1], own[place])
    ]
    columns = np.array(rows, dtype=np.int32).reshape(-1, len(EVENTS)).T
    return dict(zip(EVENTS, columns.copy(), strict=True))


def events_between(before: np.ndarray, after: np.ndarray) -> list[tuple[int, ...]]:
    """Return (clusters before, after, bodies, largest, second) of each event between snapshots,
    in the order of the first bodies."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    both = (before >= 0) & (after >= 0)
    _, one = np.unique(before[both], return_inverse=True)
    _, other = np.unique(after[both], return_inverse=True)
    if not len(one):
        return []
    count = one.max() + 1
    links = coo_array(
        (np.ones(len(one)), (one, count + other)), shape=2 * (count + other.max() + 1,)
    )
    _, label = connected_components(links, directed=False)
    events = []
    for event in range(label.max() + 1):
        inside = label[one] == event
        sizes = [np.bincount(side[inside]) for side in (one, other)]
        sizes = [np.sort(each[each > 0])[::-1] for each in sizes]
        parts = max(sizes, key=len)
        if len(parts) > 1:
            found = len(sizes[0]), len(sizes[1]), inside.sum(), parts[0], parts[1]
            events.append(tuple(map(int, found)))
    return events


def table_of(found: SwarmResults) -> str:
    """Return numbers on the clusters over time, means over replicates, as text."""
    many = len(found.scales["replicate"])
    return "\n".join(aligned(rows_of(found)) + [f"means over {many} swarms"] * (many > 1))


def rows_of(found: SwarmResults) -> list[list[str]]:
    """Return heads, and numbers on the clusters at each time, means over replicates."""
    counts = found.groups["counts"]
    columns = {
        "time [s]": (found.scales["time"], "{:.4g}".format),
        "clusters": (mean(counts["clusters"]), "{:.1f}".format),
        "largest": (mean(counts["largest"]), "{:.1f}".format),
        "mean size": (mean(counts["mean_size"]), "{:.2f}".format),
        "percolating": (mean(counts["percolating"]), "{:.1f}".format),
        "R_g [um]": (1e6 * mean(counts["gyration"]), "{:.3g}".format),
        "porosity": (mean(counts["porosity"]), "{:.3f}".format),
        "certificates": (mean(counts["bonds_certificate"]), "{:.1f}".format),
        "hooks": (mean(counts["bonds_hook"]), "{:.1f}".format),
        "settling [mm/s]": (1e3 * mean(counts["settling"]), "{:.4g}".format),
        "median position error [m]": (mean(counts["median_error"]), error_text),
        "largest [m]": (mean(counts["error"]), error_text),
    }
    rows = zip(*(map(form, values) for values, form in columns.values()), strict=True)
    return [[*columns], *map(list, rows)]
