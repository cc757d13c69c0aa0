"""`flocsim report r.h5`: all that a results file holds on one page for a browser.

Everything that comes from a file is escaped, so that it cannot become code in a browser, and the
page may load nothing (Content-Security-Policy in templates/page.html). templates/motion.js draws
the motions, whose data stand on the page, and links words to the glossary.
"""

import argparse
import base64
import io
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import attrs
import numpy as np

from flocsim.commands import add_allowed, add_overwrite, allowed_by
from flocsim.ensembles.config.sources import Allowed
from flocsim.ensembles.contents import Contents, Example, open_kind, text_of
from flocsim.errors import visible
from flocsim.io.files import write_file
from flocsim.io.outputs import check_outputs
from flocsim.io.plots.collision import svg_path
from flocsim.io.plots.style import METADATA, MICRO, add_foot, house_style

TEMPLATES = Path(__file__).with_name("templates")

MOST_FIGURES = 3
"""Of each file; `flocsim plot` draws all."""

MOST_OUTLINES = 12

SHOWN = ("preset", "shapes", "seed", "command", "date", "flocsim_version", "processor")
"""What the page says of how a file was made, by the names in its group ``run``; all else of it is
folded."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Write one HTML page on a file, or on several, that needs no other file: what was found in a
    sentence, figures, a table, motions to watch, and how it was made. Of pairs one replicate of
    each class (A to D) is run again for it.

    results: files that flocsim wrote
    --output FILE.html: page to write (default: r.html for r.h5, in the current folder)
    --no-motion: do not run replicates again: a page without motion and outlines of flocs
    """
    add = parser.add_argument
    add("results", nargs="+")
    add("-o", "--output")
    add("--no-motion", action="store_true")
    add_allowed(parser)
    add_overwrite(parser)


@attrs.frozen(eq=False)
class Part:
    """A file on a page: what it holds, and ``motions`` and ``outlines`` {name: Shape} of flocs."""

    path: str
    kind: Contents
    found: Any
    motions: Sequence[Example] = ()
    outlines: Mapping[str, Any] = attrs.Factory(dict)


def run(args: argparse.Namespace) -> int:
    """Write the page and print its path; returns the exit code."""
    path = Path(args.output or f"{Path(args.results[0]).stem}.html")
    check_outputs([path], args.overwrite, args.results, endings=(".html",))
    parts = [part_of(each, allowed_by(args), not args.no_motion) for each in args.results]
    write_file(path, report_page(parts).encode(), args.overwrite)
    for example in (each for part in parts for each in part.motions if each.reason):
        print(f"{example.heading} not animated: {example.reason}")
    print(path)
    return 0


def part_of(path: str, allowed: Allowed, motion: bool) -> Part:
    """Return the Part of a file; FileError for one that cannot be read."""
    kind, file = open_kind(path)
    found = kind.read(file)
    if not motion:
        return Part(path, kind, found)
    opened = kind.opened(file, allowed)
    return Part(path, kind, found, kind.examples(opened), kind.outlines(opened))


def report_page(parts: Sequence[Part]) -> str:
    """Return the HTML of files; FileError as `text_of` raises it."""
    links, body = {}, []
    for number, part in enumerate(parts):
        name = f"{Path(part.path).name}: " if len(parts) > 1 else ""
        sections = {
            "Figures": figures_of(part),
            "Motion": motions_of(part),
            "Table": table_of(part),
            "How it was made": made_of(part),
        }
        for head, content in sections.items():
            anchor, title = f"{head.split()[0].lower()}{number or ''}", text(f"{name}{head}")
            if content:
                links[anchor] = title
                body.append(f"<section id='{anchor}'><h2>{title}</h2>\n{content}</section>")
    links["words"] = "Words"
    glossary = tomllib.loads((TEMPLATES / "glossary.toml").read_text("utf-8"))
    style, script = ((TEMPLATES / name).read_text("utf-8") for name in ("page.css", "motion.js"))
    return Template((TEMPLATES / "page.html").read_text("utf-8")).substitute(
        title=text(", ".join(f"{part.path}: {part.kind.title}" for part in parts)),
        answers="\n".join(map(answer_of, parts)),
        links="\n".join(f"<a href='#{anchor}'>{title}</a>" for anchor, title in links.items()),
        body="\n".join(body),
        words="\n".join(f"<dt>{text(k)}</dt><dd>{text(v)}</dd>" for k, v in glossary.items()),
        style=style,
        script=script,
    )


def text(value: object) -> str:
    """Return any text as HTML shows it: escaped, letters that steer a display written out."""
    return escape(visible(str(value), ""))


def verbatim(words: str) -> str:
    """Return lines as they are."""
    lines = "\n".join(map(text, words.splitlines()))
    return f"<pre>{lines}</pre>"


