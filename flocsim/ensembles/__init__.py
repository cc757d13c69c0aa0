"""Ensembles of binary collisions: config, scene, sampling, outcomes, statistics, runners."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flocsim.ensembles.config.loader import load_config
    from flocsim.ensembles.runner import run

HOMES = {"load_config": "config.loader", "run": "runner"}
"""Public name → module, loaded when asked for: most commands need neither."""

__all__ = ["load_config", "run"]


def __getattr__(name: str) -> Any:
    if name not in HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{HOMES[name]}"), name)
