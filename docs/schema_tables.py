"""Write the tables of docs/config.md and docs/results.md from the schemas, docs/commands.md from
the parser, docs/glossary.md from the words of the report.

This is a hook of mkdocs: each line `<!-- from the schema: NAME -->` of a page becomes the part of
this name. `python docs/schema_tables.py config` prints the page as Markdown, with its tables.
"""

import argparse
import ast
import inspect
import itertools
import re
import sys
import textwrap
import tomllib
from collections.abc import Mapping
from pathlib import Path

import attrs

import flocsim
from flocsim.__main__ import make_parser
from flocsim.ensembles.config import SCENE_WORDS
from flocsim.ensembles.config.schema import FORCES, SCENES, STUDY_KEYS, TABLES, Config, keys_of
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
    "": SCENES["binary"],
    **{f" of a {word}": SCENES[word] for word in SCENE_WORDS},
    " of a kernel study": SCENES["kernel"],
}

MARK = re.compile(r"<!-- from the schema: (.*) -->")
"""A line that a part of the schema replaces."""

QUOTED_WORD = re.compile(r"['\"]([^\W\d][\w-]*)['\"]")


def config_parts() -> dict[str, str]:
    """{name: text} of all that docs/config.md has of the schema: the keys, and the presets."""
    parts = ["## At the top\n", key_table(Config, STUDY_KEYS)]
    for name, table_class in (TABLES | FORCES_BY_TABLE).items():
        scenes = SCENE_HEADINGS if name == "scene" else {"": table_class}
        for heading, each in scenes.items():
            keys = keys_of(each)
            if heading == " of a kernel study":  # what it inherits is said above
                keys = {key: keys[key] for key in vars(each)["__annotations__"] if key in keys}
            parts += [f"## [{name}]{heading}\n", about(each, name), key_table(each, keys)]
    presets = Path(inspect.getfile(Config)).with_name("presets.toml").read_text("utf-8")
    return {"keys": "\n".join(parts), "presets": f"```text\n{presets}```"}


def about(documented, name):
    """The docstring as Markdown, without the name of the table that is in the heading."""
    text = inspect.getdoc(documented).removeprefix(f"[{name}]: ").replace("``", "`")
    # Of the sections of a numpydoc docstring, exceptions are for those who write Python.
    summary, *rest = re.split(r"\n+(\w+)\n-{3,}\n", text)
    sections = dict(zip(rest[::2], rest[1::2], strict=True))
    entries = [each.split("\n") for each in re.split(r"\n(?=\S)", sections.get("Parameters", ""))]
    meanings = [f"- `{head.partition(' :')[0]}`: {' '.join(map(str.strip, lines))}"
                for head, *lines in entries if lines]  # fmt: skip
    text = "\n\n".join(filter(None, [summary, "\n".join(meanings), sections.get("Notes")]))
    return text[0].upper() + text[1:] + "\n"


def help_of(some_class):
    """{name: text} of the docstrings below the attributes of a class and its bases."""
    found = {}
    for each in [each for each in reversed(some_class.__mro__) if attrs.has(each)]:
        body = ast.parse(textwrap.dedent(inspect.getsource(each))).body[0].body
        for node, after in itertools.pairwise(body):
            if isinstance(node, ast.AnnAssign) and isinstance(after, ast.Expr):
                found[node.target.id] = " ".join(str(after.value.value).split()).removesuffix(".")
    return found


def key_table(some_class, keys):
    helps = help_of(some_class)
    rows = [
        [f"`{key}`", takes(field), default_of(field), meaning(field, helps)]
        for key, field in keys.items()
    ]
    return markdown_table(["key", "takes", "default", "meaning"], rows) + "\n"


def meaning(field, helps):
    """What a key means, and with which other key it applies."""
    text = field.metadata.get("help") or helps.get(field.name, "")
    if "only_for" not in field.metadata:
        return text
    other, words, _ = field.metadata["only_for"]
    return f"{text}; only with {other} = {' or '.join(f'`{as_toml(word)}`' for word in words)}"


def takes(field):
    if "own" in field.metadata:
        return '`"module:Class"`'
    reader = field.metadata["reader"]
    words = QUOTED_WORD.sub(r'`"\1"`', reader.allowed)
    words = "`true` or `false`" if words == "true or false" else words
    return f"{words} [{reader.unit}]" if reader.unit else words


def default_of(field):
    usual = as_toml(field.metadata.get("usual", field.default))
    shown = field.metadata.get("shown") or usual
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


def command_parts() -> dict[str, str]:
    """Return {"commands": the help of every command} for docs/commands.md."""
    return {"commands": "\n\n".join(helps(make_parser()))}


def helps(parser):
    """Yield heading and help of every command below a parser, those with commands of their own
    left out."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from helps(command)
            return
    yield f"## {parser.prog}\n\n```text\n{parser.format_help()}```"


def with_parts(page: str, parts: Mapping[str, str]) -> str:
    """Return the page with its parts in the place of the lines ``<!-- from the schema: NAME -->``.

    Raises UsageError unless the page asks for each of the parts once.
    """
    found = MARK.findall(page)
    if sorted(found) != sorted(parts):
        raise UsageError(f"a page of {', '.join(found)} has other parts than {', '.join(parts)}")
    return MARK.sub(lambda match: parts[match[1]].strip(), page)


def glossary_parts() -> dict[str, str]:
    """Return {"words": the table of words} for docs/glossary.md."""
    with (Path(flocsim.__file__).parent / "commands/templates/glossary.toml").open("rb") as file:
        return {"words": markdown_table(["word", "meaning"], tomllib.load(file).items())}


PAGES = {
    "config.md": config_parts, "results.md": results_parts, "commands.md": command_parts,
    "glossary.md": glossary_parts,
}  # fmt: skip
"""Page → what makes its parts."""


def on_page_markdown(markdown, page, **more):
    """Fill in the tables of a page while mkdocs builds the site."""
    made = PAGES.get(page.file.src_uri)
    return with_parts(markdown, made()) if made else markdown


if __name__ == "__main__":
    for name in sys.argv[1:] or ["config", "results", "commands"]:
        print(with_parts((DOCS / f"{name}.md").read_text("utf-8"), PAGES[f"{name}.md"]()))
