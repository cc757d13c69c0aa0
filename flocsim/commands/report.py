"""`flocsim report r.h5`: all that a results file holds on one page for a browser.

Everything that comes from a file is escaped. The page may load nothing and run nothing but its own
script, which its Content-Security-Policy names by its checksum: what a results file says of itself
cannot become code in a browser.
"""

import argparse
import base64
import hashlib
import io
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from flocsim.commands import FOLDER_HELP
from flocsim.commands.motion import SCRIPT, motion_of, text
from flocsim.ensembles.contents import Contents, Example, Table, overview_of, summary_of
from flocsim.errors import UsageError
from flocsim.io.files import write_file
from flocsim.io.outputs import OVERWRITE_HELP, Output, check_outputs, figure_rule, marked
from flocsim.io.plots.results import MOST_ROWS
from flocsim.io.plots.style import METADATA, house_style
from flocsim.io.seals import held

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


def page_of(title: str, sections: Sequence[tuple[str, str, str]], script: str) -> str:
    """The whole page of (anchor, heading, HTML) sections; ``script`` is the only one that runs."""
    allowed = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; "
        f"script-src 'sha256-{allowed}'"
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
        f"<h1>{text(title)}</h1>\n<nav>{links}</nav>\n{body}\n"
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
    drawn = "\n".join(figure_of(name, figures[name], found) for name in names)
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
    return page_of(f"{path}: {kind.title}", sections, SCRIPT)


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


def figure_of(name: str, draw: Callable[..., Any], results: Any) -> str:
    """A figure of `flocsim plot` inside the page, its caption being the help of it."""
    picture = io.BytesIO()
    with house_style():
        draw(results).savefig(picture, format="svg", metadata=METADATA["svg"])
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
    add("--folder", metavar="DIR", help=FOLDER_HELP)
    add("--overwrite", action="store_true", help=OVERWRITE_HELP)


def run(args: argparse.Namespace) -> int:
    """Write the page and print its path; returns the exit code."""
    path = Path(args.output or f"{Path(args.results).stem}.html")
    if path.suffix.lower() != ".html":
        raise UsageError(f"--output {path}: a page's name must end in .html")
    rule = figure_rule(args.overwrite)
    check_outputs([Output(path, rule)], [args.results])
    source = held(args.results)
    kind, found = overview_of(source)
    examples = [] if args.no_motion else kind.examples(source, args.folder)
    found = kind.with_rows(source, found, MOST_ROWS)
    page = report_page(str(args.results), kind, found, examples)
    write_file(path, marked(page.encode(), ".html"), rule)
    for example in examples:
        if example.reason:
            print(f"class {example.outcome} is not animated: {example.reason}")
    print(path)
    return 0
