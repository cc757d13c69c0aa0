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
from collections.abc import Callable, Iterable, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.commands import add_allowed, allowed_by
from flocsim.ensembles.contents import Contents, Example, Table, overview_of, summary_of
from flocsim.errors import UsageError, visible
from flocsim.geometry.contact.points import placed_contacts
from flocsim.io.files import write_file
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, data_rule
from flocsim.io.plots.collision import (
    CONTACT_COLOUR,
    MICRO,
    rounded_length,
    time_unit,
)
from flocsim.io.plots.results import MOST_ROWS
from flocsim.io.plots.style import BODY_COLOURS, CLASS_WORDS, METADATA, add_foot, house_style
from flocsim.io.seals import held
from flocsim.trajectories.figures import instants_along, seen_from_first

STYLE = Path(__file__).with_name("templates").joinpath("page.css").read_text("utf-8")

MOST_FAILURES = 20

DESCRIPTION = """\
Write one HTML page on a file that needs no other file: the figures of flocsim plot, the numbers
with their errors, warnings, and where it came from; of pairs one replicate of each class (A to D)
to watch, which is run again for it."""


def table_of(
    heads: Sequence[str], rows: Iterable[Sequence[object]], groups: Iterable[int] = ()
) -> str:
    """A table; ``groups``: numbers of the rows with a line above them."""
    firsts = set(groups)
    lines = ["<div class='wide'><table><thead><tr>"]
    lines += [f"<th>{text(head)}</th>" for head in heads]
    lines.append("</tr></thead><tbody>")
    for number, row in enumerate(rows):
        kind = " class='first'" if number in firsts else ""
        lines.append(f"<tr{kind}>" + "".join(f"<td>{text(cell)}</td>" for cell in row) + "</tr>")
    return "\n".join([*lines, "</tbody></table></div>"])


def facts_of(facts: Iterable[tuple[str, object]]) -> str:
    """A table of names and values."""
    rows = (f"<tr><th>{text(name)}</th><td>{text(value)}</td></tr>" for name, value in facts)
    return "<table class='facts'>" + "\n".join(rows) + "</table>"


def list_of(lines: Iterable[str], kind: str) -> str:
    """A list of lines; nothing for none."""
    items = "".join(f"<li>{text(line)}</li>" for line in lines)
    return f"<ul class='{kind}'>{items}</ul>" if items else ""


def page_of(
    title: str, sections: Sequence[tuple[str, str, str]], script: str, source: str = ""
) -> str:
    """Return the whole page of (anchor, heading, HTML) sections with its ``script``; ``source`` is
    a line below the title."""
    # Nothing is loaded from anywhere, whatever the file says of itself.
    policy = (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    )
    links = " ".join(f"<a href='#{anchor}'>{text(head)}</a>" for anchor, head, _ in sections)
    body = "\n".join(
        f"<section id='{anchor}'><h2>{text(head)}</h2>\n{content}</section>"
        for anchor, head, content in sections
    )
    return (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'>\n"
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        "<meta name='viewport' content='width=device-width, initial-scale=1'>\n"
        f"<title>{text(title)}</title>\n<style>\n{STYLE}</style></head>\n<body>\n"
        f"<h1>{text(title)}</h1>\n<p>{text(source)}</p>\n<nav>{links}</nav>\n{body}\n"
        f"<script>{script}</script>\n</body></html>\n"
    )


