"""What becomes of replicates, as bars stacked to 1, and why a probability has no value.

Counts are those of the group `probabilities` {name: (…)}, in whatever order of axes.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from flocsim.io.results.events import NOT_COLLIDED, ends_of, events_of

COLOURS = {
    "aggregated": "#0072B2", "departed": "#56B4E9", "missed": "0.85", "held": "#009E73",
    "undecided": "#E69F00", "failed": "#D7191C",
}  # fmt: skip
"""Of the ends of replicates, in the order of the stack."""

INSIDE, OUTSIDE = "all inside", "all outside"
LETTERS = {
    "missed": "m",
    "held": "h",
    "undecided": "u",
    "failed": "f",
    INSIDE: "i",
    OUTSIDE: "o",
}
"""Marks of a probability without trials, by what became of most of its replicates."""

MARK_AT = 0.025
"""Where on the axis of probabilities these marks stand: above its line, where there is no value."""


def causes_of(counts: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    """Why the probability ``name`` has no trials, a word of LETTERS; "" where it has some."""
    trials = events_of(counts)[name].trials
    ends = ends_of(counts)
    causes = {word: ends[word] for word in NOT_COLLIDED}
    classes = np.asarray(counts["n_class"])
    if name == "pr_a_given_inside":
        causes[OUTSIDE] = classes[..., 2:].sum(axis=-1)
    elif name == "pr_a_given_outside":
        causes[INSIDE] = classes[..., :2].sum(axis=-1)
    words = np.array([*causes, ""], dtype=object)
    most = np.argmax(np.stack(list(causes.values())), axis=0)
    return words[np.where((trials == 0) & (np.asarray(counts["n_total"]) > 0), most, len(causes))]


def draw_ends(
    axes: Any, places: np.ndarray, counts: Mapping[str, np.ndarray], width: float, shift: float = 0
) -> None:
    """Bars (k,) stacked to 1 at these places, ``width`` and ``shift`` in points."""
    total = np.maximum(np.asarray(counts["n_total"]), 1)
    base = np.zeros(len(places))
    for word, number in ends_of(counts).items():
        top = base + number / total
        axes.vlines(places, base, top, color=COLOURS[word], linewidth=width, capstyle="butt",
                    transform=shifted(axes, shift), label=word)  # fmt: skip
        base = top


def mark_causes(
    axes: Any, places: np.ndarray, causes: np.ndarray, colour: Any, shift: float = 0.0
) -> set[str]:
    """A letter on the axis at each place (k,) that has a cause; the causes that were marked."""
    for word in (found := {str(each) for each in causes if each}):
        at = places[causes == word]
        axes.plot(at, np.full(len(at), MARK_AT), linestyle="", marker=f"${LETTERS[word]}$", ms=4.5,
                  color=colour, markeredgewidth=0.2, clip_on=False,
                  transform=shifted(axes, shift))  # fmt: skip
    return found


def words_of(marked: set[str]) -> str:
    """What the letters of these causes say, for a legend; "" for none."""
    lines = [f"\n {LETTERS[word]}: {word}" for word in LETTERS if word in marked]
    return "\nno value where" + "".join(lines) if lines else ""


def shifted(axes: Any, points: float) -> Any:
    """The transform of an axes' data, so many points to the right."""
    from matplotlib.transforms import ScaledTranslation

    return axes.transData + ScaledTranslation(points / 72.0, 0.0, axes.figure.dpi_scale_trans)


def end_handles() -> list[Any]:
    """Handles of a legend of the stack, the topmost first."""
    from matplotlib.patches import Patch

    return [Patch(facecolor=colour, label=word) for word, colour in reversed(COLOURS.items())]
