"""The whole page of a file: what `flocsim info` and `plot` say of it, and motion."""

import io
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from flocsim.commands.reporting.markup import facts_of, list_of, page_of, picture_of, table_of, text
from flocsim.commands.reporting.motion import SCRIPT, motion_of
from flocsim.ensembles.contents import Contents, Example, Table, summary_of
from flocsim.io.plots.style import METADATA, house_style

MOST_FAILURES = 20


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
    sections.append(("figures", "Figures", figures_of(kind.figures(found), found)))
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


def figures_of(figures: Mapping[str, Callable[..., Any]], results: Any) -> str:
    """Figures of `flocsim plot`, outcomes and that of everything first."""
    first = ("outcomes", "overview")
    names = sorted(figures, key=lambda name: first.index(name) if name in first else len(first))
    return "\n".join(figure_of(name, figures[name], results) for name in names)


def figure_of(name: str, draw: Callable[..., Any], results: Any) -> str:
    """A figure of `flocsim plot` inside the page, its caption being the help of it."""
    picture = io.BytesIO()
    with house_style():
        draw(results).savefig(picture, format="svg", metadata=METADATA["svg"])
    title = f"Figure {name}" if name.isdigit() else name.capitalize()
    return picture_of(picture.getvalue(), f"{title}: {(draw.__doc__ or '').partition(chr(10))[0]}")
