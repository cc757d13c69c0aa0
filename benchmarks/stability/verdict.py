"""One case run and judged: right, a typed failure, wrong, not finite, or crashed.

A finished run is held against its reference and, with or without one, against what must hold of any
run: cores apart, impulses kept, energy not grown.
"""

import time
import traceback
from itertools import combinations

import attrs
import numpy as np

from benchmarks.stability.case import ROUND_OFF, ReferenceGaveUpError, distance_of
from benchmarks.stability.families import case_of, family_of
from benchmarks.stability.references import plain_scene
from benchmarks.stability.shapes import outline_gap
from benchmarks.stability.spheres import drag_of
from flocsim.constants import DEEPEST_OVERLAP, STANDARD_GRAVITY
from flocsim.errors import UsageError
from flocsim.forces import Contact, DoubleLayer, Gravity, StokesDrag, VanDerWaals
from flocsim.integrators import Status
from tests.reference.contacts import all_pairs, measure
from tests.reference.shapes import Scene

KINDS = ("right", "stated", "typed", "wrong", "not finite", "crash", "hang")
"""``stated``: less accurate than asked for, but within the error that the result itself states."""

USEFUL = 1e-3
"""An error stated is of use up to this share of the smallest radius."""


@attrs.define
class Verdict:
    """How a case came out. ``error`` and ``allowed`` [m], where a reference has judged."""

    index: int
    family: str
    kind: str = "right"
    detail: str = ""
    status: str = ""
    judged_by: str = "invariants"
    error: float = float("nan")
    allowed: float = float("nan")
    tolerance: float = float("nan")
    estimate: float = float("nan")
    amplification: float = float("nan")
    steps: int = 0
    wall: float = 0.0


def judge(index, tell=lambda stage: None):
    """The Verdict of a case; ``tell`` hears how far it has come."""
    verdict = Verdict(index, family_of(index))
    try:
        case, _ = case_of(index)
        verdict.tolerance = case.tolerance
        tell("running")
        run(case, verdict, tell)
    except Exception as error:
        verdict.kind = "crash"
        line = traceback.extract_tb(error.__traceback__)[-1]
        verdict.detail = f"{type(error).__name__}: {error} ({line.filename}:{line.lineno})"
    return verdict


def run(case, verdict, tell):
    """Run the case and write what came of it into the Verdict."""
    began = time.perf_counter()
    try:
        found = case.run()
    except UsageError as error:
        refused(case, verdict, str(error))
        return
    finally:
        verdict.wall = time.perf_counter() - began
    verdict.status, verdict.steps = found.status.name, found.steps + found.rejected
    verdict.estimate = found.error
    tell("judging")
    if not is_finite(found):
        verdict.kind = "not finite"
    elif case.refused:
        verdict.kind, verdict.detail = "wrong", "too deep a start was not refused"
    elif found.status != Status.FINISHED:
        verdict.kind, verdict.detail = "typed", found.status.name
        compare_depth(case, verdict)
    else:
        finished(case, verdict, found)


def refused(case, verdict, words):
    """A refusal is right where the bodies do start too deep in each other."""
    deep = any(
        outline_gap(a.shape, (*a.position, a.angle), b.shape, (*b.position, b.angle))
        < -DEEPEST_OVERLAP * (1.0 - 1e-9) * (a.shape.radius + b.shape.radius)
        for a, b in combinations(case.bodies, 2)
    )
    verdict.status = "REFUSED"
    verdict.kind, verdict.detail = ("typed", "REFUSED") if deep else ("wrong", f"refused: {words}")


def reference_of(case):
    """The reference's Answer, or None where there is none."""
    try:
        return case.answer(case) if case.answer else None
    except ReferenceGaveUpError:
        return None


def compare_depth(case, verdict):
    """A run that ended as too deep: whether the reference agrees."""
    if verdict.status != Status.TOO_DEEP.name:
        return
    answer = reference_of(case)
    if answer is not None and answer.deepest < 0.9 * DEEPEST_OVERLAP:
        verdict.detail = "TOO_DEEP in doubt"


def finished(case, verdict, found):
    """Hold a finished run against the reference and the invariants."""
    answer = reference_of(case)
    if answer is not None:
        compare(case, verdict, found, answer)
    wrong = complaints(case, found)
    if wrong:
        verdict.kind = "wrong"
        verdict.detail = "; ".join(filter(None, [verdict.detail, *wrong]))


