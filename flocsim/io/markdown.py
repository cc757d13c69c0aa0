"""Markdown tables, of the pages of docs/ and of the reports of studies and benchmarks."""


def markdown_table(heads, rows):
    """A table as text without a newline at its end; cells are shown by ``str``.

    A bar inside a cell does not end it.
    """
    lines = [heads, ["---"] * len(heads), *rows]
    cells = ([str(cell).replace("|", "\\|") for cell in line] for line in lines)
    return "\n".join("| " + " | ".join(line) + " |" for line in cells)
