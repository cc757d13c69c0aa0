"""What a config is made from, each file read once: its text, and the modules of the user's own.

Rank 0 of a job hands its Sources out, so that all ranks run the same text, whatever becomes of the
files meanwhile.

The config that a user runs imports the modules that it names. One that is stored in a file imports
only what the user has allowed (`Allowed`): whoever made the file chose the names in it.
"""

import hashlib
import importlib.abc
import importlib.util
import json
import os
import sys
from collections.abc import Collection, Mapping, Sequence
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

import attrs

from flocsim.ensembles.config.toml_text import read_text_file
from flocsim.errors import ConfigError
from flocsim.io.json_text import matches, read_json
from flocsim.io.seals import held


def digest_of(source: bytes) -> str:
    """Return a hash of a module's source."""
    return hashlib.blake2b(source, digest_size=16).hexdigest()


def kept_sources(modules: Mapping[str, bytes]) -> str:
    """Return the modules of a study as JSON, for its results file: {place: {digest, source}}.

    A record for the user: it permits nothing.
    """
    found = {
        place: {"digest": digest_of(source), "source": source.decode("utf-8", "replace")}
        for place, source in sorted(modules.items())
    }
    return json.dumps(found)


def read_sources(run: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """Return {place: {digest, source}} of the modules that the group ``run`` keeps.

    ValueError where it is none that flocsim wrote.
    """
    found = read_json(run["modules"], {}) if "modules" in run else {}
    if not all(matches(each, {"digest": str, "source": str}) for each in found.values()):
        raise ValueError("run/modules cannot be read: its form is unknown")
    return found


@attrs.frozen
class Allowed:
    """The modules that a config stored in a file may import.

    Those whose files lie in ``folder``, links followed, and those named in ``own``, which are
    imported as by an import statement.
    """

    folder: Path | None = attrs.field(default=None, converter=attrs.converters.optional(Path))
    own: Collection[str] = ()


@attrs.define(eq=False)
class Sources:
    """What has been read: ``config`` is the text of the config file, None before that; ``modules``
    has the bytes of the user's modules by their place, relative to the config's folder, and of
    installed ones by their name; ``libraries`` the shape libraries by their paths, which are to
    stay as they were. ``named``: the modules that configs have named and that were imported.
    ``allowed``: what a stored config may import; None for a config of the user's own."""

    config: str | None = None
    modules: dict[str, bytes] = attrs.Factory(dict)
    libraries: dict[str, str | os.PathLike] = attrs.Factory(dict)
    named: set[str] = attrs.Factory(set)
    allowed: Allowed | None = None

    def library(self, path: Path) -> str | os.PathLike:
        """A shape library's path, held from when it was first named."""
        return self.libraries.setdefault(str(path), held(path))

    def text(self, path: str | os.PathLike) -> str:
        """The text of the config file; ConfigError where it cannot be read."""
        if self.config is None:
            self.config = read_text_file(path)
        return self.config

    def module(self, path: str | os.PathLike, folder: Path) -> bytes:
        """Return the bytes of a module's file, found by way of the config's folder.

        OSError if it is unreadable, ConfigError where a stored config must not import it.
        """
        name = place(path, folder)
        if self.allowed is not None and name.startswith(os.pardir):
            raise ConfigError(f"{path} was not imported: it is a link that leads out of {folder}")
        if name not in self.modules:
            self.modules[name] = Path(path).read_bytes()
        return self.modules[name]


def place(path, folder):
    return os.path.relpath(os.path.realpath(path), os.path.realpath(folder))


RUN: dict[str, tuple[Path, bytes]] = {}
"""Name of a module of the user's own → its file, and what it was when it was run."""


@attrs.define(eq=False)
class Neighbours(importlib.abc.MetaPathFinder):
    """Finds the user's modules in a folder (resolved), and takes their text from Sources."""

    sources: Sources
    folder: Path

    def file_of(self, name: str) -> Path | None:
        """Return the file of a module in the folder, whose packages lie there, too; else None."""
        base = self.folder.joinpath(*name.split("."))
        packages = [each / "__init__.py" for each in base.parents if self.folder in each.parents]
        for file in (base / "__init__.py", base.with_suffix(".py")):
            parts = [each for each in (file, *packages) if not os.path.isfile(each)]
            if all(place(each, self.folder) in self.sources.modules for each in parts):
                return file
        return None

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of a module in the folder; None for all others, which Python finds."""
        file, package = self.file_of(fullname), fullname.rpartition(".")[0]
        # An installed package has its modules to itself.
        if file is None or (package and package not in RUN):
            return None
        loader = SourceLoader(fullname, str(file), self)
        return importlib.util.spec_from_file_location(fullname, file, loader=loader)

    def forget_changed(self) -> None:
        """Drop the user's modules from sys.modules, so that they are run again, if one of them has
        changed or has the name of another one here. Those that stay count as read."""
        here = {name: file for name in RUN if (file := self.file_of(name))}
        read = {name: (file, self.sources.module(file, self.folder)) for name, file in here.items()}
        if any(RUN[name] != found for name, found in read.items()):
            for name in RUN:
                sys.modules.pop(name, None)
            RUN.clear()


class SourceLoader(SourceFileLoader):
    """Runs a module's source, never the compiled file that Python may have kept of an older one:
    it tells versions by a time in whole seconds."""

    def __init__(self, fullname: str, path: str, finder: Neighbours) -> None:
        super().__init__(fullname, path)
        self.finder = finder

    def get_code(self, fullname: str) -> CodeType:
        source = self.finder.sources.module(self.path, self.finder.folder)
        RUN[fullname] = Path(self.path), source
        return compile(source, self.path, "exec", dont_inherit=True)
