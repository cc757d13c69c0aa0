"""What a study of swarms would do, without doing it."""

import attrs
import numpy as np

from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.swarms.study import SwarmStudy
from flocsim.explain import force_lines, scale_lines
from flocsim.io.terminal import duration
from flocsim.plausibility.reynolds import settled
from flocsim.swarms.swarm import Swarm
from flocsim.system import System

BODY_BYTES = 8 * 6 + 4
"""Bytes of a body in a snapshot."""


def dry_run(config: Config, ranks: int) -> str:
    """All that is known of a study before it is run."""
    study = SwarmStudy(config)
    scene = study.scene
    swarm, drawn, (width, height) = study.swarm(0)
    radii = 1e6 * np.array([shape.equivalent_radius for shape in drawn.shapes])
    area = sum(shape.area for shape in drawn.shapes)
    method, moments = config.integrator.method, len(study.stops)
    pair = largest_pair(swarm)
    largest = settled(pair, pair.bodies[0])
    repeats = {"xy": "along x and y", "x": "along x", "none": "along no axis"}[scene.periodic]
    size = config.replicates * moments * len(swarm.bodies) * BODY_BYTES
    speed = ""
    if largest is not None:
        speed = (
            f", {1e3 * largest.speed:.4g} mm/s alone for the largest, of Re = "
            f"{largest.reynolds:.2g}, St = {largest.stokes:.2g}"
        )
    sizes = "measured" if scene.is_measured else f"lognormal, ln r_eq of sd {scene.spread:g}"
    lines = [
        f"{config.replicates} swarms of {scene.number} bodies, N = {study.vertices}, seed "
        f"{config.seed}, on {ranks} rank{'s' * (ranks != 1)}, results in {config.output.file}",
        f"  r_eq {radii.min():.4g} to {radii.max():.4g} um, "
        f"median {np.median(radii):.4g} ({sizes})",
        f"  box {1e6 * width:.5g} x {1e6 * height:.5g} um, repeats itself {repeats}"
        f"{', with a floor' if scene.floor else ''}; bodies cover {area / (width * height):.4f}",
        f"  {scene.duration:g} s{speed}",
        f"  {moments} snapshots, one in {scene.interval:g} s; a state to go on from every "
        f"{duration(scene.checkpoint)}; results file about {size / 1e6:.3g} MB",
        *([f"  {words}"] if (words := config.fluid.words) else []),
        f"  integrator: {config.integrator.label}, tolerance {method.tolerance:g} m",
        "forces:",
        *(f"  {line}" for line in force_lines(pair)),
        "stiffness, of the two largest:",
        *(f"  {line}" for line in scale_lines(pair)),
        "nothing was run (--dry-run)",
    ]
    return "\n".join(lines)


def largest_pair(swarm: Swarm) -> System:
    """A System of the two largest bodies, for what is said of a swarm."""
    bodies = sorted((body for body in swarm.bodies if not body.fixed),
                    key=lambda body: -body.shape.equivalent_radius)[:2]  # fmt: skip
    return attrs.evolve(swarm.system, bodies=bodies)
