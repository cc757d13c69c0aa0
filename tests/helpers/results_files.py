"""Results files for tests: written from results in memory, and compared byte for byte."""

from pathlib import Path

from flocsim.io.results.file import write_results
from flocsim.io.results.schema import RESULTS

__all__ = ["same_data", "write_results"]


def same_data(path_a: str | Path, path_b: str | Path) -> list[str]:
    """Names of the datasets outside ``run`` whose shapes, types or bytes differ.

    Coordinates included; a dataset that only one file has differs. Empty when all agree.
    """

    def agree(one, other, path):
        mine, yours = one.node(path), other.node(path)
        if (mine.shape, mine.type) != (yours.shape, yours.type):
            return False
        if mine.text is not None:
            return mine.text == yours.text
        return one.read(path).tobytes() == other.read(path).tobytes()

    with RESULTS.opened(path_a) as a, RESULTS.opened(path_b) as b:
        names = {f"{group}/{name}" for file in (a, b) for group in file.names("")
                 for name in file.names(group) if group != "run"}  # fmt: skip
        return sorted(n for n in names if n not in a or n not in b or not agree(a, b, n))
