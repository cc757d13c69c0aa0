"""How the scripts of the study write: figures in every format, pages, tables.

They go into the script's own folder. What lies there and was not made by flocsim, or was changed
since, is kept as name.1.png, name.1.md, …
"""

import csv
import io
from pathlib import Path

from flocsim.io.files import write_file
from flocsim.io.outputs import data_rule, figure_rule
from flocsim.io.outputs import marked as with_own_mark

FORMATS = ("png", "pdf")


def paths_of(stem):
    return [Path(f"{stem}.{ending}") for ending in FORMATS]


def save_all(figure, stem):
    from flocsim.io.plots.style import save

    paths = paths_of(stem)
    for path in paths:
        save(figure, path, figure_rule(overwrite=True))
    return paths


def write_page(path, text):
    """Write a page of Markdown."""
    write_file(path, with_own_mark(text.encode(), ".md"), figure_rule(overwrite=True))


def write_table(path, rows):
    """Write rows as CSV; a table that says the same already stays."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    data = text.getvalue().encode()
    if not (path.is_file() and path.read_bytes() == data):
        write_file(path, data, data_rule(overwrite=True))


def marked(name, text):
    """A part between its marks."""
    return f"<!-- {name} -->\n\n{text}\n\n<!-- end -->"
