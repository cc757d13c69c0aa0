"""One replicate of a swarm study, from its start or from where it was left, to its end."""

import math
import time
from collections.abc import Callable
from typing import Any

import attrs
import numpy as np

from flocsim.ensembles.swarms.records import BODIES, MOMENT, STATE, Left, Part
from flocsim.geometry.shapes.cores import table_of
from flocsim.integrators.base import Status
from flocsim.io.results.swarm_file import GONE, OF_CLUSTERS, WALL
from flocsim.swarms.arrays import AT_EDGE, AT_VERTEX, EARLIER_BODY, LATER_BODY
from flocsim.swarms.progress import Progress
from flocsim.swarms.swarm import Swarm
from flocsim.swarms.together.bonds import Bonds
from flocsim.swarms.together.clusters import Clusters, Gauge


def run_replicate(
    study: Any, replicate: int, keep: Callable[[Part], object], left: Left | None = None,
    halted: Callable[[], bool] | None = None, going: Callable[[str], object] | None = None,
) -> dict[str, Any] | None:  # fmt: skip
    """Run a replicate of a SwarmStudy: how it ended and what it took; None where it was left.

    ``keep`` takes its Parts as they come. ``halted()``, looked at between windows and now and then
    within long ones, makes it leave off, its state kept. ``going`` is told as often how far it is.
    """
    swarm, drawn, box = study.swarm(replicate)
    gauge, bond_gauge = swarm.gauge(), swarm.bond_gauge()
    swarm.check_overlaps(gauge)
    progress = swarm.begin(
        study.scene.duration, max_steps=study.config.integrator.max_steps,
        leaving=study.leaving(replicate, swarm, box),
    )  # fmt: skip
    stops = study.stops

    def look(tried: int) -> bool:
        if going is not None:
            going(f"swarm {replicate} at {progress.time:.4g} s, {tried} steps on")
        return halted is not None and halted()

    if left is None or not fits(left, swarm):
        keep(bodies_part(swarm, drawn.flocs, box))
        seen = progress.swarm.motion.copy()
        bonds = bond_gauge.bonds(0.0, seen, gauge.neighbours(seen[:, :3]))
        keep(moment_part(0, study, swarm, gauge, progress, bonds))
        moments = 1
    else:
        progress.restore(left.state)
        moments, seen = left.moments, left.state["seen"]
    kept_at, status = time.monotonic(), Status.FINISHED
    for place in range(moments, len(stops)):
        while (status := progress.advance(stops[place], look)) in (Status.PAUSED, Status.STOPPED):
            late = time.monotonic() - kept_at > study.scene.checkpoint
            stopped = status == Status.STOPPED or look(0)
            if late or stopped:
                keep(state_part(place, progress, seen))
                kept_at = time.monotonic()
            if stopped:
                return None
        if status != Status.FINISHED:
            break
        motion = progress.swarm.motion.copy()
        near = gauge.neighbours(motion[:, :3])
        bonds = bond_gauge.bonds(stops[place], motion, near, (stops[place - 1], seen))
        keep(moment_part(place, study, swarm, gauge, progress, bonds))
        seen = motion
        if place + 1 < len(stops) and halted is not None and halted():
            keep(state_part(place + 1, progress, seen))
            return None
    failed = [] if progress.failed is None else progress.failed.tolist()[:MOST_NAMED]
    return {"status": status.name, "failed": failed, "time": progress.time} | attrs.asdict(
        progress.effort
    )


def fits(left: Left, swarm: Swarm) -> bool:
    """Whether the contacts of a state are between core points that the bodies of a swarm have: the
    kernels trust them."""
    first = np.cumsum([0, *(len(body.shape.vertices) for body in swarm.bodies)])
    owner = np.repeat(np.arange(len(swarm.bodies)), np.diff(first))
    links = left.state["links"]
    points = links[:, [AT_VERTEX, AT_EDGE]]
    if np.any(points >= first[-1]):
        return False
    bodies = np.sort(links[:, [LATER_BODY, EARLIER_BODY]], axis=1)
    return bool(np.all(np.sort(owner[points], axis=1) == bodies))


