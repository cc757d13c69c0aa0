"""Markdown tables, of the pages of docs/ and of the reports of studies and benchmarks."""

from collections.abc import Iterable, Sequence


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table as text without a newline at its end; cells are shown by ``str``.

    A bar inside a cell does not end it.
    """
    lines: list[Sequence[object]] = [heads, ["---"] * len(heads), *rows]
    cells = ([str(cell).replace("|", "\\|") for cell in line] for line in lines)
    return "\n".join("| " + " | ".join(line) + " |" for line in cells)
