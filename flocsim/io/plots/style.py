"""The look that all figures share, the axes that several have, and how a figure is saved."""

import contextlib
import io
import math
import os
import re
import sys
import textwrap
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.errors import visible
from flocsim.io.files import Rule, write_file
from flocsim.io.outputs import check_ending

Figure = Any
"""A matplotlib Figure: no hint may load matplotlib."""

MICRO = 1e6
"""Micrometres of a metre."""

LAST = 1500
"""Milliseconds for which an animation shows its last frame."""

WIDTH = 3.4
"""Inches, a column of a journal: every figure is so wide, and has no letters below SMALL points, so
that they have 6 points where it is 8 cm wide."""
SMALL = 6.5

STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7.0,
    "axes.titlesize": 7.0,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.edgecolor": "0.35",
    "axes.axisbelow": True,
    "xtick.color": "0.25",
    "ytick.color": "0.25",
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.frameon": False,
    "legend.fontsize": SMALL,
    "legend.title_fontsize": SMALL,
    "legend.borderpad": 0.2,
    "legend.borderaxespad": 0.2,
    "legend.columnspacing": 1.2,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.2,
    "figure.dpi": 100.0,
    "savefig.dpi": 400.0,
    "pdf.fonttype": 42,
    # Without a fixed salt every SVG gets random names inside.
    "svg.hashsalt": "flocsim",
}

CLASS_COLOURS = {"A": "#0072B2", "B": "#56B4E9", "C": "#D55E00", "D": "#E69F00"}
"""Okabe and Ito's palette, told apart by the colour-blind: blues inside the zone, warm outside."""
BOND_COLOURS = {"certificate": "#009E73", "hook": "#CC79A7", "rest": "#999999"}
BODY_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7")
CONTACT_COLOUR = "#D7191C"
MARKERS = "osD^vPX*"
MOST_LABELS = 6
"""More labels of vertex counts than this would run into each other."""
WIDE = 5.0
"""Ends of a logarithmic axis that differ by so much have two of 1, 2 and 5 of a decade between."""
LONG = 30.0
"""Ends from which on labels at 2 and 5 would touch."""
PLAIN = (1e-3, 2e5)
"""Numbers that are written out."""
LEAST_LETTERS = 8
"""Of a line of a title that is broken."""
MOST_LETTERS = 40
"""Of a name or a word of a label, a legend or a panel's title."""
MOST_OF_TITLE = 300
"""Letters of a title that has the whole figure's width, and is broken."""
PANELS_PER_ROW = 2
PANEL_HEIGHT = 1.35
FOOT_HEIGHT = 0.115
"""Inches of a line at the foot of a figure."""
CROWDED = 50
"""Points in a panel from which on markers and lines are drawn finer."""

# A date or a version would make equal figures differ in bytes.
METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": "flocsim", "Producer": None},
    "svg": {"Date": None, "Creator": "flocsim"},
}
CLASS_WORDS = {
    "A": "A  inside, aggregated",
    "B": "B  inside, departed",
    "C": "C  outside, aggregated",
    "D": "D  outside, departed",
}
"""What the classes of outcome are."""

FORMATS = tuple(METADATA)

FIGURE_ENDINGS = tuple(f".{name}" for name in FORMATS)


@contextlib.contextmanager
def house_style() -> Iterator[None]:
    """Draw or save with the same settings whatever the user's matplotlibrc says."""
    load_matplotlib()
    import matplotlib.style

    with matplotlib.style.context(["default", STYLE]):
        yield


def load_matplotlib() -> None:
    """Import matplotlib, also where MPLBACKEND names a backend that is not installed.

    A command in a notebook's shell inherits the notebook's backend, without which matplotlib cannot
    even be imported. The figures of flocsim are drawn on Agg canvases and need no backend.
    """
    if "matplotlib" in sys.modules:
        return
    backend = os.environ.pop("MPLBACKEND", "")
    import matplotlib

    if backend:
        os.environ["MPLBACKEND"] = backend
        # A script's own pyplot uses the backend as if it had imported matplotlib first.
        with contextlib.suppress(ValueError):
            matplotlib.rcParams["backend"] = backend


def new_figure(width: float, height: float) -> Figure:
    """An empty figure [inches] on its own canvas: no window, no global state."""
    from matplotlib import figure as matplotlib_figure
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = matplotlib_figure.Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    # IPython asks an object for this; it knows matplotlib's own figures only once pyplot is loaded.
    figure._repr_png_ = partial(png_of, figure)  # type: ignore[attr-defined]
    return figure


