"""What a results file of single flocs holds, for the commands."""

from typing import Any

import numpy as np
from flocsim.ensembles.lone.file import GROUP, LoneResults, read_lone

from flocsim.ensembles.contents import Contents, Facts, Joined, Summary, in_words, origin
from flocsim.io.plots.style import Figure, house_style, new_figure
from flocsim.io.terminal import aligned


def facts_of(found: LoneResults) -> Facts:
    """How many flocs there are of how many vertices."""
    return [
        ("vertices", ", ".join(map(str, found.vertices))),
        ("replicates", f"{found.count} of each"),
        ("failed", str(int(found.columns["failed"].sum()))),
    ]


def table(found: LoneResults) -> str:
    """Means over flocs, a row for each number of vertices."""
    speed, drift = (found.columns[name].mean(axis=1) for name in ("speed", "drift"))
    rows = [("N", "flocs", "speed [um/s]", "drift [nm]")]
    rows += [
        (str(n), str(found.count), f"{1e6 * v:.4g}", f"{1e9 * x:.4g}")
        for n, v, x in zip(found.vertices, speed, drift, strict=True)
    ]
    return "\n".join(aligned(rows))


def speeds(found: LoneResults) -> Figure:
    """Speed of every floc against its number of vertices."""
    with house_style():
        figure = new_figure(4.0, 3.0)
        axes = figure.subplots()
        axes.plot(found.vertices, 1e6 * found.columns["speed"], ".", color="0.3")
        axes.set(xlabel="number of vertices N", ylabel="speed [µm/s]")
    return figure


def sweep_rows(swept: Any) -> list[tuple[str, ...]]:
    """Mean speeds at every value, heads first."""
    values = swept.labelled("flocs").columns["speed"].values.mean(axis=(-2, -1))
    keys = [each.values for each in swept.swept.values()]
    rows = [(*swept.swept, "speed [um/s]")]
    for place in np.ndindex(*values.shape):
        words = (in_words(key[k]) for key, k in zip(keys, place, strict=True))
        rows.append((*words, f"{1e6 * values[place]:.4g}"))
    return rows


def asked(found: LoneResults) -> dict[str, Any]:
    """The axes of results."""
    return {"types": ["lone"], "vertices": found.vertices.tolist(), "delta": [0.0],
            "replicates": found.count}  # fmt: skip


FIGURES = {"speeds": speeds}

CONTENTS = Contents(
    title="results of single flocs past a wall", read=read_lone,
    summary=lambda found: Summary(facts_of(found), origin(found.run)), table=table,
    figures=lambda found: FIGURES, drawn={"a study of single flocs": FIGURES},
    so_far=lambda found: facts_of(found.results), run=lambda found: found.run,
    opened=lambda path, allowed=None: read_lone(path),
    joined=Joined({"flocs": GROUP}, sweep_rows, {}, asked),
)  # fmt: skip
