"""Ensembles of binary collisions: config, scene, sampling, outcomes, statistics, runners."""

from flocsim.ensembles.config.loader import load_config
from flocsim.ensembles.runner import run

__all__ = ["load_config", "run"]