def png_of(figure: Figure) -> bytes:
    """Return the figure as a PNG, as a notebook shows it."""
    picture = io.BytesIO()
    with house_style():
        figure.savefig(picture, format="png", dpi="figure")
    return picture.getvalue()


@contextlib.contextmanager
def drawing(width: float, height: float) -> Iterator[Figure]:
    """An empty figure [inches], to be drawn in the house's style inside the block."""
    with house_style():
        yield new_figure(width, height)


@contextlib.contextmanager
def panel_grid(
    titles: Sequence[str], y_label: str, x_label: str = "vertices $N$", height: float = PANEL_HEIGHT
) -> Iterator[tuple[Figure, list[Any], Any]]:
    """(a figure with equal panels of these titles, two a row, the panels, and a place of the grid
    that has none, or None); ``height`` of a panel [inches]."""
    count = len(titles)
    columns = min(count, PANELS_PER_ROW)
    rows = -(-count // columns)
    with drawing(WIDTH, height * rows + 0.2) as figure:
        grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axes in grid[count:]:
            axes.set_visible(False)
        for axes in grid[max(count - columns, 0) : count]:
            axes.xaxis.set_tick_params(labelbottom=True)
            axes.set_xlabel(x_label)
        for axes, title in zip(grid, titles, strict=False):
            axes.set_title(title)
        for axes in grid[:count:columns]:
            axes.set_ylabel(y_label)
        yield figure, list(grid[:count]), grid[-1] if len(grid) > count else None


def panel_width(count: int) -> float:
    """Inches that the axis of each of ``count`` panels has, about."""
    return (WIDTH - 0.3) / min(count, PANELS_PER_ROW) - 0.15


def keep_titles_whole(figure: Figure) -> None:
    """Draw a figure, the lines of titles broken that are wider than the room they have.

    The room of a panel's title ends where the next panel of its row begins, or the figure. The
    figure grows by the lines that are added: panels keep their height.
    """
    width = figure.bbox.width
    titles = [each for axes in figure.axes for each in titles_of(axes)]
    longest = [each for each in titles if each.get_window_extent().width > width]
    for title in longest:  # half of one would be taken for room that the panel needs beside it
        title.set_visible(False)
    figure.canvas.draw()  # places are known only then
    for title in longest:
        title.set_visible(True)
    panels = [(axes, axes.get_window_extent()) for axes in figure.axes if axes.get_visible()]
    added = dict.fromkeys([box.y1 for _, box in panels], 0.0)
    for text in filter(None, [figure._suptitle]):
        more = wrap(text, width - text.get_window_extent().x0 - 4.0)
        added[math.inf] = added.get(math.inf, 0.0) + more
    for axes, box in panels:
        beside = [o.x0 for _, o in panels if o.x0 > box.x1 and o.y0 < box.y1 and o.y1 > box.y0]
        for title in titles_of(axes):
            room = min([width, *beside]) - box.x0 - 4.0
            added[box.y1] = max(added[box.y1], wrap(title, room))
    if any(added.values()):
        figure.set_figheight(figure.get_figheight() + sum(added.values()) / figure.dpi)
        figure.canvas.draw()


def titles_of(axes):
    return [each for each in (axes.title, axes._left_title, axes._right_title) if each.get_text()]


def wrap(text, room):
    """Break a text into lines that fit a room [pixels], at other resolutions too, where letters are
    rounded to other widths; by how much higher it has become [pixels]."""
    found = text.get_window_extent().width
    room *= 0.95
    if found <= room:
        return 0.0
    height = text.get_window_extent().height
    lines = text.get_text().splitlines()
    fitting = int(max(map(len, lines)) * room / found) + 1
    while found > room and fitting > LEAST_LETTERS:
        fitting -= 1
        parts = [part for line in lines for part in textwrap.wrap(line, fitting)]
        text.set_text("\n".join(parts))
        found = text.get_window_extent().width
    return text.get_window_extent().height - height


def mark_figure(figure: Figure, words: str) -> None:
    """Say something of the whole figure, in red above it: that its results are unfinished."""
    before = f"\n{figure._suptitle.get_text()}" if figure._suptitle else ""
    figure.suptitle(words + before, x=0.01, ha="left", fontsize=7, color=CONTACT_COLOUR)


def add_foot(figure: Figure, words: str) -> None:
    """Add lines at the foot of a figure, small: notes on what is drawn; last of all its source.

    The figure grows by them.
    """
    above = f"{figure._supxlabel.get_text()}\n" if figure._supxlabel else ""
    words = plain(words, MOST_OF_TITLE)
    if not words or words in " ".join(above.split()):
        return
    with house_style():
        foot = figure.supxlabel(above + words, x=0.01, ha="left", va="bottom", fontsize=SMALL,
                                color="0.3")  # fmt: skip
    wrap(foot, figure.bbox.width)
    before, after = (1 + text.count("\n") for text in (above, foot.get_text()))
    added = after - before + (not above)
    figure.set_figheight(figure.get_figheight() + FOOT_HEIGHT * added)
    low = (FOOT_HEIGHT * after + 0.04) / figure.get_figheight()
    foot.set_y(0.02 / figure.get_figheight())
    # The layout would take the larger of a legend's and a label's height, not their sum.
    foot.set_in_layout(False)
    taken = low
    for legend in figure.legends:
        taken += legend.get_window_extent().height / figure.bbox.height
        legend.set_bbox_to_anchor((0.0, low, 1.0, 1.0 - low), figure.transSubfigure)
    if figure.get_layout_engine() is not None:
        figure.get_layout_engine().set(rect=(0.0, taken, 1.0, 1.0 - taken))


def graded_colours(count):
    """``count`` colours from dark to light for an ordered quantity (viridis without its yellow)."""
    import matplotlib

    return matplotlib.colormaps["viridis"](np.linspace(0.0, 0.85, max(count, 1)))


def plain(text, most=MOST_LETTERS):
    """A text that came from a file or from the user, as a figure can show it, whatever it is.

    A dollar sign does not start mathematics, letters that no font has are written out, and of more
    letters than ``most`` those in the middle are left out: else there were no room for the panels.
    """
    words = visible(str(text), keep="")
    if len(words) > most:
        words = f"{words[: most - most // 2 - 1]}…{words[-(most // 2) :]}"
    return words.replace("$", r"\$")


def type_titles(names):
    """The titles of panels, e.g. "(b) Type II"; a pair of radii needs no "Type"."""
    letters = [chr(ord("a") + n) if n < 26 else str(n + 1) for n in range(len(names))]
    kinds = ["Type " if re.fullmatch("[IVX]+", name) else "" for name in names]
    return [f"({a}) {b}{plain(c)}" for a, b, c in zip(letters, kinds, names, strict=True)]


def vertex_positions(vertices):
    """Evenly spaced places 0, 1, … in the order of the counts: the sphere has no place to scale."""
    return np.searchsorted(np.unique(vertices), vertices).astype(float)


def set_vertex_axis(axes, vertices, most=MOST_LABELS):
    """Ticks at the vertex counts, N = 1 called "sphere".

    Labels are thinned to the ``most`` that fit; the first and last always show.
    """
    counts = np.unique(vertices)
    words = ["sphere" if count == 1 else str(count) for count in counts]
    every = -(-len(words) // most)
    for index in range(1, len(words)):
        if (len(words) - 1 - index) % every or index < every:
            words[index] = ""
    axes.set_xlim(-0.5, len(counts) - 0.5)
    axes.set_xticks(np.arange(len(counts)), labels=words)
    axes.tick_params(axis="x", length=2.5)


def set_share_axis(axes):
    """An axis of shares that add up to 1."""
    set_probability_axis(axes)
    axes.set_ylim(0.0, 1.0)


def set_probability_axis(axes):
    axes.set_ylim(-0.03, 1.03)
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0], labels=["0", "", "0.5", "", "1"])
    axes.grid(axis="y", color="0.9", linewidth=0.6)


