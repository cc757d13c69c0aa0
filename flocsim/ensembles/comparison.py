"""Differences between two results of one kind: what comparisons of all kinds have in common."""

from collections.abc import Mapping
from typing import Any, ClassVar

import attrs
import numpy as np

from flocsim.ensembles.config.kinds import STUDIES, contents_of
from flocsim.ensembles.contents import studies
from flocsim.ensembles.storage.stored_json import stored
from flocsim.errors import FileError, UsageError
from flocsim.io.labelled import Column, Labelled, Tables


@attrs.frozen(eq=False, repr=False)
class Differences(Tables):
    """``arrays`` {quantity: {name: values}} of what the second has more of than the first.

    ``paired``: whether replicate k is the same draw in both, so that the difference is that of the
    ``pairs`` that both have; else samples are independent. ``changes``, lines on what the studies
    differ in.
    """

    paired: bool
    pairs: int
    arrays: dict[str, dict[str, np.ndarray]]
    changes: tuple[str, ...] = ()
    noun: ClassVar[str] = "replicates"

    def table(self, quantity: str = "") -> str:
        """The differences of one quantity, the first where none is named, as text."""
        raise NotImplementedError

    @property
    def how(self) -> str:
        """How they were compared, in words."""
        both = f"the {self.pairs} {self.noun} that both have, paired"
        return both if self.paired else "independent samples"

    def __repr__(self) -> str:
        how = f"{self.pairs} pairs" if self.paired else "independent"
        shape = " × ".join(map(str, next(iter(next(iter(self.arrays.values())).values())).shape))
        return f"{type(self).__name__}({shape} places, {how})"


def starred(low: Any, high: Any) -> str:
    """A star for an interval without 0."""
    return " *" if low > 0.0 or high < 0.0 else ""


def labelled_of(
    axes: dict[str, Column], arrays: Mapping[str, np.ndarray], meanings: Mapping[str, str],
    facts: dict[str, Any], units: str = "1",
) -> Labelled:  # fmt: skip
    """Arrays of a comparison along all axes."""
    return Labelled(
        axes,
        {
            name: Column(tuple(axes), values, {
                "units": "1" if name.startswith("n_") else units, "long_name": meanings[name],
            }) for name, values in arrays.items()
        },
        facts,
    )  # fmt: skip


def identity_in(results: Any) -> dict[str, Any]:
    """What the rows of results follow from, as their file says; FileError where nobody can read
    it."""
    try:
        found: dict[str, Any] = stored(results.run, "identity")
        return found
    except ValueError as error:
        where = getattr(results, "path", "a file")
        raise FileError(f"{where} has no readable results: {error}") from error


def changes_between(first: Any, second: Any) -> tuple[str, ...]:
    """Lines on what the studies of two files differ in."""
    from flocsim.ensembles.storage.identity import differences  # which needs the engine

    lines = differences(*map(identity_in, (first, second)))
    return tuple(
        line.replace(" in the file, ", " in the first, ").replace(" now", " in the second")
        for line in lines
    )


def common(ours: Any, theirs: Any, axis: str) -> list:
    """The values of an axis that both have, in the order of the first; UsageError for none."""
    ours, theirs = (np.asarray(each).tolist() for each in (ours, theirs))
    both = [value for value in ours if value in theirs]
    if not both:
        raise UsageError(
            f"the two files have no {axis} in common: {', '.join(map(str, ours))} and "
            f"{', '.join(map(str, theirs))}"
        )
    return both


def compare(first: Any, second: Any) -> Differences:
    """What the second of two results has more of than the first, over the conditions that both
    have; of swarms over the times.

    They are paired where both have drawn the same replicates, one by one: studies of one seed.
    UsageError where they have nothing in common, or are of two kinds.
    """
    formats = {getattr(each, "format", "") for each in (first, second)}
    for name in formats & STUDIES.keys() if len(formats) == 1 else ():
        if (difference := contents_of(name).compare) is not None:
            found: Differences = difference(first, second)
            return found
    words = " and ".join(type(each).__name__ for each in (first, second))
    able = ", or ".join(f"two {each.title}" for each in studies() if each.compare)
    raise UsageError(f"{able} can be compared: found {words}")
