"""`flocsim report r.h5`: all that a results file holds on one page for a browser.

Everything that comes from a file is escaped, so that it cannot become code in a browser, and the
page may load nothing (Content-Security-Policy in templates/page.html).

A motion on it is a drawing: SVG outlines that templates/motion.js places, frame by frame. Lengths
in it are µm and y points up. A collision is seen from the receiving body's centroid.
"""

import argparse
import base64
import io
import itertools
import json
import math
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
from flocsim.ensembles.contents import (
    Contents,
    Crowd,
    Example,
    Table,
    open_kind,
    stored_config,
    text_of,
)
from flocsim.errors import FlocsimError, visible
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
    METADATA,
    MICRO,
    Figure,
    add_foot,
    house_style,
)
from flocsim.io.trajectory import centre_distance
from flocsim.trajectories.figures import frames_at, instants_along, seen_from_first
from flocsim.water import ZERO_CELSIUS

TEMPLATES = Path(__file__).with_name("templates")

APPROACH_FRAMES, CONTACT_FRAMES = 50, 100
"""Frames of a collision before its first touch and from then on: contact is what is to be seen."""

BETWEEN = 12
"""Steps from one snapshot of a swarm to the next."""

MOST_THUMBNAILS = 12


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Write one HTML page on a file, or on several, that needs no other file: what they found in a
    sentence, figures, tables, collisions or a swarm to watch, and how they were made. One collision
    of each class (A to D) is run again for it.

    results: files that flocsim wrote
    --output FILE.html: page to write (default: r.html for r.h5, in the current folder)
    --no-motion: do not run replicates again: a page without motion and outlines
    """
    add = parser.add_argument
    add("results", nargs="+")
    add("-o", "--output")
    add("--no-motion", action="store_true")
    add_allowed(parser)
    add_overwrite(parser)


@attrs.frozen(eq=False)
class Part:
    """What the page says of one file: ``examples`` to watch; ``made``: the config, or None, and the
    flocs."""

    path: str
    kind: Contents
    found: Any
    examples: Sequence[Example] = ()
    config: Any = None
    flocs: Sequence[Any] = ()


def run(args: argparse.Namespace) -> int:
    """Write the page and print its path; returns the exit code."""
    path = Path(args.output or f"{Path(args.results[0]).stem}.html")
    check_outputs([path], args.overwrite, args.results, endings=(".html",))
    parts = [part_of(each, allowed_by(args), not args.no_motion) for each in args.results]
    write_file(path, report_page(parts).encode(), args.overwrite)
    for example in itertools.chain.from_iterable(part.examples for part in parts):
        if example.reason:
            print(f"{example.heading} not animated: {example.reason}")
    print(path)
    return 0


def part_of(path: str, allowed: Allowed, motion: bool) -> Part:
    """Return the Part of a file; FileError for one that cannot be read."""
    from flocsim.ensembles.config.loader import load_any_config
    from flocsim.ensembles.kind import flocs_of

    kind, file = open_kind(path)
    part = Part(path, kind, kind.read(file))
    if hasattr(part.found, "run"):
        try:
            part = attrs.evolve(
                part, config=stored_config(path, part.found, allowed, load_any_config)
            )
            part = attrs.evolve(part, flocs=flocs_of(part.config) if motion else ())
        except FlocsimError:
            pass  # The page says without it how the file was made.
    return attrs.evolve(part, examples=kind.examples(file, allowed) if motion else ())


def report_page(parts: Sequence[Part]) -> str:
    """Return the HTML of files; FileError as `text_of` raises it."""
    words = Words(tomllib.loads((TEMPLATES / "glossary.toml").read_text("utf-8")))
    answers, links, body = [], [], []
    for number, part in enumerate(parts):
        mark = f"{number + 1}-" if len(parts) > 1 else ""
        sections = {
            "Figures": figures_of(part, words),
            "Motion": motions_of(part, mark, words),
            "Table": tables_of(part, words),
            "How it was made": made_of(part, words),
        }
        name = f"{Path(part.path).name}: " if mark else ""
        for head, content in sections.items():
            if content:
                anchor = f"{mark}{head.split()[0].lower()}"
                links.append(f"<a href='#{anchor}'>{text(name + head)}</a>")
                body.append(
                    f"<section id='{anchor}'><h2>{text(name + head)}</h2>\n{content}</section>"
                )
        answers.append(answer_of(part, words))
    links.append("<a href='#words'>Words</a>")
    style, script = ((TEMPLATES / name).read_text("utf-8") for name in ("page.css", "motion.js"))
    title = ", ".join(f"{part.path}: {part.kind.title}" for part in parts)
    return Template((TEMPLATES / "page.html").read_text("utf-8")).substitute(
        title=text(title), style=style, script=script, answers="\n".join(answers),
        links="\n".join(links), body="\n".join(body), words=words.definitions(),
    )  # fmt: skip


class Words:
    """Words with a definition, {word: meaning}; several words with one are separated by commas."""

    def __init__(self, meanings: Mapping[str, str]) -> None:
        self.meanings, self.used = dict(meanings), set[str]()
        self.heads = {each: head for head in meanings for each in head.split(", ")}
        # Single letters are linked where they stand alone, as in the head of a column.
        longest = sorted((each for each in self.heads if len(each) > 1), key=len, reverse=True)
        self.pattern = re.compile(rf"(?<![\w\[])({'|'.join(map(re.escape, longest))})(?![\w\]])")

    def linked(self, value: object) -> str:
        """Return a text as `text` does, the first of each word that it has linked."""
        found, seen = text(value), set()

        def link(match: re.Match[str]) -> str:
            head = self.heads[match[0]]
            if head in seen:
                return match[0]
            seen.add(head)
            self.used.add(head)
            return f"<a class='word' href='#{anchor_of(head)}'>{match[0]}</a>"

        return re.sub(".+", link, found) if found in self.heads else self.pattern.sub(link, found)

    def definitions(self) -> str:
        """Return the words that the page has used, and those that these use."""
        told: dict[str, str] = {}
        while missing := self.used - told.keys():
            told |= {head: self.linked(self.meanings[head]) for head in missing}
        return "\n".join(
            f"<div><dt id='{anchor_of(head)}'>{text(head)}</dt><dd>{told[head]}</dd></div>"
            for head in self.meanings if head in told
        )  # fmt: skip


def anchor_of(word: str) -> str:
    """Return the id of a word's definition."""
    return re.sub(r"\W+", "-", f"word {word}").rstrip("-")


