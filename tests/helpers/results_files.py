"""Results files for tests: written from results in memory, and compared byte for byte."""

from pathlib import Path

from flocsim.io.hdf5 import open_hdf5
from flocsim.io.results.file import write_results

__all__ = ["same_data", "write_results"]


def same_data(path_a: str | Path, path_b: str | Path) -> list[str]:
    """Names of the datasets outside ``run`` of two files whose shapes, types or bytes differ.

    Coordinates included; a dataset that only one file has differs. Empty when all agree.
    """

    def agree(one, other, path):
        mine, yours = one.node(path), other.node(path)
        if (mine.shape, mine.type) != (yours.shape, yours.type):
            return False
        if mine.text is not None:
            return mine.text == yours.text
        return one.read(path).tobytes() == other.read(path).tobytes()

    a, b = open_hdf5(path_a), open_hdf5(path_b)
    found = {**a, **b}
    names = [name for name in found if found[name].type and not name.startswith("run/")]
    return sorted(n for n in names if n not in a or n not in b or not agree(a, b, n))
