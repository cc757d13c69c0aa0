"""What a results file of swarms holds, for the commands."""

from typing import Any

import numpy as np

from flocsim.ensembles.contents import (
    Contents,
    Facts,
    Figures,
    Joined,
    Summary,
    Table,
    in_words,
    later,
    origin,
)
from flocsim.ensembles.storage.stored_json import stored
from flocsim.errors import UsageError, visible
from flocsim.io.plots.swarm import SWARM_FIGURES, last_known, shape_of, write_swarm_animation
from flocsim.io.plots.sweep import SWARM_SWEEP_FIGURES
from flocsim.io.results.swarm_file import (
    COUNTS,
    GROUPS,
    WALL,
    SwarmResults,
    mean,
    read_swarm,
    table_of,
    table_rows,
)


def summary(results: SwarmResults) -> Summary:
    """What a results file of swarms says of its study; ValueError where that cannot be read."""
    failed = [f"swarm {note['replicate']}: {note['why']}" for note in stored(results.run, "failed")]
    warnings = [str(line) for line in stored(results.run, "warnings")]
    return Summary(facts_of(results), origin(results.run, ["trial"]), warnings, failed)


def facts_of(results: SwarmResults) -> Facts:
    """[(name, value)] of swarms, also of those that still run."""
    bodies, ends = results.groups["bodies"], results.groups["ends"]
    free = bodies["floc"][0] != WALL
    radii = 1e6 * bodies["r_eq"][:, free]
    width, height = 1e6 * bodies["box"].mean(axis=0)
    events = results.groups["events"]
    before, after = events["event_before"], events["event_after"]
    return [
        ("swarms", f"{len(radii)} of {np.count_nonzero(free)} bodies, "
         f"{int(ends['finished'].sum())} were completed"),
        ("r_eq [um]", f"{radii.min():.4g} to {radii.max():.4g}, median {np.median(radii):.4g}"),
        ("box [um]", f"{width:.5g} x {height:.5g}"),
        ("mergers", f"{np.sum(after < before)} of clusters, between snapshots"),
        ("break-ups", f"{np.sum(after > before)}"),
        ("steps", f"{ends['steps'].sum()} of islands, {ends['body_steps'].sum()} of bodies, "
         f"{ends['rejected'].sum()} rejected"),
    ]  # fmt: skip


def sweep_rows(found: Any) -> list[tuple[str, ...]]:
    """Clusters at the end at every value, means over swarms, heads first."""
    table = found.labelled("counts")
    rows = [(*found.swept, "swarms", "time [s]", "clusters", "mean size", "settling [mm/s]")]
    axes = [table.axes[name].values.tolist() for name in found.swept]
    names = ("clusters", "mean_size", "settling")
    for place in np.ndindex(*map(len, axes)):
        last = {name: table.columns[name].values[place][:, -1] for name in names}
        clusters, size, settling = (float(mean(last[name])) for name in names)
        keys = (visible(in_words(axis[k]), "") for axis, k in zip(axes, place, strict=True))
        time = in_words(float(table.axes["time"].values[-1]))
        rows.append((*keys, str(len(last["clusters"])), time,
                     f"{clusters:.1f}", f"{size:.2f}", f"{1e3 * settling:.4g}"))  # fmt: skip
    return rows


def figures(found: SwarmResults) -> Figures:
    """{name: function} of the figures that swarms have."""
    there = {
        "classes": len(found.scales["class"]) > 1,
        "speed": len(found.groups["clusters"]["cluster_speed"]) > 0,
    }
    return {name: draw for name, draw in SWARM_FIGURES.items() if there.get(name, True)}


def first_swarm(found: SwarmResults) -> tuple:
    """(times, positions, velocities, shapes) of the first swarm; UsageError where bodies have left
    it."""
    moments = found.groups["snapshots"]
    known = slice(last_known(found) + 1)
    position, velocity = (moments[name][0, known] for name in ("position", "velocity"))
    if not np.isfinite(position).all():
        raise UsageError(
            "bodies have left the first swarm, and exported motion has the same bodies at all "
            "times: flocsim plot --animation shows it"
        )
    shapes = [shape_of(found, 0, body) for body in range(position.shape[1])]
    return found.scales["time"][known], position, velocity, shapes


def tables(results: SwarmResults) -> list[Table | str]:
    """Clusters over time."""
    heads, *rows = table_rows(results)
    return [Table("Clusters over time, means over swarms", heads, rows)]


def asked(results: SwarmResults) -> dict[str, Any]:
    """The axes of results, and how many replicates there are."""
    return {"types": ["swarm"], "vertices": [int(results.run.get("vertices", 0))], "delta": [0.0],
            "replicates": len(results.scales["replicate"])}  # fmt: skip


CONTENTS = Contents(
    title="results of a swarm study", read=read_swarm, summary=summary,
    table=table_of, figures=figures, drawn={"a swarm study": SWARM_FIGURES}, tables=tables,
    so_far=lambda found: facts_of(found.results)[:-1], run=lambda found: found.run,
    opened=lambda path, folder=None, sources=None: read_swarm(path),
    compare=later("ensembles.swarms.comparison", "compare"),
    compared={name: words for name, (_, _, words) in COUNTS.items()},
    joined=Joined({"counts": GROUPS["counts"]}, sweep_rows, SWARM_SWEEP_FIGURES, asked),
    animate=write_swarm_animation, motion=first_swarm,
)  # fmt: skip
