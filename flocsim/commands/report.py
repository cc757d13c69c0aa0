"""`flocsim report r.h5`: all that a results file holds on one page for a browser.

Everything that comes from a file is escaped, so that it cannot become code in a browser, and the
page may load nothing (Content-Security-Policy).

A collision on it is a drawing that moves: SVG outlines that the script places, frame by frame.
Lengths in it are µm, y points up, and everything is seen from the receiving body's centroid.
"""

import argparse
import base64
import io
import json
import math
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.commands import add_allowed, add_overwrite, allowed_by
from flocsim.ensembles.contents import Contents, Example, open_kind, text_of
from flocsim.errors import visible
from flocsim.io.files import write_file
from flocsim.io.outputs import check_outputs
from flocsim.io.plots.collision import (
    CONTACT_COLOUR,
    Frames,
    draw_distance,
    rounded_length,
    time_unit,
    windows,
)
from flocsim.io.plots.style import (
    BODY_COLOURS,
    CLASS_WORDS,
    METADATA,
    MICRO,
    Figure,
    add_foot,
    house_style,
)
from flocsim.io.trajectory import centre_distance
from flocsim.trajectories.figures import frames_of, seen_from_first

TEMPLATES = Path(__file__).with_name("templates")

POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
"""Nothing is loaded from anywhere, whatever the file says of itself."""

FRAMES = 150

