"""Figures of results and trajectories, and saving them; the one door to matplotlib.

``FIGURES`` maps the names that `flocsim plot` knows to functions of a `Results`,
``POPULATION_FIGURES`` to functions of the entries of a shape library.
"""

import io
from pathlib import Path

from flocsim.errors import UsageError
from flocsim.io.files import replace_file
from flocsim.io.plots.animation import write_animation
from flocsim.io.plots.forces import draw_forces
from flocsim.io.plots.panels import figure_4, figure_5, figure_6, figure_8, overview
from flocsim.io.plots.population import POPULATION_FIGURES, figure_2, figure_3
from flocsim.io.plots.style import house_style
from flocsim.io.plots.trajectory import draw_distance, draw_strip

__all__ = [
    "FIGURES",
    "FORMATS",
    "POPULATION_FIGURES",
    "draw_distance",
    "draw_forces",
    "draw_strip",
    "figure_2",
    "figure_3",
    "figure_4",
    "figure_5",
    "figure_6",
    "figure_8",
    "overview",
    "save",
    "write_animation",
]

FIGURES = {"4": figure_4, "5": figure_5, "6": figure_6, "8": figure_8, "overview": overview}

# A date or a version would make equal figures differ in bytes.
METADATA = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": "flocsim", "Producer": None},
    "svg": {"Date": None, "Creator": "flocsim"},
}
FORMATS = tuple(METADATA)


def save(figure, path):
    """Write ``figure`` as PNG, PDF or SVG, told by the suffix, whole or not at all.

    The same figure gives the same bytes. Raises UsageError for another suffix, FileError if the
    file cannot be written.
    """
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix not in FORMATS:
        known = ", ".join(f".{name}" for name in FORMATS)
        raise UsageError(f"{path}: a figure's name must end in one of {known}")
    picture = io.BytesIO()
    with house_style():
        figure.savefig(picture, format=suffix, metadata=METADATA[suffix])
    replace_file(path, picture.getvalue())
