"""What the rows of a study follow from, as a flat table: two runs that agree on it agree on rows.

Seed, scene, bodies, fluid, forces, method, the flocs themselves, how the machine rounds, and the
code: of the compiled kernels (their fingerprint covers bytecode, constants, Python, numba and
numpy) and of the modules that prepare a replicate. How many replicates, which types, N and δ there
are is not part of it, as no row depends on the others.
"""

import functools
import hashlib
import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import attrs
import numpy as np
from numpy.lib.recfunctions import structured_to_unstructured

from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.kind import PHYSICS, StudyKind
from flocsim.geometry.contact.core_points import core_points
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.shapes.spheropolygon import SpheroPolygon, resized

VARIABLE = {
    "scene": {"types", "pairs", "delta", "sizes", "checkpoint"},
    "shapes": {"vertices", "file", "own"},
}
"""Keys that choose rows, but change none."""

PARTIAL = ("flocs.", "types.", "numbers.", "kernels.")
"""Starts of names that need to agree only where both runs have them."""

PACKAGE = Path(__file__).parents[2]


def identity_of(study: StudyKind) -> dict:
    """Return {name: text or number} of all that the rows of a study follow from."""
    tables = ("scene", "shapes", "bodies", "fluid", "zone")
    facts = config_facts(study.config, [each for each in tables if each not in study.scene.without])
    facts |= {"code": physics_digest(names=study.code), "arithmetic": arithmetic_digest()}
    facts |= floc_facts(study.flocs)
    facts |= {name: comparable(value) for name, value in study.identity_facts().items()}
    return json.loads(json.dumps(facts))


def comparable(value):
    """Return a fact as JSON can hold it: a digest of an array, or of a list of shapes."""
    if isinstance(value, list) and value and isinstance(value[0], Shape):
        value = np.concatenate([shape_numbers(each) for each in value])
    return digest(value) if isinstance(value, np.ndarray) else plain(value)


def config_facts(config: Config, tables: Sequence[str]) -> dict:
    """Return what a config of any kind says: these tables, the method, the forces."""
    facts: dict = {"seed": config.seed}
    for table in tables:
        facts |= settings(table, getattr(config, table))
    if config.shapes.own is not None:
        facts |= settings("shapes", config.shapes.own)
        facts["shapes.class"] = config.shapes.label
    facts |= method_facts(config)
    facts["integrator.max_steps"] = config.integrator.max_steps
    for name, force in zip(config.force_names, config.forces, strict=True):
        facts[f"forces.{name}"] = type(force).__qualname__
        facts |= settings(f"forces.{name}", force)
    return facts


def method_facts(config):
    """Return what identifies the integration method."""
    method = config.integrator.method
    facts = settings("integrator", method)
    # A class of the user's own may have these as properties, whose code no kernel reaches.
    for name in ("tolerance", "first_step", "largest_step"):
        facts[f"integrator.{name}"] = plain(getattr(method, name))
    clock, counts = method.fresh_clock(), method.fresh_counts(config.integrator.max_steps)
    starts = [*clock.tolist(), *counts.tolist()]
    facts["start.the integrator"] = digest(np.array(starts, float))
    facts["integrator.name"] = config.integrator.label
    return facts


def settings(table, values):
    """Return the fields of an attrs object under the names of their keys in the config file."""
    return {
        f"{table}.{field.name}": plain(getattr(values, field.name))
        for field in attrs.fields(type(values))
        if field.name not in VARIABLE.get(table, ()) and field.init
    }


def plain(value):
    """Return a value that JSON gives back as it was: floats exactly, infinite ones as words."""
    if isinstance(value, tuple | list):
        return [plain(each) for each in value]
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value if isinstance(value, str | int | float | None) else repr(value)


def floc_facts(flocs):
    """Return digests of all flocs at each number of vertices, and of what chooses among them."""
    every = [each for floc in flocs for each in (floc, *floc.band.values())]
    if not every:
        return {}
    facts = {"flocs.any": digest(np.array([(f.ratio, f.size or 0.0, f.weight) for f in every]))}
    for n in sorted({n for floc in every for n in floc.shapes}):
        of_n = [each for each in every if n in each.shapes]
        errors = np.array([each.errors.get(n, 0.0) for each in of_n])
        numbers = [shape_numbers(each.shapes[n]) for each in of_n]
        facts[f"flocs.{n}"] = digest(np.concatenate([errors, *numbers]))
    return facts