def set_log_axis(axis):
    """Ticks at 1, 2 and 5 of each decade of a logarithmic axis, everything on it being drawn; at 1
    alone where these would touch, at round numbers where the axis is too short for two of them."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

    low, high = axis.get_view_interval()
    steps = (1.0,) if high > LONG * low else (1.0, 2.0, 5.0)
    axis.set_major_locator(LogLocator(subs=steps) if high > WIDE * low else MaxNLocator(4))
    axis.set_major_formatter(FuncFormatter(lambda value, place: number_words(value)))
    axis.set_minor_locator(NullLocator())


def number_words(value):
    """A number above 0 as on an axis: 0.5, 2000, and with a power of ten beyond PLAIN."""
    if PLAIN[0] <= value < PLAIN[1]:
        return f"{value:g}"
    factor, power = f"{value:.3e}".split("e")
    times = "" if float(factor) == 1.0 else rf"{float(factor):g}\times"
    return f"${times}10^{{{int(power)}}}$"


def note(axes, words):
    """Say in the middle of a panel why nothing is drawn in it."""
    axes.text(0.5, 0.5, words, color="0.4", ha="center", va="center", transform=axes.transAxes)


def line_handles(words, colours):
    """Handles of a legend of lines by their words."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=colour, marker=marker(index), label=word)
        for index, (word, colour) in enumerate(zip(words, colours, strict=False))
    ]


