"""All keys and presets, from the schema itself, for docs/config.md.

Write them anew with `python -m flocsim.ensembles.config.page docs/config.md`.
"""

import inspect
import re
import sys

from flocsim.ensembles.config import presets
from flocsim.ensembles.config.kernel_scene import KernelScene
from flocsim.ensembles.config.presets import PRESETS
from flocsim.ensembles.config.schema import FORCES, STUDY_KEYS, TABLES, keys_of
from flocsim.ensembles.config.swarm_scene import SwarmScene
from flocsim.io.markdown import markdown_table, rewrite

QUOTED_WORD = re.compile(r"['\"]([^\W\d][\w-]*)['\"]")


def config_parts() -> dict[str, str]:
    """{name: text} of all that docs/config.md has of the schema: the keys, and the presets."""
    parts = ["## At the top\n", key_table(STUDY_KEYS)]
    tables = TABLES | {f"forces.{name}": force for name, force in FORCES.items()}
    kinds = {"a swarm": SwarmScene, "a kernel study": KernelScene}
    for name, table_class in tables.items():
        parts += [f"## [{name}]\n", about(table_class, name), key_table(keys_of(table_class))]
        if name == "scene":
            for kind, scene in kinds.items():
                heading = f"## [scene] of {kind}\n"
                parts += [heading, about(scene, "scene"), key_table(keys_of(scene))]
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


if __name__ == "__main__":
    rewrite(sys.argv[1], config_parts())
