"""The kinds of studies: by their scenes."""

from functools import cache
from typing import Any

from flocsim.ensembles.config.kinds import STUDIES
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.kind import Kind, StudyKind


@cache
def kinds() -> dict[type, Kind]:
    """Class of [scene] → its Kind; rates are pairs with other draws and conditions."""
    found = [folder.part("kind").KIND for folder in STUDIES.values()]
    return {scene: each for each in found for scene in each.scenes}


def kind_of(config: Config) -> Kind:
    """The Kind of a config's study."""
    return kinds()[type(config.scene)]


def study_of(config: Config, flocs: list | None = None, methods: dict | None = None) -> StudyKind:
    """The study of a config of any kind; ``flocs`` are grown or read unless given."""
    study: Any = kind_of(config).make(config, flocs, methods)
    return study


def flocs_of(config: Config) -> list:
    """The flocs that a config's study needs, grown or read."""
    return kind_of(config).flocs(config)


def identity_of(study: StudyKind, machine: dict | None = None) -> dict:
    """{name: text or number} of all that the rows of a study follow from."""
    return kind_of(study.config).identity(study, machine)