def place_legend(figure, groups, spare=None):
    """A legend of {title: handles}: each group a column, or a single one in as many columns as fit.

    It stands in ``spare``, a place of the grid without a panel, or below all panels, for which the
    figure grows.
    """
    if len(groups) == 1:
        [(title, handles)] = groups.items()
        widest = range(len(handles), 0, -1)
    else:
        title, handles, widest = None, side_by_side(groups), [len(groups)]
    look = {"handles": handles, "title": title or None, "alignment": "left"}
    if spare is not None:
        spare.set_visible(True)
        spare.set_axis_off()
        spare.legend(loc="upper left", borderaxespad=0.0, **look)
        return
    for columns in widest:
        legend = figure.legend(ncols=columns, **look)
        box = legend.get_window_extent()
        legend.remove()
        if box.width <= figure.bbox.width:
            break
    rows = -(-len(handles) // columns)  # as few columns as these rows need
    figure.legend(loc="outside lower center", ncols=-(-len(handles) // rows), **look)
    figure.set_figheight(figure.get_figheight() + box.height / figure.dpi)


def side_by_side(groups):
    """Handles of {title: handles}, each group filled up to the longest, its title above it."""
    from matplotlib.lines import Line2D

    def words(text):
        return Line2D([], [], linestyle="none", label=text)

    most = max(map(len, groups.values()))
    columns = [
        [words(title), *handles, *[words(" ")] * (most - len(handles))]
        for title, handles in groups.items()
    ]
    return [handle for column in columns for handle in column]


def marker(index):
    """That of a line of so many."""
    return MARKERS[index % len(MARKERS)]


def dodge(number, count):
    """Sideways shift, as a share of a slot, that keeps the bars of ``count`` lines apart."""
    step = min(0.1, 0.6 / max(count - 1, 1))
    return (number - 0.5 * (count - 1)) * step


def save(figure: Figure, path: str | Path, rule: Rule = False, foot: str = "") -> None:
    """Write ``figure`` as PNG, PDF or SVG, told by the suffix, whole or not at all.

    ``rule`` says what becomes of a file that is there (flocsim.io.outputs); ``foot`` stands below
    all panels. The same figure gives
    the same bytes. Raises UsageError for another suffix, FileError if the file cannot be written.
    """
    check_ending(path, FIGURE_ENDINGS)
    suffix = Path(path).suffix.lower().removeprefix(".")
    picture = io.BytesIO()
    add_foot(figure, foot)
    with house_style():
        keep_titles_whole(figure)
        figure.savefig(picture, format=suffix, metadata=METADATA[suffix])
    write_file(path, picture.getvalue(), rule)


def frame_of(figure: Figure) -> Any:
    """What a figure that was drawn shows, as a Pillow image of 64 colours."""
    from PIL import Image

    pixels = np.asarray(figure.canvas.buffer_rgba())[:, :, :3]
    return Image.fromarray(np.ascontiguousarray(pixels)).quantize(64)


def save_gif(path: str | Path, frames: Sequence[Any], each: int, rule: Rule = False) -> None:
    """Write frames as a GIF that loops, ``each`` shown for so many milliseconds and the last for
    LAST; FileError if it cannot be written."""
    lasting = [each] * (len(frames) - 1) + [LAST]
    buffer = io.BytesIO()
    frames[0].save(buffer, "GIF", save_all=True, append_images=frames[1:], duration=lasting,
                   loop=0, optimize=False)  # fmt: skip
    write_file(path, buffer.getvalue(), rule)