def text(value: object) -> str:
    """Return any text as HTML shows it: escaped, letters that steer a display written out."""
    return escape(visible(str(value), ""))


def verbatim(words: str) -> str:
    """Return lines as they are."""
    lines = "\n".join(map(text, words.splitlines()))
    return f"<pre>{lines}</pre>"


def folded(summary: str, content: str) -> str:
    """Return content that is shown on a click."""
    return f"<details><summary>{text(summary)}</summary>\n{content}</details>"


def answer_of(part: Part, words: Words) -> str:
    """Return what a file found in a large sentence, of which flocs and water, and its warnings."""
    kind, found = part.kind, part.found
    answer = kind.answer(found) or f"{kind.title[0].upper()}{kind.title[1:]}"
    # What belongs together stays in one line.
    answer = answer.replace(" %", "\u00a0%").replace(" = ", "\u00a0=\u00a0")
    lines = {
        "file": text(f"{part.path}: {kind.title}"),
        "answer": words.linked(answer),
        "setting": words.linked(kind.setting(found)),
        "source": text(" · ".join(filter(None, [kind.mark(found), kind.source(found)]))),
        "warning": "<br>".join(map(text, kind.summary(found).warnings)),
    }
    return "\n".join(
        f"<{tag} class='{name}'>{line}</{tag}>" for name, line in lines.items()
        for tag in ["h1" if name == "answer" else "p"] if line
    )  # fmt: skip


def figures_of(part: Part, words: Words) -> str:
    """Return the most telling figures, three at most, and the others folded."""
    figures, source = part.kind.figures(part.found), part.kind.source(part.found)
    first = [name for name in (*part.kind.first, *figures) if name in figures]
    order = list(dict.fromkeys(first))
    shown = [figure_of(name, figures[name], part.found, source, words) for name in order]
    more = folded(f"{len(shown) - 3} more figures", "\n".join(shown[3:])) if shown[3:] else ""
    return "\n".join([*shown[:3], more])


def tables_of(part: Part, words: Words) -> str:
    """Return the tables of a file; its text where it has none."""
    tables = part.kind.tables(part.found)
    plain = "" if tables else part.kind.table(part.found)
    return "\n".join(table_of(each, words) for each in tables) or (plain and verbatim(plain))


def table_of(table: Table, words: Words) -> str:
    """Return a table that scrolls in its own box; an interval is set smaller than its value."""
    heads = "".join(f"<th>{words.linked(head)}</th>" for head in table.heads)
    rows = "\n".join(
        "<tr>" + "".join(f"<td>{interval_small(text(cell))}</td>" for cell in row) + "</tr>"
        for row in table.rows
    )
    note = f"<p class='source'>{words.linked(table.note)}</p>" if table.note else ""
    return (
        f"<div class='scroll'><table><thead><tr>{heads}</tr></thead>\n<tbody>{rows}</tbody></table>"
        f"</div>{note}"
    )


