"""What the replicates of a swarm study follow from: as `ensembles.storage.identity`, of many
bodies."""

import hashlib
import json

import numpy as np

from flocsim.compiler.fingerprint import fingerprint
from flocsim.ensembles.storage.identity import (
    PHYSICS,
    arithmetic_digest,
    digest,
    physics_digest,
    plain,
    settings,
    shape_numbers,
)
from flocsim.ensembles.suspension.study import SwarmStudy
from flocsim.swarms.islands import run_islands
from flocsim.swarms.swarm import Swarm

CODE = (*PHYSICS, "swarms", "ensembles/suspension/study.py", "ensembles/suspension/replicate.py")
"""The modules that decide what a swarm does."""

LEFT_OUT = ("scene.checkpoint",)
"""Keys that change nothing that is computed."""


def identity_of(study: SwarmStudy, swarm: Swarm) -> dict:
    """{name: text or number} of all that the replicates of a study follow from; ``swarm``: that of
    any of them."""
    config = study.config
    facts = {
        "seed": config.seed, "code": physics_digest(names=CODE), "arithmetic": arithmetic_digest(),
    }  # fmt: skip
    for table in ("scene", "shapes", "bodies", "fluid"):
        facts |= settings(table, getattr(config, table))
    facts["shapes.vertices"] = list(config.shapes.vertices)
    method = config.integrator.method
    facts |= settings("integrator", method)
    facts["integrator.name"] = config.integrator.label
    facts["integrator.max_steps"] = config.integrator.max_steps
    for name in ("tolerance", "first_step", "largest_step"):
        facts[f"integrator.{name}"] = plain(getattr(method, name))
    for name, force in zip(config.force_names, config.forces, strict=True):
        facts[f"forces.{name}"] = type(force).__qualname__
        facts |= settings(f"forces.{name}", force)
    shapes = [floc.shapes.get(study.vertices) for floc in study.flocs]
    numbers = [shape_numbers(shape) for shape in shapes if shape is not None]
    sizes = [[floc.ratio, floc.size or 0.0] for floc in study.flocs]
    facts[f"flocs.{study.vertices}"] = digest(np.concatenate([np.ravel(sizes), *numbers]))
    pieces = swarm.system.pieces
    numbers = [*pieces.parameters, pieces.surface_reach, *pieces.smoothness, pieces.events]
    facts["numbers.the swarm"] = digest(np.array(numbers, float))
    codes = [fingerprint(run_islands, swarm.fillings())]
    codes += [f"{law} {fingerprint(each, {})}" for law, each in sorted(pieces.laws.items())]
    facts["kernels.swarms"] = hashlib.blake2b("\n".join(codes).encode(), digest_size=12).hexdigest()
    for name in (*LEFT_OUT, "shapes.file", "shapes.own"):
        facts.pop(name, None)
    return json.loads(json.dumps(facts))
