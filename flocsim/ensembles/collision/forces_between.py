"""What acts between the two bodies of a replicate, against time: along the line of centres."""

import numpy as np

from flocsim.ensembles.collision.encounter import Encounter
from flocsim.forces.base import PairForce, told_apart
from flocsim.forces.codegen import laws_of
from flocsim.integrators.rhs.views import pair_view
from flocsim.plausibility.settling import lone_view, no_force

OUTLINES = "contact"
"""Name of what acts at the outlines where that is contact alone."""
SETTLING = "weight and drag"
NAMES = {"VanDerWaals": "van der Waals", "DoubleLayer": "double layer"}
TRUSTED = 1e-2
"""What the balance leaves below this share of all other forces, and below half of their change in
a step, is its own error."""


def outline_name(encounter: Encounter) -> str:
    """The name of what acts at the outlines: contact, and the forces of the surface gap that add up
    with it there, by their names."""
    system = encounter.system
    surface = [
        name
        for name, each in zip(plain_names(system.forces), system.forces, strict=True)
        if isinstance(each, PairForce) and not each.absent and each.acts_on == "surfaces"
    ]
    return " + ".join([OUTLINES, *surface])


def plain_names(forces):
    """What forces are called in a figure, no two alike."""
    classes = [type(each).__name__ for each in forces]
    return told_apart(NAMES.get(each, each) for each in classes)


def geometry(position, velocity, shapes):
    """Per instant: direction from i to j (k, 2), d_c (k,), gap of the spheres, its rate."""
    apart = position[:, 1, :2] - position[:, 0, :2]
    distance = np.hypot(*apart.T)
    direction = apart / distance[:, None]
    rate = np.sum(direction * (velocity[:, 1, :2] - velocity[:, 0, :2]), axis=1)
    return direction, distance, distance - sum(s.equivalent_radius for s in shapes), rate


def centre_forces(encounter, times, geometry):
    """{name: (k,) force [N]}, above 0 where it pushes apart, of every force between the centres."""
    system, (_, distance, gap, rate) = encounter.system, geometry
    found = {}
    for name, force in zip(plain_names(system.forces), system.forces, strict=True):
        pieces = laws_of([force], system.fluid)
        kernel = pieces.laws.get("centre_force")
        if kernel is not None:
            views = (
                pair_view(encounter.scene, *now[:1], 1, 0, *now[1:])
                for now in zip(times, gap, rate, distance, strict=True)
            )
            found[name] = np.array([kernel(v, pieces.parameters) for v in views])
    return found


def settling_force(encounter, velocity, direction):
    """(k,) weight and drag of body j along the line of centres [N]."""
    system = encounter.system
    kernel = system.pieces.laws.get("body_force", no_force)
    body, parameters = system.bodies[1], system.pieces.parameters
    forces = [
        kernel(lone_view(body, system.fluid, *now[:2]), parameters)[:2] for now in velocity[:, 1]
    ]
    return np.sum(direction * np.array(forces), axis=1)


def forces_between(
    encounter: Encounter, times: np.ndarray, position: np.ndarray, velocity: np.ndarray
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(instants (k − 1,) [s], {name: force on body j [N]}), means over the steps of the motion.

    Along the line of centres, above 0 where it pushes apart. What acts at the outlines follows,
    all of it together under the name of `outline_name`, from the balance of momentum, m_j Δv_j/Δt
    less all other forces: exact for a step's mean up to the curvature of those others within a
    step; NaN where no more than that error is left.
    ``times`` (k,) [s], ``position`` and ``velocity`` (k, 2, 3), as Record.arrays has them.
    """
    around = geometry(position, velocity, encounter.shapes)
    named = centre_forces(encounter, times, around)
    named[SETTLING] = settling_force(encounter, velocity, around[0])
    means = {name: 0.5 * (force[1:] + force[:-1]) for name, force in named.items()}
    direction = 0.5 * (around[0][1:] + around[0][:-1])
    change = np.sum(direction * np.diff(velocity[:, 1, :2], axis=0), axis=1)
    lasting = np.diff(times)
    inertia = encounter.system.bodies[1].mass * change / np.where(lasting > 0.0, lasting, np.nan)
    left = inertia - sum(means.values())
    error = TRUSTED * sum(np.abs(each) for each in means.values())
    error += sum(0.5 * np.abs(np.diff(force)) for force in named.values())
    means[outline_name(encounter)] = np.where(np.abs(left) > error, left, np.nan)
    return 0.5 * (times[1:] + times[:-1]), means
