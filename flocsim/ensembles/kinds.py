"""The kinds of studies: by their scenes."""

from typing import Any

from flocsim.ensembles.config.schema import SCENES, Config
from flocsim.ensembles.config.swarm_scene import SwarmScene
from flocsim.ensembles.kind import Kind, StudyKind
from flocsim.ensembles.pairs import PAIRS
from flocsim.ensembles.strength.survey import STRENGTHS, Bonds
from flocsim.ensembles.swarms.kind import SWARMS

KINDS: dict[type, Kind] = dict.fromkeys(SCENES.values(), PAIRS)
KINDS |= {SwarmScene: SWARMS, Bonds: STRENGTHS}
"""Class of [scene] → its Kind; rates are pairs with other draws and conditions."""


def kind_of(config: Config) -> Kind:
    """The Kind of a config's study."""
    return KINDS[type(config.scene)]


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