def shape_numbers(shape):
    """Return all numbers that bodies, laws and starts read of a shape."""
    numbers = (
        shape.radius, shape.area, shape.second_moment, shape.equivalent_radius,
        shape.bounding_radius,
    )  # fmt: skip
    rings = structured_to_unstructured(core_points(shape)) if shape.is_compound else ()
    placed = [shape.placed_vertices(angle=angle) for angle in SAMPLE_ANGLES]
    return np.concatenate(
        [np.ravel(shape.vertices), *map(np.ravel, placed), numbers, np.ravel(rings)]
    )


SAMPLE_ANGLES = (0.0, 1.0, 4.0)
"""Angles [rad] at which a shape is placed for the identity."""


@functools.cache
def arithmetic_digest():
    """Return a hash of how this machine rounds sin, exp and their like, and what is made of them.

    numpy, its linear algebra and the C library choose their code by the processor: on another kind
    of it rows differ in their last digits, and so do the flocs.
    """
    rng = np.random.Generator(np.random.Philox(1))
    x, y, z = rng.uniform(0.0, 20.0, SAMPLES), rng.uniform(0.01, 3.0, SAMPLES), rng.random(SAMPLES)
    pairs = list(zip(x.tolist(), y.tolist(), strict=True))
    one = (math.sin, math.cos, math.tan, math.exp, math.expm1, math.atan)
    two = (math.hypot, math.atan2, math.pow, lambda a, b: math.log(b))
    found = [
        *(each(x) for each in (np.sin, np.cos, np.tan, np.exp, np.expm1)),
        np.log(y), np.arccos(z), np.hypot(x, y), np.arctan2(x, y), np.power(y, x),
        *(np.array([each(a) for a, _ in pairs]) for each in one),
        *(np.array([each(a, b) for a, b in pairs]) for each in two),
        *(np.linalg.solve(m, [1.0, 0.3]) for m in y[:400].reshape(-1, 2, 2)),
        np.einsum("ij,ij->i", x.reshape(-1, 2), z.reshape(-1, 2)),
        *map(star_numbers, (3, 16, 64)),
    ]  # fmt: skip
    return digest(np.concatenate(found))


SAMPLES = 4000
"""At so many places functions are looked at: some differ at one in a thousand."""


def star_numbers(points):
    """Return the numbers of a star of so many points, made into a body as flocs are."""
    turn = 2.0 * np.pi * np.arange(points) / points
    rays = 5.0 + np.sin(3.0 * turn + 0.4)
    star = SpheroPolygon(np.column_stack([rays * np.cos(turn), rays * np.sin(turn)]), 0.3)
    body = resized(star, 1.641e-5, 1e-6)
    return shape_numbers(body)


def physics_digest(root: Path = PACKAGE, names: Sequence[str] = PHYSICS) -> str:
    """Return a hash of the modules that decide what is in a row."""
    found = hashlib.blake2b(digest_size=16)
    for path in physics_files(root, names):
        found.update(hashlib.blake2b(path.read_bytes()).digest())
    return found.hexdigest()


def physics_files(root: Path = PACKAGE, names: Sequence[str] = PHYSICS) -> Iterator[Path]:
    """Yield the files of PHYSICS in the package's folder, in an order that is always the same."""
    for name in names:
        place = root / name
        yield from sorted(place.rglob("*.py")) if place.is_dir() else [place]


def digest(array):
    return hashlib.blake2b(np.ascontiguousarray(array).tobytes(), digest_size=16).hexdigest()


def short(identity: dict) -> str:
    text = json.dumps(identity, sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=8).hexdigest()


def differences(stored: dict, current: dict) -> list[str]:
    """Return lines on what differs between two identities; none where rows of both agree."""
    apart = [
        name
        for name in sorted(stored.keys() | current.keys())
        if stored.get(name) != current.get(name)
        and (not name.startswith(PARTIAL) or (name in stored and name in current))
    ]
    # What the user has changed; what follows from it is said where there is nothing else.
    lines = [
        f"{name} is {json.dumps(stored.get(name))} in the file, {json.dumps(current.get(name))} now"
        for name in apart if name.partition(".")[0] not in EXPLAINED
    ]  # fmt: skip
    return lines or [
        EXPLAINED[kind].format(rest) for kind, _, rest in (name.partition(".") for name in apart)
    ]


EXPLAINED = {
    "arithmetic": "this machine rounds sin, exp and similar functions differently (another kind "
    "of processor, C library or numpy): resume where the run was begun, or start over",
    "code": "flocsim's own code has changed",
    "flocs": "the flocs with {} vertices have changed",
    "start": "the initial values of {} have changed",
    "numbers": "the parameters of the forces have changed for type {}",
    "kernels": "the compiled code for {} has changed (flocsim, a force or an integrator of your "
    "own, Python, numba or numpy)",
}
"""First part of a name → words in place of two hashes."""
