"""Two results of one kind compared."""

from typing import Any

from flocsim.ensembles.comparison import Differences
from flocsim.ensembles.config.kinds import STUDIES, contents_of
from flocsim.ensembles.contents import studies
from flocsim.errors import UsageError


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