def report_page(path: str, kind: Contents, found: Any, examples: Sequence[Example]) -> str:
    """The HTML of a file; FileError as `summary_of` raises it."""
    said = summary_of(path, kind, found)
    sections = [("results", "Study and results", facts_of(said.facts))]
    if said.warnings or said.failed:
        more = len(said.failed) - MOST_FAILURES
        shown = said.failed[:MOST_FAILURES]
        shown += [f"and {more} more in run/failed"] if more > 0 else []
        content = list_of(said.warnings, "warnings") + list_of(shown, "failed")
        sections.append(("warnings", "Warnings", content))
    # Outcomes and the figure of everything come first.
    figures, first = kind.figures(found), ("outcomes", "overview")
    names = sorted(figures, key=lambda name: first.index(name) if name in first else len(first))
    drawn = "\n".join(figure_of(name, figures[name], found, kind.source(found)) for name in names)
    sections.append(("figures", "Figures", drawn))
    tables = "\n".join(map(numbers_of, kind.tables(found) or filter(None, [kind.table(found)])))
    if tables:
        sections.append(("tables", "Numbers", tables))
    if examples:
        motions = "\n".join(map(motion_of, examples))
        told = (
            "<p>The first replicate of each class, for the flocs with the most vertices, run "
            "again from the seed, in the frame of the receiving floc. Frames are spaced by "
            "distance, not by time. Red rings mark overlapping outlines.</p>"
        )
        sections.append(("motion", "In motion", f"{told}<div class='motions'>{motions}</div>"))
    config = kind.run(found).get("config", "") if kind.run else ""
    if said.origin or config:
        came = facts_of(said.origin) + (f"<h3>Config</h3>{verbatim(str(config))}" if config else "")
        sections.append(("provenance", "Origin", came))
    return page_of(f"{path}: {kind.title}", sections, SCRIPT, kind.source(found))


def numbers_of(table: Table | str) -> str:
    """A table under its heading, or text as it is."""
    if isinstance(table, str):
        return verbatim(table)
    said = "\n".join(f"<p>{text(line)}</p>" for line in table.said)
    return f"<h3>{text(table.heading)}</h3>{said}{table_of(table.heads, table.rows, table.firsts)}"


def verbatim(words: str) -> str:
    """Lines as they are."""
    lines = "\n".join(map(text, words.splitlines()))
    return f"<pre>{lines}</pre>"


def figure_of(name: str, draw: Callable[..., Any], results: Any, foot: str) -> str:
    """A figure of `flocsim plot` inside the page, its caption being the help of it."""
    picture = io.BytesIO()
    with house_style():
        figure = draw(results)
        add_foot(figure, foot)
        figure.savefig(picture, format="svg", metadata=METADATA["svg"])
    data = base64.b64encode(picture.getvalue()).decode()
    title = f"Figure {name}" if name.isdigit() else name.capitalize()
    caption = text(f"{title}: {(draw.__doc__ or '').partition(chr(10))[0]}")
    return (
        f"<figure><img alt='{caption}' src='data:image/svg+xml;base64,{data}'>"
        f"<figcaption>{caption}</figcaption></figure>"
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("results", help="file that flocsim wrote")
    add("-o", "--output", metavar="FILE.html",
        help="page to write (default: r.html for r.h5, in the current folder)")  # fmt: skip
    add(
        "--no-motion",
        action="store_true",
        help="do not run replicates again: a page without motion",
    )
    add_allowed(parser)
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)


def run(args: argparse.Namespace) -> int:
    """Write the page and print its path; returns the exit code."""
    path = Path(args.output or f"{Path(args.results).stem}.html")
    if path.suffix.lower() != ".html":
        raise UsageError(f"--output {path}: a page's name must end in .html")
    rule = data_rule(args.overwrite)
    check_outputs([Output(path, rule)], [args.results])
    source = held(args.results)
    kind, found = overview_of(source)
    examples = [] if args.no_motion else kind.examples(source, allowed_by(args))
    found = kind.with_rows(source, found, MOST_ROWS)
    page = report_page(str(args.results), kind, found, examples)
    write_file(path, page.encode(), rule)
    for reason in dict.fromkeys(example.reason for example in examples if example.reason):
        names = [example.outcome for example in examples if example.reason == reason]
        print(f"class {', '.join(names)} not animated: {reason}")
    print(path)
    return 0


FRAMES = 150
GRAPH = (46.0, 8.0, 310.0, 262.0)
"""Left, top, right and bottom of the graph's panel in its drawing of 320 × 320."""

SCRIPT = Path(__file__).with_name("templates").joinpath("motion.js").read_text("utf-8")


def text(value: object) -> str:
    """Any text as HTML shows it: escaped, letters that steer a display written out."""
    return escape(visible(str(value), ""))


