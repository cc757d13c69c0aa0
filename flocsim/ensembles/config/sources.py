"""What a config is made from, each file read once: its text, and the modules of the user's own.

Rank 0 of a job hands its Sources out, so that all ranks run the same text, whatever becomes of the
files meanwhile.
"""

import importlib.abc
import importlib.machinery
import os
from collections.abc import Sequence
from pathlib import Path
from types import CodeType, ModuleType

import attrs

from flocsim.ensembles.config.consent import Consent
from flocsim.ensembles.config.toml_text import read_text_file
from flocsim.errors import ConfigError
from flocsim.io.files import held

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
                f"{spec.origin} has no source to be compared, "
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
