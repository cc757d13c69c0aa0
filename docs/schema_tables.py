"""What the schemas say of config and results files, in docs/config.md and docs/results.md.

`python docs/schema_tables.py` makes those parts of both pages anew that stand between
`<!-- of the schema: NAME -->` and `<!-- end -->`.
"""

import inspect
import re
from collections.abc import Mapping
from pathlib import Path

from flocsim.ensembles.config import SCENE_WORDS, presets
from flocsim.ensembles.config.pair_scene import PAIR_SCENES
from flocsim.ensembles.config.presets import PRESETS
from flocsim.ensembles.config.schema import FORCES, SCENES, STUDY_KEYS, TABLES, keys_of
from flocsim.errors import UsageError
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
from flocsim.io.terminal import markdown_table

DOCS = Path(__file__).parent

FORCES_BY_TABLE = {f"forces.{name}": force for name, force in FORCES.items()}

SCENE_HEADINGS = {
    "": SCENES["settling"],
    " in a flow": SCENES["shear"],
    " in thermal motion": SCENES["brownian"],
    **{f" of a {word}": SCENES[word] for word in SCENE_WORDS},
    " of a kernel study": SCENES["kernel"],
}

QUOTED_WORD = re.compile(r"['\"]([^\W\d][\w-]*)['\"]")


def config_parts() -> dict[str, str]:
    """{name: text} of all that docs/config.md has of the schema: the keys, and the presets."""
    parts = ["## At the top\n", key_table(STUDY_KEYS)]
    first = keys_of(SCENES["settling"])
    for name, table_class in (TABLES | FORCES_BY_TABLE).items():
        scenes = SCENE_HEADINGS if name == "scene" else {"": table_class}
        for heading, each in scenes.items():
            keys = keys_of(each)
            if each in PAIR_SCENES.values():  # what is as in [scene] itself need not be said again
                known = first if heading else {}
                keys = {key: field for key, field in keys.items() if field != known.get(key)}
            parts += [f"## [{name}]{heading}\n", about(each, name), key_table(keys)]
    return {"keys": "\n".join(parts), "presets": f"{about(presets, '')}\n{preset_table()}"}


def about(documented, name):
    """The docstring as Markdown, without the name of the table that is in the heading."""
    text = inspect.getdoc(documented).removeprefix(f"[{name}]: ").replace("``", "`")
    return text[0].upper() + text[1:] + "\n"


def key_table(keys):
    rows = [
        [f"`{key}`", takes(field), default_of(field), field.metadata.get("help", "")]
        for key, field in keys.items()
    ]
    return markdown_table(["key", "takes", "default", "meaning"], rows) + "\n"


def takes(field):
    metadata = field.metadata
    if metadata.get("flag"):
        return "`true` or `false`"
    words = metadata.get("allowed") or f"a list of {metadata['vector']} numbers"
    words = QUOTED_WORD.sub(r'`"\1"`', words)
    return f"{words} [{metadata['unit']}]" if metadata.get("unit") else words


def default_of(field):
    shown = field.metadata.get("shown") or as_toml(field.default)
    return shown if shown == "none" else f"`{shown}`"


def as_toml(value):
    """A value as TOML writes it; "none" for one that may be left out."""
    if value is None:
        return "none"
    if isinstance(value, tuple):
        return "[" + ", ".join(as_toml(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)


def preset_table():
    """Every value of every preset; empty where it does not give a key, "on" for a bare table."""
    columns = [
        {key: "on" if value == {} else as_toml(value) for key, value in flat(preset)}
        for preset in PRESETS.values()
    ]
    keys = list(dict.fromkeys(key for column in columns for key in column))
    rows = [[f"`{key}`", *(column.get(key, "") for column in columns)] for key in keys]
    return markdown_table(["key", *(f"`{name}`" for name in PRESETS)], rows) + "\n"


def flat(table, around=""):
    """(dotted key, value) of all values in a nested table; an empty table is a value."""
    for key, value in table.items():
        if isinstance(value, dict) and value:
            yield from flat(value, f"{around}{key}.")
        else:
            yield f"{around}{key}", value


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


PAGES = {"config.md": config_parts, "results.md": results_parts}
"""Page → what makes its parts."""

if __name__ == "__main__":
    for name, made in PAGES.items():
        page = DOCS / name
        page.write_text(with_parts(page.read_text("utf-8"), made()), "utf-8")