def motion_of(example: Example) -> str:
    """The HTML of an Example: drawing, graph of d_c, slider; or why there is none."""
    heading = f"<b>{text(CLASS_WORDS[example.outcome])}</b><br>{text(example.title)}"
    if example.trajectory is None:
        return (
            f"<figure class='motion'><figcaption>{heading}<br>Not shown in motion: "
            f"{text(example.reason)}</figcaption></figure>"
        )
    trajectory = example.trajectory
    shapes, times = trajectory.shapes, trajectory.t
    places = seen_from_first(trajectory.position)
    relative = places * [MICRO, MICRO, 1.0]
    touch = float(trajectory.row["t_collision"])
    reaches = [shape.bounding_radius for shape in shapes]
    instants = instants_along(times, trajectory.position, reaches, FRAMES, touch)
    rows = np.unique([np.abs(times - each).argmin() for each in instants])
    shown = int(np.abs(times[rows] - touch).argmin()) if math.isfinite(touch) else 0
    # The middle of both bodies in every frame, and one half width that fits them all.
    seen, reach = relative[rows, :, :2], MICRO * np.array(reaches)[:, None]
    low, high = (seen - reach).min(axis=1), (seen + reach).max(axis=1)
    eyes, half = 0.5 * (low + high), 0.52 * float(np.max(high - low))
    distance = np.hypot(*(relative[:, 1, :2] - relative[:, 0, :2]).T)
    unit, factor = time_unit(times)
    zone = MICRO * example.zone_distance
    graph, dots = graph_of(times * factor, distance, rows, zone, unit)
    contacts = [MICRO * placed_contacts(shapes, places[row]) for row in rows]
    data = {
        "t": rounded(times[rows]), "shown": shown, "eye": rounded(eyes), "ring": 0.03 * half,
        "pose": rounded(relative[rows] * [1.0, 1.0, 180.0 / math.pi]), "dot": rounded(dots),
        "contacts": [rounded(each) for each in contacts],
        "words": [
            f"t = {times[row] * factor:.4g} {unit}, d_c = {distance[row]:.4g} µm" for row in rows
        ],
    }  # fmt: skip
    bodies = drawing_of(shapes, data, half, shown)
    return (
        f"<figure class='motion' data-frames='{text(json.dumps(data, ensure_ascii=False))}'>"
        f"<figcaption>{heading}</figcaption>\n<div class='panels'>{bodies}{graph}</div>"
        "<div class='controls'><button type='button'>Play</button>"
        f"<input type='range' min='0' max='{len(rows) - 1}' value='{shown}' aria-label='frame'>"
        f"<output>{text(data['words'][shown])}</output></div></figure>"
    )


def rounded(values):
    """Lists of numbers to 6 digits: what a picture shows of them."""
    return [
        [*rounded(each)] if np.ndim(each) else float(f"{each:.6g}") for each in np.asarray(values)
    ]


def drawing_of(shapes: Sequence, data: dict, half: float, shown: int) -> str:
    """The bodies, as the frame that is shown first has them, with a scale bar."""
    bodies = []
    for shape, colour, (x, y, angle) in zip(
        shapes, BODY_COLOURS, data["pose"][shown], strict=False
    ):
        rings = (MICRO * ring for ring in shape.outline(0.0, 0.0, 0.0))
        path = " ".join("M" + " ".join(f"{u:.5g},{v:.5g}" for u, v in ring) + "Z" for ring in rings)
        bodies.append(
            f"<path class='body' d='{path}' fill='{colour}' fill-opacity='.3' stroke='{colour}' "
            f"fill-rule='evenodd' stroke-width='{0.006 * half:.3g}' "
            f"transform='translate({x},{y}) rotate({angle})'/>"
        )
    circles = "".join(
        f"<circle cx='{x}' cy='{y}' r='{data['ring']:.3g}'/>" for x, y in data["contacts"][shown]
    )
    eye_x, eye_y = data["eye"][shown]
    length = MICRO * rounded_length(0.5 * half / MICRO)
    left, level = -0.94 * half, 0.94 * half
    bar = (
        f"<path d='M{left:.5g},{level:.5g}h{length:.5g}' stroke='#111' "
        f"stroke-width='{0.02 * half:.3g}'/><text x='{left:.5g}' y='{level - 0.03 * half:.5g}' "
        f"font-size='{0.075 * half:.3g}'>{length:g} µm</text>"
    )
    return (
        f"<svg role='img' aria-label='the two flocs' viewBox='{-half:.5g} {-half:.5g} "
        f"{2 * half:.5g} {2 * half:.5g}'><g transform='scale(1,-1)'><g class='view' "
        f"transform='translate({-eye_x},{-eye_y})'>{''.join(bodies)}"
        f"<g class='contacts' fill='none' stroke='{CONTACT_COLOUR}' "
        f"stroke-width='{0.009 * half:.3g}'>{circles}</g></g></g>{bar}</svg>"
    )