def interval_small(cell: str) -> str:
    """Return a cell such as "0.345 [0.301, 0.391]", what is in brackets in small letters."""
    return re.sub(r"\[.*\]$", lambda found: f"<small>{found[0]}</small>", cell)


def made_of(part: Part, words: Words) -> str:
    """Return how a file was made: preset, flocs, water, versions and command; its config and all
    that `flocsim info` prints are folded."""
    run = getattr(part.found, "run", {})
    fluid = getattr(part.config, "fluid", None)
    versions = (name for name in run if name.endswith("_version"))
    facts = {
        "preset": run.get("preset"), "flocs": run.get("shapes"),
        "water": fluid and water_line(fluid), "seed": run.get("seed"),
        "command": run.get("command"), "date": run.get("date"),
        "versions": ", ".join(f"{name.removesuffix('_version')} {run[name]}" for name in versions),
        "machine": run.get("processor"),
    }  # fmt: skip
    told = "\n".join(
        f"<dt>{words.linked(name)}</dt><dd>{text(value)}</dd>" for name, value in facts.items()
        if value not in (None, "")
    )  # fmt: skip
    config = str(run.get("config", ""))
    return "\n".join([
        f"<dl class='facts'>{told}</dl>", thumbnails(part.flocs),
        config and folded("The config file", verbatim(config)),
        folded("All that flocsim info prints", verbatim(text_of(part.path, part.kind, part.found))),
    ])  # fmt: skip


def water_line(fluid: Any) -> str:
    """Return the water of a study in words."""
    known = [
        (fluid.temperature, "{:.3g} °C", lambda kelvin: kelvin - ZERO_CELSIUS),
        (fluid.salinity, "salinity {:g} g/kg", None),
        (fluid.ionic_strength, "ionic strength {:g} mol/m³", None),
        (fluid.viscosity, "viscosity {:.3g} mPa s", lambda value: 1e3 * value),
        (fluid.density, "density {:.4g} kg/m³", None),
    ]
    told = [form.format(scale(value) if scale else value)
            for value, form, scale in known if value is not None]  # fmt: skip
    return ", ".join([*told, "buoyancy" if fluid.buoyancy else "no buoyancy"])


def thumbnails(flocs: Sequence[Any]) -> str:
    """Return outlines of some of the flocs, from the smallest to the largest, each to fill its
    box."""
    ordered = sorted(flocs, key=lambda floc: floc.size or 0.0)
    chosen = np.unique(np.linspace(0, len(flocs) - 1, MOST_THUMBNAILS).round().astype(int))
    pictures = []
    for floc in (ordered[k] for k in chosen if flocs):
        shape = floc.shapes[max(floc.shapes)]
        reach = shape.bounding_radius
        rings = [ring / reach for ring in shape.outline(0.0, 0.0, 0.0)]
        size = f"<br>{MICRO * floc.size:.3g} µm" if floc.size else ""
        pictures.append(
            "<figure><svg viewBox='-1.05 -1.05 2.1 2.1' role='img' aria-label='outline of a floc'>"
            f"<path transform='scale(1,-1)' d='{path_of(rings)}' fill='{BODY_COLOURS[0]}' "
            f"fill-rule='evenodd'/></svg><figcaption>{text(floc.name)}{size}</figcaption></figure>"
        )
    if not pictures:
        return ""
    many = f"{len(pictures)} of {len(flocs)} flocs" if len(pictures) < len(flocs) else "The flocs"
    measured = ", with r_eq" if flocs[0].size else ""
    return f"<div class='flocs'>{''.join(pictures)}</div><p>{many}{measured}.</p>"


def path_of(rings: Sequence[np.ndarray]) -> str:
    """Return the path of rings (k, 2) in an SVG."""
    return " ".join("M" + " ".join(f"{u:.5g},{v:.5g}" for u, v in ring) + "Z" for ring in rings)


def data_of(figure: Figure) -> str:
    """Return a figure as an address that holds all of it."""
    picture = io.BytesIO()
    with house_style():
        figure.savefig(picture, format="svg", metadata=METADATA["svg"])
    return f"data:image/svg+xml;base64,{base64.b64encode(picture.getvalue()).decode()}"


