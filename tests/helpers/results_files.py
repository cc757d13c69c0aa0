"""Results files for tests: written from results in memory, and compared byte for byte."""

from pathlib import Path

import numpy as np

from flocsim.io.files import Rule, keep
from flocsim.io.results.file import opened, parts_of
from flocsim.io.results.layout import ROWS, new_row_file
from flocsim.io.results.schema import Results


def write_results(path: str | Path, results: Results, rule: Rule = keep) -> None:
    """Write ``results`` to ``path``, whole or not at all; FileError if that is impossible.

    ``rule`` says what becomes of a file that is there. A table of replicates that is larger than
    the memory: `flocsim.io.results.layout`.
    """
    flat = {
        name: np.ascontiguousarray(array, array.dtype.newbyteorder("<")).reshape(-1)
        for name, array in (results.replicates or {}).items()
    }
    with new_row_file(path, results, rule) as file:
        digests = {}
        for block in range(file.plan.blocks):
            rows = slice(block * ROWS, (block + 1) * ROWS)
            columns = {name: values[rows] for name, values in flat.items()}
            digests[block] = file.write_block(block, columns)
        file.complete(results, digests)


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
