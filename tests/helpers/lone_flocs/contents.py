"""What a results file of single flocs holds, for the commands."""

from types import MappingProxyType
from typing import Any

import attrs
import numpy as np
from flocsim.ensembles.lone.file import COLUMNS, GROUPS, SCALES, LoneResults, read_lone
from flocsim.ensembles.lone.kind import table

from flocsim.ensembles.comparison import Differences, changes_between, common, labelled_of
from flocsim.ensembles.contents import Contents, Facts, Joined, Summary, in_words, origin
from flocsim.io.labelled import Column, Labelled, about_of
from flocsim.io.plots.style import Figure, house_style, new_figure
from flocsim.io.terminal import aligned


def facts_of(found: LoneResults) -> Facts:
    """How many flocs there are of how many vertices."""
    return [
        ("vertices", ", ".join(map(str, found.vertices))),
        ("replicates", f"{found.count} of each"),
        ("failed", str(int(found.columns["failed"].sum()))),
    ]


def speeds(found: LoneResults) -> Figure:
    """Speed of every floc against its number of vertices."""
    with house_style():
        figure = new_figure(4.0, 3.0)
        axes = figure.subplots()
        for n, speed in zip(found.vertices, found.columns["speed"], strict=True):
            axes.plot(np.full(len(speed), n), 1e6 * speed, ".", color="0.3")
        axes.set(xlabel="number of vertices N", ylabel="speed [µm/s]")
    return figure


def over_key(swept: Any) -> Figure:
    """Mean speed against the swept key."""
    values = swept.labelled("flocs").columns["speed"].values
    key = next(iter(swept.swept.values()))
    with house_style():
        figure = new_figure(4.0, 3.0)
        axes = figure.subplots()
        axes.plot(key.values, 1e6 * values.reshape(len(key.values), -1).mean(axis=1), "o-")
        axes.set(xlabel=key.key, ylabel="mean speed [µm/s]")
    return figure


def sweep_rows(swept: Any) -> list[tuple[str, ...]]:
    """Mean speeds at every value."""
    values = swept.labelled("flocs").columns["speed"].values.mean(axis=(-2, -1))
    rows = [(*swept.swept, "speed [um/s]")]
    keys = [each.values for each in swept.swept.values()]
    for place in np.ndindex(*values.shape):
        words = (in_words(key[k]) for key, k in zip(keys, place, strict=True))
        rows.append((*words, f"{1e6 * values[place]:.4g}"))
    return rows


def asked(found: LoneResults) -> dict[str, Any]:
    """The axes of results."""
    return {"types": ["lone"], "vertices": found.vertices.tolist(), "delta": [0.0],
            "replicates": found.count}  # fmt: skip


@attrs.frozen(eq=False, repr=False)
class LoneComparison(Differences):
    """Mean speeds of two files, ``arrays`` {column: {name: (vertices,)}}."""

    vertices: np.ndarray = attrs.field(kw_only=True)
    indices = MappingProxyType({"speed": ("vertices",)})
    word = "quantity"
    noun = "flocs"

    def labelled(self, quantity: str) -> Labelled:
        """The differences along the numbers of vertices."""
        axes = {"vertices": Column(("vertices",), self.vertices, about_of(SCALES["vertices"]))}
        meanings = {"difference": "second minus first, mean over flocs"}
        return labelled_of(axes, self.arrays[self.known(quantity)], meanings, {}, "m s-1")

    def table(self, quantity: str = "speed") -> str:
        """The same as text."""
        found = self.labelled(quantity).columns["difference"].values
        rows = [("N", f"{quantity} [m/s], second minus first")]
        rows += [(str(n), f"{each:+.4g}") for n, each in zip(self.vertices, found, strict=True)]
        return "\n".join([*self.changes, *aligned(rows)])


def compare(first: LoneResults, second: LoneResults) -> LoneComparison:
    """Mean speeds at the numbers of vertices that both have."""
    both = np.array(common(first.vertices, second.vertices, "vertices"))
    means = [each.columns["speed"][np.isin(each.vertices, both)].mean(axis=1)
             for each in (first, second)]  # fmt: skip
    arrays = {"speed": {"difference": means[1] - means[0]}}
    return LoneComparison(False, 0, arrays, changes_between(first, second), vertices=both)


FIGURES = {"speeds": speeds}

CONTENTS = Contents(
    title="results of single flocs past a wall", read=read_lone,
    summary=lambda found: Summary(facts_of(found), origin(found.run)), table=table,
    figures=lambda found: FIGURES, drawn={"a study of single flocs": FIGURES},
    so_far=lambda found: facts_of(found.results), run=lambda found: found.run,
    opened=lambda path, folder=None, sources=None: read_lone(path), compare=compare,
    compared={"speed": COLUMNS["speed"][2]},
    joined=Joined({"flocs": GROUPS["flocs"]}, sweep_rows, {"sweep": over_key}, asked),
)  # fmt: skip