IN_MOTION = (
    "<p>The first replicate of each class, for the flocs with the most vertices, run again from "
    "the seed, in the frame of the receiving floc. Frames are spaced by distance, not by time. Red "
    "rings mark overlapping outlines.</p>"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Write one HTML page on a file that needs no other file: what flocsim info prints of it, the
    figures of flocsim plot, and its config; of pairs one replicate of each class (A to D) to
    watch, which is run again for it.

    results: file that flocsim wrote
    --output FILE.html: page to write (default: r.html for r.h5, in the current folder)
    --no-motion: do not run replicates again: a page without motion
    """
    add = parser.add_argument
    add("results")
    add("-o", "--output")
    add("--no-motion", action="store_true")
    add_allowed(parser)
    add_overwrite(parser)


def run(args: argparse.Namespace) -> int:
    """Write the page and print its path; returns the exit code."""
    path = Path(args.output or f"{Path(args.results).stem}.html")
    check_outputs([path], args.overwrite, [args.results], endings=(".html",))
    kind, file = open_kind(args.results)
    found = kind.read(file)
    examples = [] if args.no_motion else kind.examples(file, allowed_by(args))
    write_file(path, report_page(str(args.results), kind, found, examples).encode(), args.overwrite)
    for example in examples:
        if example.reason:
            print(f"class {example.outcome} not animated: {example.reason}")
    print(path)
    return 0


def report_page(path: str, kind: Contents, found: Any, examples: Sequence[Example]) -> str:
    """Return the HTML of a file; FileError as `text_of` raises it."""
    # Outcomes and the figure of everything come first.
    figures, first, source = kind.figures(found), ("outcomes", "overview"), kind.source(found)
    names = sorted(figures, key=lambda name: first.index(name) if name in first else len(first))
    config = str(getattr(found, "run", {}).get("config", ""))
    motions = "\n".join(map(motion_of, examples))
    sections = {
        "Results": verbatim(text_of(path, kind, found)),
        "Figures": "\n".join(figure_of(name, figures[name], found, source) for name in names),
        "Motion": motions and f"{IN_MOTION}<div class='motions'>{motions}</div>",
        "Config": config and verbatim(config),
    }
    shown = {head: content for head, content in sections.items() if content}
    links = " ".join(f"<a href='#{head.lower()}'>{head}</a>" for head in shown)
    body = "\n".join(
        f"<section id='{head.lower()}'><h2>{head}</h2>\n{content}</section>"
        for head, content in shown.items()
    )
    title = text(f"{path}: {kind.title}")
    style, script = ((TEMPLATES / name).read_text("utf-8") for name in ("page.css", "motion.js"))
    return f"""<!DOCTYPE html>
<html lang='en'><head><meta charset='utf-8'>
<meta http-equiv="Content-Security-Policy" content="{POLICY}">
<meta name='viewport' content='width=device-width, initial-scale=1'>
<title>{title}</title>
<style>
{style}</style></head>
<body>
<h1>{title}</h1>
<p>{text(source)}</p>
<nav>{links}</nav>
{body}
<script>{script}</script>
</body></html>
"""


def text(value: object) -> str:
    """Return any text as HTML shows it: escaped, letters that steer a display written out."""
    return escape(visible(str(value), ""))


def verbatim(words: str) -> str:
    """Return lines as they are."""
    lines = "\n".join(map(text, words.splitlines()))
    return f"<pre>{lines}</pre>"


def data_of(figure: Figure) -> str:
    """Return a figure as an address that holds all of it."""
    picture = io.BytesIO()
    with house_style():
        figure.savefig(picture, format="svg", metadata=METADATA["svg"])
    return f"data:image/svg+xml;base64,{base64.b64encode(picture.getvalue()).decode()}"


def figure_of(name: str, draw: Any, results: Any, foot: str) -> str:
    """Return a figure of `flocsim plot` inside the page, its caption being the help of it."""
    with house_style():
        figure = draw(results)
        add_foot(figure, foot)
    title = f"Figure {name}" if name.isdigit() else name.capitalize()
    caption = text(f"{title}: {(draw.__doc__ or '').partition(chr(10))[0]}")
    return (
        f"<figure><img alt='{caption}' src='{data_of(figure)}'>"
        f"<figcaption>{caption}</figcaption></figure>"
    )


def motion_of(example: Example) -> str:
    """Return the HTML of an Example: drawing, graph of d_c, slider; or why there is none."""
    heading = f"<b>{text(CLASS_WORDS[example.outcome])}</b><br>{text(example.title)}"
    if example.trajectory is None:
        return (
            f"<figure class='motion'><figcaption>{heading}<br>Not shown in motion: "
            f"{text(example.reason)}</figcaption></figure>"
        )
    run = example.trajectory
    frames, touch = frames_of(run, FRAMES), float(run.row["t_collision"])
    shown = int(np.abs(frames.times - touch).argmin()) if math.isfinite(touch) else 0
    pose = seen_from_first(run.at(frames.times).position) * [MICRO, MICRO, 180.0 / math.pi]
    # The middle of both bodies in every frame, and one half width that fits them all.
    eyes, half = windows(frames.outlines)
    unit, factor = time_unit(run.t)
    graph, dots = graph_of(run, frames, example.zone_distance, factor)
    data = {
        "shown": shown, "eye": rounded(MICRO * eyes), "ring": 0.03 * MICRO * half,
        "pose": rounded(pose), "dot": rounded(dots), "t": frames.times.tolist(),
        "contacts": [rounded(MICRO * each) for each in frames.contacts],
        "words": [
            f"t = {time * factor:.4g} {unit}, d_c = {MICRO * distance:.4g} µm"
            for time, distance in zip(frames.times, frames.centre_distance, strict=True)
        ],
    }  # fmt: skip
    bodies = drawing_of(run.shapes, data, MICRO * half)
    return (
        f"<figure class='motion' data-frames='{text(json.dumps(data, ensure_ascii=False))}'>"
        f"<figcaption>{heading}</figcaption>\n<div class='panels'>{bodies}{graph}</div>"
        "<div class='controls'><button type='button'>Play</button><input type='range' min='0' "
        f"max='{len(frames.times) - 1}' value='{shown}' aria-label='frame'>"
        f"<output>{text(data['words'][shown])}</output></div></figure>"
    )


def rounded(values: np.ndarray) -> list:
    """Return lists of numbers to a picometre, or a millionth of a degree."""
    return np.round(values, 6).tolist()


def drawing_of(shapes: Sequence, data: dict, half: float) -> str:
    """Return the bodies with a scale bar; the script places them."""
    bodies = []
    for shape, colour in zip(shapes, BODY_COLOURS, strict=False):
        rings = (MICRO * ring for ring in shape.outline(0.0, 0.0, 0.0))
        path = " ".join("M" + " ".join(f"{u:.5g},{v:.5g}" for u, v in ring) + "Z" for ring in rings)
        bodies.append(
            f"<path class='body' d='{path}' fill='{colour}' fill-opacity='.3' stroke='{colour}' "
            f"fill-rule='evenodd' stroke-width='{0.006 * half:.3g}'/>"
        )
    length, left, level = MICRO * rounded_length(0.5 * half / MICRO), -0.94 * half, 0.94 * half
    return (
        f"<svg role='img' aria-label='the two flocs' viewBox='{-half:.5g} {-half:.5g} "
        f"{2 * half:.5g} {2 * half:.5g}'><g transform='scale(1,-1)'><g class='view'>"
        f"{''.join(bodies)}<g class='contacts' fill='none' stroke='{CONTACT_COLOUR}' "
        f"stroke-width='{0.009 * half:.3g}'></g></g></g><path d='M{left:.5g},{level:.5g}"
        f"h{length:.5g}' stroke='#111' stroke-width='{0.02 * half:.3g}'/><text x='{left:.5g}' "
        f"y='{level - 0.03 * half:.5g}' font-size='{0.075 * half:.3g}'>{length:g} µm</text></svg>"
    )


def graph_of(run: Any, frames: Frames, zone: float, factor: float) -> tuple[str, np.ndarray]:
    """Return (SVG of the centre distance against time, with D_0 and a dot that the script moves,
    places (f, 2) of the dot); ``factor``: from seconds to the unit of its axis."""
    figure = draw_distance(run.t.tolist(), centre_distance(run.position).tolist(), zone)
    with house_style():
        figure.draw_without_rendering()
        data = data_of(figure)
    # Points from the upper left corner, as in the SVG.
    scale = 72.0 / figure.dpi
    width, height = scale * figure.bbox.width, scale * figure.bbox.height
    points = np.stack([frames.times * factor, frames.centre_distance * MICRO], axis=1)
    dots = scale * figure.axes[0].transData.transform(points) * [1.0, -1.0] + [0.0, height]
    return (
        f"<svg role='img' aria-label='centre distance against time' viewBox='0 0 {width:.6g} "
        f"{height:.6g}'><image href='{data}' width='{width:.6g}' height='{height:.6g}'/>"
        f"<circle class='now' r='3' fill='{BODY_COLOURS[0]}'/></svg>"
    ), dots
