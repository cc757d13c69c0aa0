"""A study's TOML file: what may stand in it, how it is read strictly, and the objects it makes.

``schema`` holds every table and key, ``pair_scene`` and ``kernel_scene`` those of [scene], a class
for each kind of it, which other kinds keep in their folders (STUDIES is the table of all);
``loader`` makes a Config of a file. Under it lie ``presets``, over it ``--set``;
``sources`` keeps what was read of files. ``values`` reads one value, and tells all that is wrong at
once, with the lines that ``toml_text`` knows; ``own_classes`` finds a user's force, integrator or
shape. May import forces, integrators, geometry and body, and nothing else of
``ensembles``.

All that a kind of study is lies in one file or folder, whose modules are loaded by name when
something of the kind is there: `scene` has the class of its [scene] as SCENE, where that has a
`kind` of its own; `study` what runs it as KINDS, classes of `flocsim.ensembles.kind.StudyKind`;
`results` what its files hold as CONTENTS, a `flocsim.ensembles.contents.Contents`.
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