def compare(case, verdict, found, answer):
    """End positions: the error may be 100 tolerances, grown as errors of the start grow."""
    verdict.judged_by = "reference"
    if answer.deepest > 1.01 * DEEPEST_OVERLAP:
        verdict.kind = "wrong"
        verdict.detail = f"an overlap of {answer.deepest:.3g} of r_i + r_j went unseen"
        return
    error = TOLERANCES * case.tolerance + ROUND_OFF * answer.span
    verdict.amplification = answer.amplification
    verdict.allowed = float(error * answer.amplification + 3.0 * answer.uncertainty)
    verdict.error = distance_of(case.bodies, found.position[-1], answer.position)
    if not verdict.error <= verdict.allowed:
        smallest = min(body.shape.equivalent_radius for body in case.bodies)
        stated = verdict.error <= verdict.estimate <= USEFUL * smallest
        verdict.kind = "stated" if stated else "wrong"
        ratio = verdict.error / case.tolerance
        verdict.detail = f"place off by {verdict.error:.3g} m = {ratio:.3g} tolerances"


TOLERANCES = 100.0
"""Errors of so many tolerances are granted."""

ROWS = 40
"""Records looked at for cores that cross."""

SLACK = 1e-5
"""Impulses may be off by this share of what was exchanged …"""

ENERGY_SLACK = 1e-2
"""… and energies by this share of what was turned over."""


def is_finite(found):
    """Whether all numbers of a Trajectory are finite."""
    return bool(np.isfinite(found.position).all() and np.isfinite(found.velocity).all())


def complaints(case, found):
    """What is wrong with a finished run, in words; empty where nothing is."""
    checks = (crossing_cores, impulse_off, turning_off, energy_grown)
    return [words for words in (check(case, found) for check in checks) if words]


def force_of(case, kind):
    """The force of a class, or None."""
    return next((force for force in case.forces if isinstance(force, kind)), None)


def crossing_cores(case, found):
    """Cores that have come nearer than half of r_i + r_j in a record, unnoticed."""
    rows = np.unique(np.linspace(0, len(found.t) - 1, ROWS).astype(int))
    for i, j in combinations(range(len(case.bodies)), 2):
        one, other = case.bodies[i].shape, case.bodies[j].shape
        limit = -DEEPEST_OVERLAP * 1.001 * (one.radius + other.radius)
        for row in rows:
            places = found.position[row]
            if outline_gap(one, places[i], other, places[j]) < limit:
                return f"bodies {i} and {j} are too deep in each other at t = {found.t[row]:.6g} s"
    return ""


def impulse_off(case, found):
    """m Δv + ζ Δx − W t, summed over free bodies, which forces between them cannot change."""
    if any(body.fixed for body in case.bodies):
        return ""
    mass = np.array([body.mass for body in case.bodies])[:, None]
    drag = drags(case)[:, None]
    weight = weights(case)
    moved = found.position[-1, :, :2] - found.position[0, :, :2]
    gained = mass * (found.velocity[-1, :, :2] - found.velocity[0, :, :2])
    pull = np.array([0.0, -weight.sum() * (found.t[-1] - found.t[0])])
    rest = np.abs((gained + drag * moved).sum(axis=0) - pull).max()
    fastest = np.abs(found.velocity[:, :, :2]).max(axis=0)
    scale = np.sum(mass * fastest) + np.sum(drag * np.abs(moved)) + abs(pull[1])
    allowed = SLACK * scale + crawl(case, found) * (drag.sum() + mass.sum() / found.t[-1])
    return f"impulse off by {rest / scale:.2g} of {scale:.3g} N s" if rest > allowed else ""


def crawl(case, found):
    """A path [m] that counts as none: some tolerances, and the round-off of the coordinates."""
    span = np.abs(found.position[:, :, :2]).max()
    return TOLERANCES * case.tolerance + ROUND_OFF * span


def drags(case):
    """6πγ r of every body [N s/m]; zeros without drag."""
    on = float(force_of(case, StokesDrag) is not None)
    radii = [body.shape.equivalent_radius for body in case.bodies]
    return np.array([on * drag_of(case.fluid.viscosity, r) for r in radii])


def weights(case):
    """Weight less buoyancy of every body [N]; zeros without gravity, and for fixed bodies."""
    on = float(force_of(case, Gravity) is not None)
    return np.array(
        [
            0.0 if b.fixed else on * b.buoyant_mass(case.fluid) * STANDARD_GRAVITY
            for b in case.bodies
        ]
    )