def bodies_part(swarm: Swarm, flocs: np.ndarray, box: tuple[float, float]) -> Part:
    """What is the same at all times: the bodies, a wall the last of them, and the box."""
    shapes = [body.shape for body in swarm.bodies]
    tables = [table_of(shape.parts) for shape in shapes]
    walls = len(shapes) - len(flocs)
    return Part(BODIES, {
        "r_eq": np.array([shape.equivalent_radius for shape in shapes]),
        "spheroradius": np.array([shape.radius for shape in shapes]),
        "mass": np.array([body.mass for body in swarm.bodies]),
        "floc": np.append(flocs, np.full(walls, WALL)).astype(np.int32),
        "count": np.array([len(each.place) for each in tables], dtype=np.int64),
        "points": np.concatenate([each.place for each in tables]),
        "point_part": np.concatenate([each.part for each in tables]).astype(np.int32),
        "point_ring": np.concatenate([each.ring for each in tables]).astype(np.int32),
        "point_radius": np.concatenate([each.radius for each in tables]),
        "box": np.array(box),
    })  # fmt: skip


def moment_part(
    place: int, study: Any, swarm: Swarm, gauge: Gauge, progress: Progress, bonds: Bonds
) -> Part:  # fmt: skip
    """A snapshot, its clusters and bonds with it."""
    now, motion, error = progress.seen()
    # Where what is gone lies, so far outside that it is nobody's neighbour.
    position, velocity = progress.swarm.motion[:, :3], progress.swarm.motion[:, 3:]
    near = gauge.neighbours(position, study.scene.link)
    found = Clusters.of(swarm.bodies, position, velocity, near, ~progress.gone)
    facts = {"place": place, "time": now, "error": error} | summary_of(found)
    facts["median_error"] = progress.median_error
    facts |= {"removed": int(progress.gone.sum()), "reentered": int(progress.returns.sum())}
    facts |= {f"bonds_{kind}": count for kind, count in bonds.counts.items()}
    label = np.where(progress.gone, GONE, found.label).astype(np.int32)
    # A record has numbers only.
    arrays = {"motion": np.where(progress.gone[:, None], 0.0, motion), "cluster": label}
    arrays["bonds"] = np.column_stack([bonds.pairs, bonds.kind]).astype(np.int32)
    later, earlier = found.label[bonds.pairs].T
    inside = later[(later == earlier) & (later >= 0)]
    columns = {
        "mass": found.mass, "gyration": found.gyration, "hydrodynamic": found.hydrodynamic,
        "speed": -found.velocity[:, 1], "porosity": found.porosity,
        "bonds": np.bincount(inside, minlength=len(found)),
    }  # fmt: skip
    rows = np.column_stack([columns[name] for name in OF_CLUSTERS]).astype(float)
    # −1 for what one that percolates has not.
    arrays["clusters"] = np.where(np.isnan(rows), -1.0, rows)
    bounds = np.array([0.0, *study.scene.bounds, np.inf])
    arrays["counts"] = found.counts(bounds).astype(np.int64)
    return Part(MOMENT, arrays, facts)


def summary_of(clusters: Clusters) -> dict[str, float]:
    """Numbers on all clusters: of a body's cluster in the mean over mass, but for the first
    three; over the mass of those that have the quantity."""
    if not len(clusters):
        return {"clusters": 0, "largest": 0, "percolating": 0}
    share = clusters.mass / clusters.mass.sum()

    def mean(values: np.ndarray) -> float:
        known = np.isfinite(values)
        return float(share[known] @ values[known] / share[known].sum()) if known.any() else math.nan

    return {
        "clusters": len(clusters),
        "largest": int(clusters.size.max()),
        "percolating": int(clusters.percolates.sum()),
        "mean_size": clusters.mean_size,
        "gyration": mean(clusters.gyration),
        "porosity": mean(clusters.porosity),
        "fractal_dimension": clusters.fractal_dimension(),
        "settling": float(-share @ clusters.velocity[:, 1]),
    }


def state_part(moments: int, progress: Progress, seen: np.ndarray) -> Part:
    """What the rest of the replicate follows from; ``seen``: the motion at the last snapshot."""
    return Part(STATE, progress.state() | {"seen": seen}, {"moments": moments})


MOST_NAMED = 20
"""Bodies of an island that failed which are named."""
