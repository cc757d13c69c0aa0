"""Markdown tables, of the pages of docs/ and of the reports of studies and benchmarks."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from flocsim.errors import UsageError


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table as text without a newline at its end; cells are shown by ``str``.

    A bar inside a cell does not end it.
    """
    lines: list[Sequence[object]] = [heads, ["---"] * len(heads), *rows]
    cells = ([str(cell).replace("|", "\\|") for cell in line] for line in lines)
    return "\n".join("| " + " | ".join(line) + " |" for line in cells)


def with_parts(page: str, parts: Mapping[str, str]) -> str:
    """A page with its parts anew: what stands between ``<!-- of the schema: NAME -->`` and
    ``<!-- end -->``. UsageError unless these are the parts that it has."""
    found = re.findall(r"<!-- of the schema: (.*) -->", page)
    if sorted(found) != sorted(parts):
        raise UsageError(f"a page of {', '.join(found)} has other parts than {', '.join(parts)}")
    return re.sub(
        r"(<!-- of the schema: (.*) -->\n\n)[\s\S]*?(\n<!-- end -->)",
        lambda match: f"{match[1]}{parts[match[2]].strip()}\n{match[3]}", page,
    )  # fmt: skip


def rewrite(path: str, parts: Mapping[str, str]) -> None:
    """Write a page of docs/ with its parts anew."""
    page = Path(path)
    page.write_text(with_parts(page.read_text("utf-8"), parts), "utf-8")
