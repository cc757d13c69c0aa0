"""How the scripts of the study write: figures in every format, parts of docs/reproduction.md."""

from pathlib import Path

FORMATS = ("png", "pdf")


def paths_of(stem):
    return [Path(f"{stem}.{ending}") for ending in FORMATS]


def save_all(figure, stem):
    from flocsim.io.plots.style import save

    paths = paths_of(stem)
    for path in paths:
        save(figure, path)
    return paths


def marked(name, text):
    """A part between its marks."""
    return f"<!-- {name} -->\n\n{text}\n\n<!-- end -->"
