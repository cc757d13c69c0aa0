"""A study's TOML file: its keys, how it is read and checked, and the objects that it makes.

``schema`` declares every table and key; ``pair_scene`` and ``kernel_scene`` declare those of
[scene], with one class for each kind of it; other kinds keep theirs in their own folders (STUDIES
lists all kinds). ``loader`` makes a Config of a file, with the preset under it and ``--set`` over
it, and reports all problems at once, each with its line, which ``toml_text`` finds; ``fields``
reads single values. ``sources`` keeps the text of the file and of the user's modules, and
``own_classes`` finds a user's force, integrator or shape in them. This room may import forces,
integrators, geometry and body, and nothing else of ``ensembles``.

A kind of study is in one file or folder, whose modules are loaded by name when they are needed:
`scene` has the class of its [scene] as SCENE, if that has a `kind` of its own; `study` has what
runs it as KINDS, classes of `flocsim.ensembles.kind.StudyKind`; `results` has what its files hold
as CONTENTS, a `flocsim.ensembles.contents.Contents`.
"""

import importlib
from typing import Any, NamedTuple


class Folder(NamedTuple):
    """The folder of a kind in flocsim/ensembles, or its file if it is in one, and its `[scene]
    kind`, if it has one itself."""

    name: str
    scene: str = ""

    def part(self, module: str) -> Any:
        """Return one of its modules; the only one of a kind in one file."""
        whole = importlib.import_module(f"flocsim.ensembles.{self.name}")
        if not hasattr(whole, "__path__"):
            return whole
        return importlib.import_module(f"flocsim.ensembles.{self.name}.{module}")


STUDIES = {
    "flocsim results": Folder("pairs"),
    "flocsim swarm": Folder("swarms", "swarm"),
}
"""What a results file says that it is → the Folder of the kind."""

FILES = dict.fromkeys(STUDIES, "") | {
    "flocsim strength": "ensembles.strength.contents",
    "flocsim sweep": "ensembles.sweep",
    "flocsim trajectory": "commands.trajectory:TRAJECTORY",
    "flocsim shape library": "commands.shapes:LIBRARY",
}
"""What any file says that it is → the module of its CONTENTS, or of what a colon precedes; that of
a study is in its Folder."""

SCENE_WORDS = tuple(each.scene for each in STUDIES.values() if each.scene)


def scenes() -> dict[str, type]:
    """Return {`[scene] kind`: class of the table} of the kinds that have one of their own."""
    return {each.scene: each.part("scene").SCENE for each in STUDIES.values() if each.scene}


def contents_of(file_format: str) -> Any:
    """Return the Contents of a kind of file, by what such a file says that it is."""
    if file_format in STUDIES:
        return STUDIES[file_format].part("results").CONTENTS
    module, _, name = FILES[file_format].partition(":")
    return getattr(importlib.import_module(f"flocsim.{module}"), name or "CONTENTS")
