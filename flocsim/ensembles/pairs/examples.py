"""One replicate of each class of a results file, run again to be watched."""

import os

from flocsim.ensembles.contents import Example
from flocsim.ensembles.pairs.opened import StudyResults, open_results
from flocsim.ensembles.pairs.replicates import place_of
from flocsim.errors import FlocsimError
from flocsim.io.results.file import first_of_each
from flocsim.io.results.schema import CLASSES


def examples_of(path: str | os.PathLike, folder: str | os.PathLike | None) -> list[Example]:
    """The first replicate of each class that the file has, of its flocs with the most vertices."""
    opened = open_results(path, folder)
    found = first_of_each(opened.source)
    return [example_of(opened, name, found[name]) for name in CLASSES if name in found]


def example_of(opened: StudyResults, outcome: str, at: tuple[int, int, int, int]) -> Example:
    """The Example at one place of the table of replicates."""
    t, v, d, replicate = at
    name, vertices, delta = opened.types[t], int(opened.vertices[v]), float(opened.delta[d])
    title = f"type {name}, N = {vertices}, δ = {delta:g} δ_max, replicate {replicate}"
    try:
        trajectory = opened.replicate(replicate, name, vertices, delta)
        place = place_of(opened.config, name, vertices, delta)
        zone = opened.study_with(vertices).draw(*place, replicate).encounter.zone_distance
    except FlocsimError as error:
        return Example(outcome, title, reason=" ".join(str(error).split()))
    return Example(outcome, title, trajectory, float(zone))
