"""flocsim: when two flocs of real shape meet in water, do they collide, and do they stick?"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flocsim import ensembles as ensembles
    from flocsim import errors as errors
    from flocsim import forces as forces
    from flocsim import geometry as geometry
    from flocsim import hydrodynamics as hydrodynamics
    from flocsim import integrators as integrators
    from flocsim.body import Body, Fluid
    from flocsim.ensembles.contents import compare
    from flocsim.ensembles.contents import open_any as open
    from flocsim.ensembles.pairs.comparison import Comparison
    from flocsim.ensembles.pairs.opened import StudyResults
    from flocsim.ensembles.script_study import Study
    from flocsim.ensembles.swarms.results import SwarmComparison
    from flocsim.ensembles.sweep import sweep
    from flocsim.forces.base import Force
    from flocsim.geometry.shapes.shape import Shape, Sphere
    from flocsim.geometry.shapes.spheropolygon import Composite, SpheroPolygon
    from flocsim.integrators.base import Integrator, Status
    from flocsim.io.results.kernel_tables import curvilinear_factor
    from flocsim.io.results.swarm_file import SwarmResults
    from flocsim.io.results.sweep_file import SweepResults
    from flocsim.swarms.placement import floor, wall
    from flocsim.swarms.swarm import Swarm, SwarmTrajectory
    from flocsim.system import System
    from flocsim.trajectories.trajectory import State, Trajectory

__version__ = "0.3.0"

HOMES = {
    "Body": "body",
    "Composite": "geometry.shapes.spheropolygon",
    "Fluid": "body",
    "Force": "forces.base",
    "Integrator": "integrators.base",
    "Shape": "geometry.shapes.shape",
    "Sphere": "geometry.shapes.shape",
    "SpheroPolygon": "geometry.shapes.spheropolygon",
    "State": "trajectories.trajectory",
    "Status": "integrators.base",
    "Swarm": "swarms.swarm",
    "SwarmComparison": "ensembles.swarms.results",
    "SwarmResults": "io.results.swarm_file",
    "SwarmTrajectory": "swarms.swarm",
    "Study": "ensembles.script_study",
    "Comparison": "ensembles.pairs.comparison",
    "StudyResults": "ensembles.pairs.opened",
    "SweepResults": "io.results.sweep_file",
    "System": "system",
    "Trajectory": "trajectories.trajectory",
    "compare": "ensembles.contents",
    "curvilinear_factor": "io.results.kernel_tables",
    "floor": "swarms.placement",
    "open": "ensembles.contents:open_any",
    "sweep": "ensembles.sweep",
    "wall": "swarms.placement",
}
"""Public name → module, with a colon what it is called there where that differs. Loaded when asked
for: a job takes over Ctrl-C before it loads any."""

ROOMS = ("ensembles", "errors", "forces", "geometry", "hydrodynamics", "integrators")
"""Packages that are reached without an import of their own: flocsim.forces.Gravity."""

__all__ = [
    "Body",
    "Comparison",
    "Composite",
    "Fluid",
    "Force",
    "Integrator",
    "Shape",
    "Sphere",
    "SpheroPolygon",
    "State",
    "Status",
    "Study",
    "StudyResults",
    "Swarm",
    "SwarmComparison",
    "SwarmResults",
    "SwarmTrajectory",
    "SweepResults",
    "System",
    "Trajectory",
    "__version__",
    "compare",
    "curvilinear_factor",
    "floor",
    "open",
    "sweep",
    "wall",
]


def __getattr__(name: str) -> object:
    if name in ROOMS:
        return importlib.import_module(f"flocsim.{name}")
    if name not in HOMES:
        raise AttributeError(f"module 'flocsim' has no attribute {name!r}")
    home, _, there = HOMES[name].partition(":")
    value = getattr(importlib.import_module(f"flocsim.{home}"), there or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *HOMES, *ROOMS})