def figure_of(name: str, draw: Any, results: Any, foot: str, words: Words) -> str:
    """Return a figure of `flocsim plot`, its caption being the help of it.

    On a narrow page it keeps four fifths of its size, to be readable, and scrolls in its box.
    """
    with house_style():
        figure = draw(results)
        add_foot(figure, foot)
    caption = f"Figure {name}: " * name.isdigit() + (draw.__doc__ or "").partition("\n")[0]
    picture, wide = data_of(figure), 96.0 * figure.bbox.width / figure.dpi
    size = f"width:{1.3 * wide:.0f}px;max-width:100%;min-width:{0.8 * wide:.0f}px"
    return (
        f"<figure><div class='scroll'><div class='paper'><img alt='{text(caption)}' "
        f"style='{size}' src='{picture}'></div></div>"
        f"<figcaption>{words.linked(caption)}</figcaption></figure>"
    )


def motions_of(part: Part, mark: str, words: Words) -> str:
    """Return all examples of a file and how they were chosen."""
    shown = "\n".join(motion_of(each, f"{mark}{k}", words) for k, each in enumerate(part.examples))
    chosen = words.linked(part.kind.on_examples)
    return shown and f"<p>{chosen}</p>\n<div class='motions'>{shown}</div>"


def motion_of(example: Example, mark: str, words: Words) -> str:
    """Return the HTML of an Example: a drawing that moves, with its controls; or why there is
    none. ``mark`` makes its ids differ from those of others."""
    heading = f"<b>{words.linked(example.heading)}</b><br>{words.linked(example.title)}"
    if example.crowd is not None:
        data, panels = crowd_of(example.crowd, mark)
    elif example.trajectory is not None:
        data, panels = collision_of(example.trajectory, example.zone_distance)
    else:
        return (
            f"<figure class='motion'><figcaption>{heading}<br>Not shown in motion: "
            f"{text(example.reason)}</figcaption></figure>"
        )
    speeds = "".join(
        f"<option value='{speed:g}'{' selected' * (speed == 1)}>{speed:g}×</option>"
        for speed in (0.25, 0.5, 1, 2, 4)
    )
    steps = (len(data["pose"]) - 1) * data["between"]
    return (
        f"<figure class='motion' data-frames='{text(json.dumps(data, ensure_ascii=False))}'>"
        f"<figcaption>{heading}</figcaption>\n<div class='panels'>{panels}</div>"
        "<div class='controls'><button type='button'>Play</button><input type='range' min='0' "
        f"max='{steps}' value='{data['shown'] * data['between']}' aria-label='frame'>"
        f"<select aria-label='speed'>{speeds}</select>"
        f"<output>{text(data['words'][data['shown']])}</output></div></figure>"
    )


def collision_of(run: Any, zone: float) -> tuple[dict, str]:
    """Return (what the script needs of a collision, its bodies and its graph of d_c)."""
    touch, shapes = float(run.row["t_collision"]), run.shapes
    times = contact_times(run, touch)
    frames = frames_at(shapes, times, run.at(times).position, run.position)
    shown = int(np.abs(frames.times - touch).argmin()) if math.isfinite(touch) else 0
    pose = seen_from_first(run.at(times).position) * [MICRO, MICRO, 180.0 / math.pi]
    # The middle of both bodies in every frame, and one half width that fits them all.
    eyes, half = windows(frames.outlines)
    half *= MICRO
    unit, factor = time_unit(run.t)
    graph, dots = graph_of(run, frames, zone, factor)
    data = {
        "shown": shown, "between": 1, "eye": rounded(MICRO * eyes), "ring": 0.03 * half,
        "pose": rounded(pose), "dot": rounded(dots), "t": times.tolist(), "repeats": [0, 0],
        "contacts": [rounded(MICRO * each) for each in frames.contacts], "colour": [],
        "words": [
            f"t = {time * factor:.4g} {unit}, d_c = {MICRO * distance:.4g} µm"
            for time, distance in zip(times, frames.centre_distance, strict=True)
        ],
    }  # fmt: skip
    bodies = "".join(
        body_of(shape.outline(0.0, 0.0, 0.0), "body", colour, 0.3, 0.006 * half)
        for shape, colour in zip(shapes, BODY_COLOURS, strict=False)
    )
    drawing = (
        f"<svg role='img' aria-label='the two flocs' viewBox='{-half:.5g} {-half:.5g} "
        f"{2 * half:.5g} {2 * half:.5g}'><g transform='scale(1,-1)'><g class='view'>{bodies}"
        f"<g class='contacts' fill='none' stroke='{CONTACT_COLOUR}' stroke-width='"
        f"{0.009 * half:.3g}'></g></g></g>{scale_bar(-0.94 * half, 0.94 * half, half)}</svg>"
    )
    return data, drawing + graph


