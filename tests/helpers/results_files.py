"""Results files for tests: written from results in memory, and compared byte for byte."""

from pathlib import Path

from flocsim.io.results.file import opened, parts_of
from flocsim.io.results.layout import write_results

__all__ = ["same_data", "write_results"]


def same_data(path_a: str | Path, path_b: str | Path) -> list[str]:
    """Names of the datasets outside ``run`` whose shapes, types or bytes differ.

    Coordinates included; a dataset that only one file has differs. Empty when all agree.
    """

    def content(file, path):
        """Its values, some at a time: all of a file may be larger than the memory."""
        for part in parts_of(file.node(path).shape):
            values = file.read(path, part)
            yield values.tolist() if file.node(path).text is not None else values.tobytes()

    def agree(one, other, path):
        mine, yours = one.node(path), other.node(path)
        if (mine.shape, mine.type) != (yours.shape, yours.type):
            return False
        pairs = zip(content(one, path), content(other, path), strict=True)
        return all(mine == yours for mine, yours in pairs)

    with opened(path_a) as a, opened(path_b) as b:
        names = {f"{group}/{name}" for file in (a, b) for group in file.names("")
                 for name in file.names(group) if group != "run"}  # fmt: skip
        return sorted(n for n in names if n not in a or n not in b or not agree(a, b, n))