def answer_of(part: Part) -> str:
    """Return what a file found in a large sentence, of which flocs and water, and its warnings."""
    kind, found = part.kind, part.found
    answer = kind.answer(found) or f"{kind.title[0].upper()}{kind.title[1:]}"
    lines = {
        "file": [f"{part.path}: {kind.title}"],
        # What belongs together stays in one line.
        "answer": [answer.replace(" %", "\u00a0%").replace(" = ", "\u00a0=\u00a0")],
        "setting": [kind.setting(found)],
        "source": filter(None, [kind.mark(found), kind.source(found)]),
        "warning": kind.summary(found).warnings,
    }
    found = {name: "<br>".join(map(text, words)) for name, words in lines.items()}
    tags = {"answer": "h1"}
    return "\n".join(
        f"<{tags.get(name, 'p')} class='{name}'>{words}</{tags.get(name, 'p')}>"
        for name, words in found.items()
        if words
    )


def figures_of(part: Part) -> str:
    """Return the most telling figures."""
    figures, foot = part.kind.figures(part.found), part.kind.source(part.found)
    names = [name for name in dict.fromkeys([*part.kind.first, *figures]) if name in figures]
    drawn = (figure_of(name, figures[name], part.found, foot) for name in names[:MOST_FIGURES])
    return "\n".join(drawn)


def figure_of(name: str, draw: Any, results: Any, foot: str) -> str:
    """Return a figure of `flocsim plot` inside the page, its caption being the help of it.

    On a narrow page it keeps four fifths of its size, to be readable, and scrolls in its box.
    """
    picture = io.BytesIO()
    with house_style():
        figure = draw(results)
        add_foot(figure, foot)
        figure.savefig(picture, format="svg", metadata=METADATA["svg"])
    caption = f"Figure {name}: " * name.isdigit() + (draw.__doc__ or "").partition("\n")[0]
    data, wide = base64.b64encode(picture.getvalue()).decode(), 96 * figure.bbox.width / figure.dpi
    return (
        f"<figure><div class='scroll'><div class='paper'><img alt='{text(caption)}' "
        f"style='width:{1.3 * wide:.0f}px;max-width:100%;min-width:{0.8 * wide:.0f}px' "
        f"src='data:image/svg+xml;base64,{data}'></div></div>"
        f"<figcaption>{text(caption)}</figcaption></figure>"
    )


def motions_of(part: Part) -> str:
    """Return the motions of a file, which the script draws, and how they were chosen."""
    shown = []
    for each in part.motions:
        data = text(json.dumps(each.data, ensure_ascii=False)) if each.data else ""
        why = f"<br>Not shown in motion: {text(each.reason)}" if each.reason else ""
        shown.append(
            f"<figure class='motion' data-frames='{data}'><figcaption><b>{text(each.heading)}</b>"
            f"<br>{text(each.title)}{why}</figcaption></figure>"
        )
    chosen = text(part.kind.on_examples)
    return f"<p>{chosen}</p>\n<div class='motions'>{''.join(shown)}</div>" if shown else ""


def table_of(part: Part) -> str:
    """Return the numbers of a file as a table that scrolls in its own box, or as text.

    An interval is set smaller than its value.
    """
    heads, *rows = part.kind.rows(part.found) or [[]]
    if not heads:
        plain = part.kind.table(part.found)
        return plain and verbatim(plain)
    lines = [f"<thead><tr>{''.join(f'<th>{text(head)}</th>' for head in heads)}</tr></thead>"]
    for row in rows:
        cells = (re.sub(r"(\[.*\])$", r"<small>\1</small>", text(cell)) for cell in row)
        lines.append(f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>")
    body = "\n".join(lines)
    note = "<p class='source'>In brackets: 95 % intervals of sampling.</p>" * ("<small>" in body)
    return f"<div class='scroll'><table>{body}</table></div>{note}"


def made_of(part: Part) -> str:
    """Return how a file was made: its preset, flocs and command; all that `flocsim info`
    prints is folded."""
    run = getattr(part.found, "run", {})
    facts = "\n".join(
        f"<dt>{text(name.replace('_', ' '))}</dt><dd>{text(run[name])}</dd>"
        for name in SHOWN
        if run.get(name, "") != ""
    )
    info = text_of(part.path, part.kind, part.found)
    return (
        f"<dl class='facts'>{facts}</dl>\n{thumbnails(part.outlines)}\n"
        f"<details><summary>All that flocsim info prints</summary>\n{verbatim(info)}</details>"
    )


def thumbnails(shapes: Mapping[str, Any]) -> str:
    """Return outlines of flocs, from the smallest to the largest, each to fill its box."""
    names = sorted(shapes, key=lambda name: shapes[name].equivalent_radius)
    places = np.linspace(0, len(names) - 1, min(MOST_OUTLINES, len(names))).round().astype(int)
    pictures = []
    for name in (names[place] for place in places):
        shape, reach = shapes[name], 1.05 * MICRO * shapes[name].bounding_radius
        pictures.append(
            f"<figure><svg viewBox='{-reach:.5g} {-reach:.5g} {2 * reach:.5g} {2 * reach:.5g}'>"
            f"<path transform='scale(1,-1)' fill-rule='evenodd' fill='currentColor' "
            f"d='{svg_path(shape.outline(0.0, 0.0, 0.0))}'/></svg>"
            f"<figcaption>{text(name)}</figcaption></figure>"
        )
    few = f"<p class='source'>{len(places)} of {len(names)} flocs, from small to large.</p>"
    return f"<div class='flocs'>{''.join(pictures)}</div>{few}" if pictures else ""
