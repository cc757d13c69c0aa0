"""`--dry-run`: describe a study, its duration and its warnings, without running it.

With ``--verbose`` also its collisions, forces and time scales.
"""

import math
from collections.abc import Iterator, Sequence

from flocsim.ensembles.collision.draw import count_checks, exact_method
from flocsim.ensembles.collision.equivalent import measured_flocs, sphere_pairs
from flocsim.ensembles.collision.flocs import Floc
from flocsim.ensembles.collision.pairings import class_facts, pairings_of
from flocsim.ensembles.config.pair_scene import BROWNIAN
from flocsim.ensembles.config.schema import CUT, Config
from flocsim.ensembles.diagnose.pilot import forecast_of
from flocsim.ensembles.diagnose.preflight import study_warnings, warning_lines
from flocsim.ensembles.diagnose.spheres import settling_facts, sphere_facts
from flocsim.ensembles.kind import study_of
from flocsim.errors import plural
from flocsim.explain import force_lines, scale_lines
from flocsim.io.results.run_group import class_words, sphere_words
from flocsim.io.results.schema import OUTCOMES
from flocsim.io.terminal import duration


def dry_run(config: Config, ranks: int, pilot: bool = False, verbose: bool = False) -> str:
    """Return what is known of a study of pairs or rates before it is run, as text.

    ``pilot``: run some replicates, to say how long it takes; ``verbose``: add its collisions, and
    what the engine makes of its forces.
    """
    measured = measured_flocs(config)
    lines = study_lines(config, ranks)
    unknown = "time: not known; --pilot runs replicates for a few seconds to estimate it"
    lines += pilot_lines(config, ranks) if pilot else [unknown]
    lines += warning_lines(study_warnings(config, measured))
    if verbose:
        pairs = list(sphere_pairs(config, measured))
        lines += [
            "collisions:",
            *(f"  {line}" for line in collision_lines(config, measured)),
            "forces:",
            *(f"  {line}" for line in force_lines(pairs[0][1].system)),
            "time scales:",
            *(f"  {name}: {line}" for name, pair in pairs for line in scale_lines(pair.system)),
        ]
    ran = "only the pilot was run" if pilot else "nothing was run"
    more = "" if verbose else "; --verbose shows collisions, forces and time scales"
    return "\n".join([*lines, f"{ran} (--dry-run){more}"])


def study_lines(config: Config, ranks: int) -> list[str]:
    """Return lines on how many replicates there are, of which flocs, by which method."""
    scene, shapes, method = config.scene, config.shapes, config.integrator.method
    count = len(scene.names) * len(shapes.vertices) * len(scene.delta)
    if scene.meeting == BROWNIAN:
        meeting = f"brownian: from {scene.release:g} to {scene.escape:g} (r_i + r_j) apart"
    else:
        offsets = ", ".join(f"{each:g}" for each in scene.delta)
        meeting = f"δ = {offsets} of the {scene.delta_max} δ_max; receiver {scene.receiver}"
    flocs = [f"{shapes.label} {shapes.file or ''}".strip()]
    if shapes.size == "own":
        flocs += ["at their measured sizes and spheroradii"]
        flocs += [f"drawn by {scene.weight}"] if scene.is_measured else []
    elif shapes.own is None:
        flocs += [f"spheroradius {1e6 * shapes.radius:.4g} um"]
    flocs += [f"outlines {shapes.outlines}"] if shapes.outlines != CUT else []
    flocs += ["pairs with similar fit errors"] if shapes.pairs_alike_in == "error" else []
    accuracy = f"tolerance {method.tolerance:g} m" if method.tolerance < math.inf else "fixed step"
    total, vertices = count * config.replicates, ", ".join(map(str, shapes.vertices))
    return [
        f"{plural(total, 'pair')}: {plural(count, 'condition')} of "
        f"{plural(config.replicates, 'replicate')}, seed {config.seed}, "
        f"on {plural(ranks, 'rank')}; results in {config.output.file}",
        f"  conditions: types {', '.join(scene.names)}; N = {vertices}; {meeting}",
        f"  flocs: {', '.join(flocs)}",
        *([f"  {words}"] if (words := config.fluid.words) else []),
        f"  method: {config.integrator.label}, {accuracy}",
        f"  numerical error: {checked_words(config)}",
    ]


def checked_words(config: Config) -> str:
    """Return how many replicates are run again, and by what."""
    exact, share = exact_method(config.integrator.method), config.integrator.check_share
    count = 0 if exact is None else count_checks(config.seed, config.replicates, share)
    if exact is None or not count:
        return "not known, because no replicate is run again (see integrator.check_share)"
    finer = exact.tolerance < math.inf
    how = f"tolerance of {exact.tolerance:g} m" if finer else f"step of {exact.first_step:g} s"
    least = "at least " * (share == "auto")
    return f"from {least}{plural(count, 're-run')} of each condition, with a {how}"


def collision_lines(config: Config, flocs: Sequence[Floc]) -> Iterator[str]:
    """Yield lines on every collision type: sizes, zone, motion of the equivalent spheres."""
    facts, own = settling_facts(config, flocs), config.shapes.size == "own"
    thermal = {each["type"]: each for each in sphere_facts(config, flocs)}
    found = pairings_of(config, flocs)
    if classes := class_words(class_facts(found)):
        yield classes
    for pairing, (name, pair) in zip(found, sphere_pairs(config, flocs), strict=True):
        radius_i, radius_j = (1e6 * shape.equivalent_radius for shape in pair.shapes)
        sizes = f"{name}: r_i = {radius_i:.4g} um, r_j = {radius_j:.4g} um"
        turn = "" if name in thermal else f"; passing time {pair.turn_time:.3g} s"
        yield f"{sizes}, D_0 = {1e6 * pair.zone_distance:.4g} um{turn}"
        if name in thermal:
            yield f"  {sphere_words(thermal[name])}"
        if own:
            spans = (f"{1e6 * low:.4g} to {1e6 * high:.4g} um" for low, high in pairing.spans)
            yield f"  measured sizes, r_i {', r_j '.join(spans)}"
        numbers = [
            f"{each['body']} {1e3 * each['speed']:.4g} mm/s, Re = {each['reynolds']:.2g}, "
            f"St = {each['stokes']:.2g}"
            for each in facts
            if each["type"] == name and each["speed"] > 0.0
        ]
        if numbers:
            yield f"  settling alone{', the largest' * own}: {'; '.join(numbers)}"


def pilot_lines(config: Config, ranks: int) -> list[str]:
    """Run a pilot; return lines on what the study will take, or why it could not be run."""
    try:
        study = study_of(config)
        study.compile(study.kinds)
        found = forecast_of(study, ranks)
    except MemoryError:
        raise
    except Exception as error:  # a class of the user's own may raise anything
        return [f"time: not known, because the pilot failed: {' '.join(str(error).split())}"]
    words = ", ".join(f"{found.ended[name]} {name}" for name in OUTCOMES if found.ended[name])
    most = f" at {found.replicates} replicates of a condition"
    hours = [each / 3600.0 for each in (found.cpu, found.low, found.high)]
    return [
        f"time: {duration(found.cpu / ranks)} on {plural(ranks, 'rank')}, plus up to a minute if "
        "code must be compiled first",
        f"  core-hours{most * (found.replicates < config.replicates)}: {hours[0]:.2g} "
        f"({hours[1]:.2g} to {hours[2]:.2g}), estimated from "
        f"{plural(found.ended.total(), 'replicate')}, which ended: {words}",
    ]
