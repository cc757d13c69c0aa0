"""What a config is made from, each file read once: its text, and the modules of the user's own.

Rank 0 of a job hands its Sources out, so that all ranks run the same text, whatever becomes of the
files meanwhile.

Whoever made a results file chose what modules it names. A module is run for such a file only where
its source is the one that the file keeps, or where the user has named the folder of the study:
`Sources.module` asks, whichever command reads the file.
"""

import ast
import hashlib
import importlib.abc
import importlib.machinery
import json
import os
import sys
from collections.abc import Mapping, Sequence
from importlib.machinery import PathFinder, SourceFileLoader
from itertools import zip_longest
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import attrs

from flocsim.ensembles.config.toml_text import read_text_file
from flocsim.errors import ConfigError
from flocsim.io.records import matches, read_json
from flocsim.io.seals import held

LONGEST_SOURCE = 2**20
"""Bytes of a module that are kept as text; of longer ones the digest is."""

KEPT = {"digest": str, "source": str}
"""What a file keeps of a module, as a pattern of `flocsim.io.records`."""


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
        raise ValueError("run/modules cannot be read: its form is unknown")
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
            raise ConfigError(f"{self.file} has no source of {path}, {self.advice(path)}")
        if known["digest"] != digest_of(source):
            line = first_difference(known["source"], source.decode("utf-8", "replace"))
            raise ConfigError(
                f"{path} differs from the one that {self.file} was made with{line}, "
                f"{self.advice(path)}"
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
            f"and {path} was not run, because whoever made the file chose which modules it names: "
            "inspect it, and name the folder of the study to run it (--folder DIR, or "
            "flocsim.open(file, "
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


INSTALLED = ("site-packages", "dist-packages")
"""Folders whose modules are no part of a study, even where they lie below its config."""


@attrs.define(eq=False)
class Sources:
    """What has been read: ``config`` is the text of the config file, None before that; ``modules``
    has the bytes of the user's modules by their place, relative to the config's folder, and of
    installed ones by their name; ``libraries`` the shape libraries by their paths, which are to
    stay as they were. ``consent``: what may be run, where the config is not the user's; None: all
    that it names."""

    config: str | None = None
    modules: dict[str, bytes] = attrs.Factory(dict)
    libraries: dict[str, str | os.PathLike] = attrs.Factory(dict)
    consent: Consent | None = None

    def library(self, path: Path) -> str | os.PathLike:
        """A shape library's path, held from when it was first named."""
        return self.libraries.setdefault(str(path), held(path))

    def text(self, path: str | os.PathLike) -> str:
        """The text of the config file; ConfigError where it cannot be read."""
        if self.config is None:
            self.config = read_text_file(path)
        return self.config

    def has(self, path: Path, folder: Path) -> bool:
        """Whether a module of that file is here, or could be read."""
        return place(path, folder) in self.modules or path.is_file()

    def module(self, path: str | os.PathLike, folder: Path) -> bytes:
        """The bytes of a module's file, below the config's folder or not; OSError if unreadable,
        ConfigError where there is no consent to run it."""
        name = place(path, folder)
        if name not in self.modules:
            found = Path(path).read_bytes()
            if self.consent is not None:
                self.consent.check(name, path, found)
            self.modules[name] = found
        return self.modules[name]


def place(path, folder):
    return os.path.relpath(os.path.realpath(path), os.path.realpath(folder))


@attrs.define(eq=False)
class Neighbours(importlib.abc.MetaPathFinder):
    """Finds what the user's modules import from the config's folder, and takes it from Sources."""

    sources: Sources
    folder: Path

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """The spec of a module below the folder; None for all others, which Python finds."""
        spec = importlib.machinery.PathFinder.find_spec(fullname, path, target)
        if spec is None or not spec.has_location or spec.origin is None:
            return None
        parts = Path(place(spec.origin, self.folder)).parts
        if parts[0] == os.pardir or any(name in parts for name in INSTALLED):
            return None
        if fullname.partition(".")[0] == "flocsim":
            return None
        if type(spec.loader) is not importlib.machinery.SourceFileLoader:
            if self.sources.consent is None:
                return None
            raise ConfigError(
                f"{spec.origin} has no source to compare, "
                f"{self.sources.consent.advice(spec.origin)}"
            )
        spec.loader = SourceLoader(fullname, spec.loader.path, self)
        return spec


class SourceLoader(importlib.machinery.SourceFileLoader):
    """Runs a module's source, never the compiled file that Python may have kept of an older one:
    it tells versions by a time in whole seconds."""

    def __init__(self, fullname: str, path: str, finder: Neighbours) -> None:
        super().__init__(fullname, path)
        self.finder = finder

    def get_code(self, fullname: str) -> CodeType:
        source = self.finder.sources.module(self.path, self.finder.folder)
        return compile(source, self.path, "exec", dont_inherit=True)
