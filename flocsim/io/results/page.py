"""The tables of all that a results file holds, from the schema itself, for docs/results.md.

Write them anew with `python -m flocsim.io.results.page docs/results.md`.
"""

import sys

from flocsim.io.markdown import markdown_table, rewrite
from flocsim.io.results.kernel_group import KERNEL
from flocsim.io.results.schema import (
    COORDINATES,
    DIFFERENCES,
    FLAGS,
    POOLED,
    RADII,
    REPLICATES,
    TABLE,
)

ENDS = ("_low", "_high", "_numerical")
"""Ends of the names of bounds."""


def results_parts() -> dict[str, str]:
    """{name: table} of all that docs/results.md has of the schema."""
    groups = {
        "probabilities": TABLE, "pooled": POOLED, "differences": DIFFERENCES,
        "replicates": REPLICATES, "kernel": KERNEL,
    }  # fmt: skip
    axes = [[f"`{name}`", text] for name, (*_, text) in COORDINATES.items()]
    sizes = [[f"`{name}` [m]", text] for name, (*_, text) in RADII.items()]
    return {name: table(schema) for name, schema in groups.items()} | {
        "coordinates": markdown_table(["axis", "meaning"], axes),
        "radii": markdown_table(["coordinate", "meaning"], sizes),
    }


def table(schema):
    """A Markdown table of one group; bounds go with what they bound."""
    rows = []
    for name, (kind, unit, text) in schema.items():
        if not name.endswith(ENDS):
            shown = ", ".join(
                [f"`{name}`", *(f"`{end}`" for end in ENDS if f"{name}{end}" in schema)]
            )
            rows.append([shown, kind, unit, text + codes(name)])
    return markdown_table(["dataset", "type", "unit", "meaning"], rows)


def codes(name):
    if name not in FLAGS:
        return ""
    return ": " + ", ".join(f"{value} {word}" for value, word in zip(*FLAGS[name], strict=True))


if __name__ == "__main__":
    rewrite(sys.argv[1], results_parts())