def turning_off(case, found):
    """Angular momentum, which contacts alone between free bodies cannot change."""
    if not case.conserves or any(body.fixed for body in case.bodies):
        return ""
    start, end = (angular_momentum(case, found, row) for row in (0, -1))
    mass = np.array([body.mass for body in case.bodies])
    inertia = np.array([body.inertia for body in case.bodies])
    speed = np.abs(found.velocity).max(axis=0)
    push = mass * np.hypot(speed[:, 0], speed[:, 1])
    span = max(body.shape.bounding_radius for body in case.bodies)
    span = max(span, np.abs(found.position[:, :, :2]).max())
    scale = push.sum() * span + np.sum(inertia * speed[:, 2])
    still = crawl(case, found) * (push.sum() + mass.sum() * span / found.t[-1])
    allowed = SLACK * scale + still
    rest = abs(end - start)
    return f"angular momentum off by {rest / scale:.2g} of its scale" if rest > allowed else ""


def angular_momentum(case, found, row):
    """About the origin [kg m²/s]."""
    (x, y, _), (vx, vy, spin) = found.position[row].T, found.velocity[row].T
    mass = np.array([body.mass for body in case.bodies])
    inertia = np.array([body.inertia for body in case.bodies])
    return float(np.sum(mass * (x * vy - y * vx) + inertia * spin))


def energy_grown(case, found):
    """Kinetic, elastic, gravitational and DLVO energy, which may only fall in still water."""
    law = force_of(case, Contact)
    if law is None:
        return ""
    parts = np.array([energies(case, found, row) for row in (0, -1)])
    growth = parts[1].sum() - parts[0].sum()
    turned = parts[0, 0] + parts[0, 1] + np.abs(parts[1, 2:] - parts[0, 2:]).sum()
    # Displacements handed from pair to pair may add their energies up.
    share = ENERGY_SLACK if law.k_t == 0.0 else 1.0
    error = crawl(case, found)
    bend = (np.sqrt(turned) + error * np.sqrt(law.k_n)) ** 2 - turned
    allowed = share * turned + bend + error * strongest_pull(case)
    if growth <= allowed:
        return ""
    return f"energy has grown by {growth:.3g} J, {turned:.3g} J were turned over"


def energies(case, found, row):
    """(kinetic, elastic, gravitational, DLVO) energy [J] of a record."""
    inertia = np.array([(b.mass, b.mass, b.inertia) for b in case.bodies])
    free = np.array([0.0 if body.fixed else 1.0 for body in case.bodies])[:, None]
    kinetic = 0.5 * np.sum(free * inertia * found.velocity[row] ** 2)
    height = np.sum(weights(case) * found.position[row, :, 1])
    law = force_of(case, Contact)
    elastic = elastic_energy(case, found.position[row], law) if law else 0.0
    return kinetic, elastic, height, pair_energy(case, found.position[row])


def elastic_energy(case, places, law):
    """Σ ½ k_n Δ² over the overlapping pairs [J], by the plain model."""
    plain = plain_scene(case)
    scene = Scene(plain.bodies, np.asarray(places), plain.velocities)
    overlap = measure(scene, all_pairs(scene.bodies)).overlap
    return 0.5 * law.k_n * float(np.sum(np.maximum(overlap, 0.0) ** 2))


def pair_energy(case, places):
    """Work [J] that the DLVO forces at surfaces can still do, from their reach inwards."""
    total = 0.0
    for i, j in combinations(range(len(case.bodies)), 2):
        one, other = case.bodies[i].shape, case.bodies[j].shape
        gap = outline_gap(one, places[i], other, places[j])
        radii = one.equivalent_radius, other.equivalent_radius
        reduced = radii[0] * radii[1] / sum(radii)
        total += reduced * (attraction_energy(case, gap) + repulsion_energy(case, gap))
    return total


def attraction_energy(case, gap):
    """∫ of eq. 5 from a gap to its reach, for r* = 1 m."""
    law = force_of(case, VanDerWaals)
    if law is None or gap >= law.reach:
        return 0.0
    d, strength = max(gap, law.d_min), law.hamaker / 6.0
    return -strength * (1.0 / d - 1.0 / law.reach + max(law.d_min - gap, 0.0) / law.d_min**2)


def repulsion_energy(case, gap):
    """∫ of eq. 6 from a gap to its reach, for r* = 1 m."""
    law = force_of(case, DoubleLayer)
    if law is None or gap >= law.reach:
        return 0.0
    decay = np.exp(-law.kappa * max(gap, 0.0)) - np.exp(-law.kappa * law.reach)
    return law.strength * (decay / law.kappa + max(-gap, 0.0))


def strongest_pull(case):
    """The greatest DLVO force of any pair [N]."""
    largest = max(body.shape.equivalent_radius for body in case.bodies)
    attraction, repulsion = force_of(case, VanDerWaals), force_of(case, DoubleLayer)
    pull = attraction.hamaker / (6.0 * attraction.d_min**2) if attraction else 0.0
    return largest * (pull + (repulsion.strength if repulsion else 0.0))
