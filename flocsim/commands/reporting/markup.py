"""Pieces of HTML, everything that comes from a file escaped; the look and the frame of the page.

The page may load nothing and run nothing but its own script, which its Content-Security-Policy
names by its checksum: what a results file says of itself cannot become code in a browser.
"""

import base64
import hashlib
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from flocsim.errors import visible

STYLE = Path(__file__).with_name("page.css").read_text("utf-8")


def text(value: object) -> str:
    """Any text as HTML shows it: escaped, letters that steer a display written out."""
    return escape(visible(str(value), ""))


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


def picture_of(svg: bytes, caption: str) -> str:
    """An SVG as a picture inside the page, with its caption."""
    data = base64.b64encode(svg).decode()
    return (
        f"<figure><img alt='{text(caption)}' src='data:image/svg+xml;base64,{data}'>"
        f"<figcaption>{text(caption)}</figcaption></figure>"
    )


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
