"""How the scripts of the study write: figures in every format, pages, tables.

They go into the script's own folder. What lies there and differs is kept as name.1.png,
name.1.md, …
"""

import csv
import io
from pathlib import Path

from flocsim.io.files import write_file

FORMATS = ("png", "pdf")


def paths_of(stem):
    return [Path(f"{stem}.{ending}") for ending in FORMATS]


def save_all(figure, stem):
    from flocsim.io.plots.style import save

    paths = paths_of(stem)
    for path in paths:
        save(figure, path, True)
    return paths


def write(path, text):
    """Write a text; a file that says the same already stays."""
    data = text.encode()
    if not (path.is_file() and path.read_bytes() == data):
        write_file(path, data, True)


def write_page(path, text):
    """Write a page of Markdown."""
    write(path, text)


def write_table(path, rows):
    """Write rows as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    write(path, text.getvalue())


def marked(name, text):
    """A part between its marks."""
    return f"<!-- {name} -->\n\n{text}\n\n<!-- end -->"
