"""What of a foreign config may be run: whoever made a results file chose what modules it names.

A module is run for such a file only where its source is the one that the file keeps, or where the
user has named the folder of the study: `Sources.module` asks, whichever command reads the file.
"""

import ast
import hashlib
import json
import os
import sys
from collections.abc import Mapping
from importlib.machinery import PathFinder, SourceFileLoader
from itertools import zip_longest
from pathlib import Path
from typing import Any

import attrs

from flocsim.errors import ConfigError
from flocsim.io.json_text import matches, read_json

LONGEST_SOURCE = 2**20
"""Bytes of a module that are kept as text; of longer ones the digest is."""

KEPT = {"digest": str, "source": str}
"""What a file keeps of a module, as a pattern of `flocsim.io.json_text`."""


def digest_of(source: bytes) -> str:
    """A hash of a module's source."""
    return hashlib.blake2b(source, digest_size=16).hexdigest()


def kept_sources(modules: Mapping[str, bytes]) -> str:
    """The modules of a study as JSON, for its results file: {place: {digest, source}}."""
    found = {
        place: {
            "digest": digest_of(source),
            "source": source.decode("utf-8", "replace") if len(source) <= LONGEST_SOURCE else "",
        }
        for place, source in sorted(modules.items())
    }
    return json.dumps(found)


def read_sources(run: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """{place: {digest, source}} of the modules that the group ``run`` keeps; ValueError where it is
    none that flocsim wrote."""
    found = read_json(run["modules"], {}) if "modules" in run else {}
    if not all(matches(each, KEPT) for each in found.values()):
        raise ValueError("run/modules cannot be read: it is of another form")
    return found


@attrs.frozen
class Consent:
    """What may be run of the modules that the config in ``file`` names: those of ``known``
    {place: {digest, source}}, as they are there."""

    file: str
    known: Mapping[str, Mapping[str, str]] = attrs.Factory(dict)

    def check(self, place: str, path: str | os.PathLike, source: bytes) -> None:
        """ConfigError unless the source of a module, in the file ``path``, is the one known."""
        known = self.known.get(place)
        if known is None:
            raise ConfigError(f"{self.file} keeps no source of {path}, {self.advice(path)}")
        if known["digest"] != digest_of(source):
            line = first_difference(known["source"], source.decode("utf-8", "replace"))
            raise ConfigError(
                f"{path} is not what {self.file} was made with{line}, {self.advice(path)}"
            )

    def check_module(self, module: str, name: str, folder: Path) -> None:
        """The same of a module by its name, unless it lies below the ``folder`` of the study: what
        is read there is checked as it is read. Nothing is imported; it has to have the class."""
        path = source_of(module, folder)
        if path is None:
            raise ConfigError(
                f"{self.file} names the module {module!r}, of which no source was found here, "
                f"{self.advice('it')}"
            )
        if path.resolve().is_relative_to(folder.resolve()):
            return
        source = path.read_bytes()
        self.check(module, path, source)
        if name not in names_in(source):
            raise ConfigError(f"{path} has no {name!r}")

    def advice(self, path: str | os.PathLike) -> str:
        """Why it was not run, and how to have it run."""
        return (
            f"and {path} was not run, for whoever made a file chose what modules it names: look at "
            "it, and name the folder of the study to run it (--folder DIR, or flocsim.open(file, "
            'folder="…"))'
        )


def first_difference(kept: str, found: str) -> str:
    """Where two sources begin to differ, in words."""
    lines = zip_longest(kept.splitlines(), found.splitlines())
    number = next((k for k, (one, other) in enumerate(lines, 1) if one != other), 0)
    return f" (from line {number} on)" if kept and number else ""


def source_of(module: str, folder: Path) -> Path | None:
    """Where a module's source lies, below the folder or installed; nothing is imported for it."""
    places, spec, parts = [str(folder.resolve()), *sys.path], None, module.split(".")
    for depth in range(1, len(parts) + 1):
        spec = PathFinder.find_spec(".".join(parts[:depth]), places)
        if spec is None or (depth < len(parts) and not spec.submodule_search_locations):
            return None
        places = list(spec.submodule_search_locations or [])
    if spec is None or type(spec.loader) is not SourceFileLoader:
        return None
    return Path(spec.loader.path)


def names_in(source: bytes) -> set[str]:
    """The names that a module's source binds by class statements and imports at its top level."""
    found: set[str] = set()
    try:
        body = ast.parse(source).body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return found
    for each in body:
        if isinstance(each, ast.ClassDef):
            found.add(each.name)
        elif isinstance(each, ast.Import | ast.ImportFrom):
            found |= {(alias.asname or alias.name).partition(".")[0] for alias in each.names}
    return found