def contact_times(run: Any, touch: float) -> np.ndarray:
    """Return times [s] evenly along the way of the bodies, apart for the approach and what follows
    the touch."""
    sizes = [shape.bounding_radius for shape in run.shapes]
    before = run.t <= touch
    parts = ((before, APPROACH_FRAMES), (~before, CONTACT_FRAMES))
    found = [
        instants_along(run.t[part], run.position[part], sizes, count)
        for part, count in parts if np.count_nonzero(part) > 1
    ]  # fmt: skip
    return np.unique(np.concatenate([run.t[[0, -1]], [touch] * math.isfinite(touch), *found]))


def crowd_of(crowd: Crowd, mark: str) -> tuple[dict, str]:
    """Return (what the script needs of a swarm, its bodies in their box, which repeats itself)."""
    width, height = (MICRO * side for side in crowd.box)
    repeats = [width * ("x" in crowd.periodic), height * ("y" in crowd.periodic)]
    pose = crowd.position * [MICRO, MICRO, 180.0 / math.pi]
    # The eye goes with the mean motion where the box repeats itself, so that it does not hide the
    # motion of bodies against each other.
    mean = np.nanmean(pose[:, ~crowd.walls, :2] - pose[0, ~crowd.walls, :2], axis=1)
    pose[:, ~crowd.walls, :2] -= (mean * (np.array(repeats) > 0.0))[:, np.newaxis]
    colours = sorted({each for row in crowd.colours for each in row})
    data = {
        "shown": len(pose) - 1, "between": BETWEEN, "eye": [], "repeats": repeats,
        "pose": [[body if np.isfinite(body[0]) else None for body in np.round(each, 3).tolist()]
                 for each in pose],
        "colours": colours, "words": list(crowd.words), "t": crowd.times.tolist(),
        "colour": [[colours.index(each) for each in row] for row in crowd.colours],
    }  # fmt: skip
    bodies = "".join(
        body_of(rings, "body wall" if wall else "body", colours[0], 1.0, 0.0015 * width)
        for rings, wall in zip(crowd.outlines, crowd.walls, strict=True)
    )
    # Copies beside the box show what crosses its sides.
    shifts = itertools.product(*((0.0, -side, side) if side else (0.0,) for side in repeats))
    copies = "".join(f"<use href='#crowd{mark}' x='{x:.6g}' y='{y:.6g}'/>"
                     for x, y in shifts if x or y)  # fmt: skip
    return data, (
        f"<svg class='crowd' role='img' aria-label='the swarm' viewBox='0 {-height:.6g} "
        f"{width:.6g} {height:.6g}'>"
        f"<g transform='scale(1,-1)'><g id='crowd{mark}'>{bodies}</g>{copies}</g>"
        f"{scale_bar(0.03 * width, -0.03 * height, 0.5 * width)}</svg>"
    )


def body_of(
    rings: Sequence[np.ndarray], kind: str, colour: str, opacity: float, line: float
) -> str:
    """Return a body's outline about its centroid; the script places it."""
    return (
        f"<path class='{kind}' d='{path_of([MICRO * ring for ring in rings])}' fill='{colour}' "
        f"fill-opacity='{opacity:g}' stroke='{colour if opacity < 1.0 else 'currentColor'}' "
        f"fill-rule='evenodd' stroke-width='{line:.3g}'/>"
    )


def scale_bar(left: float, level: float, half: float) -> str:
    """Return a bar of a round length, near a quarter of a drawing of a half width [µm]."""
    length = MICRO * rounded_length(0.5 * half / MICRO)
    return (
        f"<path d='M{left:.5g},{level:.5g}h{length:.5g}' stroke='currentColor' stroke-width='"
        f"{0.02 * half:.3g}'/><text x='{left:.5g}' y='{level - 0.03 * half:.5g}' "
        f"fill='currentColor' font-size='{0.075 * half:.3g}'>{length:g} µm</text>"
    )


def rounded(values: np.ndarray) -> list:
    """Return lists of numbers to a picometre, or a millionth of a degree."""
    return np.round(values, 6).tolist()


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
        f"<svg class='graph' role='img' aria-label='centre distance against time' "
        f"viewBox='0 0 {width:.6g} {height:.6g}'>"
        f"<image href='{data}' width='{width:.6g}' height='{height:.6g}'/>"
        f"<circle class='now' r='3' fill='{BODY_COLOURS[0]}'/></svg>"
    ), dots