def graph_of(times, distance, rows, zone, unit):
    """(SVG of the centre distance against time with D_0, places (f, 2) of its dot)."""
    left, top, right, bottom = GRAPH
    levels = [*distance, zone] if math.isfinite(zone) else list(distance)
    low, high = min(levels), max(levels)
    margin = 0.08 * (high - low) or 1.0
    low, high = low - margin, high + margin
    span = times[-1] - times[0] or 1.0
    x = left + (right - left) * (times - times[0]) / span
    y = bottom - (bottom - top) * (distance - low) / (high - low)
    thin = np.unique(np.concatenate([rows, np.linspace(0, len(times) - 1, 400).astype(int)]))
    line = " ".join(f"{x[k]:.1f},{y[k]:.1f}" for k in thin)
    parts = [
        f"<path d='M{left},{top}V{bottom}H{right}' fill='none' stroke='#555'/>",
        f"<polyline points='{line}' fill='none' stroke='#999' stroke-width='1.5'/>",
    ]
    if math.isfinite(zone):
        level = bottom - (bottom - top) * (zone - low) / (high - low)
        parts.append(
            f"<path d='M{left},{level:.1f}H{right}' stroke='#444' stroke-dasharray='5 3'/>"
            f"<text x='{right}' y='{level - 4:.1f}' text-anchor='end'>D₀ = {zone:.4g} µm</text>"
        )
    for value in ticks_of(low, high):
        at = bottom - (bottom - top) * (value - low) / (high - low)
        parts.append(f"<text x='{left - 5}' y='{at + 4:.1f}' text-anchor='end'>{value:g}</text>"
                     f"<path d='M{left - 3},{at:.1f}h3' stroke='#555'/>")  # fmt: skip
    for value in ticks_of(times[0], times[-1]):
        at = left + (right - left) * (value - times[0]) / span
        parts.append(f"<text x='{at:.1f}' y='{bottom + 16}' text-anchor='middle'>{value:g}</text>"
                     f"<path d='M{at:.1f},{bottom}v3' stroke='#555'/>")  # fmt: skip
    middle = 0.5 * (top + bottom)
    parts += [
        f"<text x='{0.5 * (left + right)}' y='{bottom + 36}' text-anchor='middle'>"
        f"time [{unit}]</text>",
        f"<text transform='translate(12,{middle}) rotate(-90)' text-anchor='middle'>"
        "centre distance [µm]</text>",
        f"<circle class='now' r='4' cx='{x[rows[0]]:.1f}' cy='{y[rows[0]]:.1f}' "
        f"fill='{BODY_COLOURS[0]}'/>",
    ]
    svg = (
        "<svg role='img' aria-label='centre distance against time' viewBox='0 0 320 320' "
        f"font-size='12'>{''.join(parts)}</svg>"
    )
    return svg, np.stack([x[rows], y[rows]], axis=1)


def ticks_of(low, high):
    """Round numbers, three to seven of them, between two."""
    step = rounded_length((high - low) / 3.0) if high > low else 1.0
    return [k * step for k in range(math.ceil(low / step), math.floor(high / step) + 1)]
