"""What is known of a study without running it: what it is made of, what its equivalent spheres
would do, and what a pilot says it takes.

Equivalent spheres of a brownian study by integrals: how often they would touch, and how much their
interaction slows down their coagulation. In the plane, where the study is, so many of two spheres
that are let go at a distance r touch before they are b apart: ln(b/r)/ln(b/(r_i + r_j)) without
forces between them. What shapes do beyond that is the difference to these. The stability ratio W is
that of three dimensions. Of settling and flows by their ways in three dimensions, without inertia:
the share of the rectilinear kernel of those that come to touch, with the water that they push at
each other, and without (flocsim.hydrodynamics).
"""

import math
import time
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from flocsim.brownian import repulsion, splitting_probability, stability_ratio
from flocsim.constants import MINIMUM_GAP
from flocsim.ensembles.collision.draw import EASILY, THIRD_OF, count_checks, exact_method
from flocsim.ensembles.collision.encounter import Encounter
from flocsim.ensembles.collision.flocs import Floc, read_flocs
from flocsim.ensembles.collision.pairings import class_facts, pairings_of
from flocsim.ensembles.config.pair_scene import BROWNIAN, SETTLING
from flocsim.ensembles.config.schema import BAND, Config
from flocsim.ensembles.kind import study_of
from flocsim.ensembles.parallel.communicator import StopRequested
from flocsim.ensembles.pilot.forecast import (
    Forecast,
    finding_words,
    findings,
    forecast_of,
    in_turn,
    time_replicates,
)
from flocsim.ensembles.preflight import (
    IMPLIED,
    kinds,
    measured_flocs,
    paper_weight,
    placed_system,
    said_doubts,
    settling_facts,
    sphere_pairs,
    study_doubts,
)
from flocsim.ensembles.study import Study
from flocsim.errors import FlocsimError, UsageError
from flocsim.explain import force_lines, machinery_lines, scale_lines
from flocsim.forces import VanDerWaals
from flocsim.forces.body_forces import thermal_in
from flocsim.forces.drag import solid_radius
from flocsim.hydrodynamics import Meeting, SpherePair
from flocsim.io.fit_report import coarse_line
from flocsim.io.results.run_group import class_words, sphere_words
from flocsim.io.results.schema import OUTCOMES
from flocsim.io.terminal import duration
from flocsim.process import INTERRUPTION, stop_requested

NOTHING_RUN = (
    "nothing was run (--dry-run); --pilot runs some replicates, to estimate core-hours and file "
    "size and to find which forces matter"
)


def sphere_facts(config: Config, flocs: Sequence[Floc] | None = None) -> list[dict]:
    """[{type, release, escape [m], diffusion [m²/s], free, touch, stability}] of the collision
    types of a brownian study, nothing of others.

    ``free`` and ``touch``: probabilities to touch without and with the forces between the spheres;
    what is not a number, as for a potential beyond all bounds, is None.
    """
    return [
        {"type": name, **facts_of(pair)}
        for name, pair in sphere_pairs(config, flocs)
        if pair.meeting == BROWNIAN
    ]


def facts_of(pair: Encounter) -> dict[str, Any]:
    """The same of one pair of spheres."""
    system, (near, far) = pair.system, pair.ends
    radius_i, radius_j = (shape.equivalent_radius for shape in pair.shapes)
    radii = radius_i, radius_j
    [thermal] = thermal_in(system.forces)
    known: dict[str, Any] = {"temperature": thermal.temperature, "fluid": system.fluid}
    with np.errstate(all="ignore"):
        found = {
            "free": splitting_probability([], radii, near, far, **known),
            "touch": splitting_probability(system.forces, radii, near, far, **known),
            "stability": stability_ratio(system.forces, radii, **known),
        }
    plain = {name: value if math.isfinite(value) else None for name, value in found.items()}
    return {"release": near, "escape": far, "diffusion": pair.diffusion} | plain


def water_facts(config: Config) -> list[dict]:
    """[{type, water, alone}] of the collision types that settling or a flow brings together: the
    share of the rectilinear kernel of their equivalent spheres that touches with the water that
    they push at each other, and without.

    UsageError for ratios of radii that the resistance functions do not reach.
    """
    found = []
    for name, pair in sphere_pairs(config):
        if pair.meeting != BROWNIAN:
            try:
                shares = {key: share_in(pair, key == "water") for key in ("water", "alone")}
            except UsageError as error:
                raise UsageError(f"{name}: {error}") from error
            found.append({"type": name, **shares})
    return found


def share_in(pair: Encounter, water: bool) -> float:
    """Of one pair, with the water between the two or without."""
    system = pair.system
    if words := unknown_in_water(pair):
        raise UsageError(f"how often spheres touch in water cannot be computed {words}")
    first, second = (shape.equivalent_radius for shape in pair.shapes)
    # Of flocs that water passes through the solid spheres that resist as much.
    inner = solid_radius(first, system.forces), solid_radius(second, system.forces)
    spheres = SpherePair(inner, system.fluid.viscosity)
    passed = first + second - sum(inner)
    force = repulsion(system.forces, (first, second), system.fluid)
    cuts = [each.d_min for each in system.forces if isinstance(each, VanDerWaals)]
    meeting = Meeting(spheres, force, min(cuts, default=MINIMUM_GAP), water, passed)
    if pair.rate is not None:
        return meeting.in_flow(pair.meeting, pair.rate)
    # The weights of spheres that settle alone, by Stokes's law, as fast as these do.
    speeds = [-float(velocity[1]) for velocity, _ in pair.settling]
    drag = 6.0 * math.pi * system.fluid.viscosity
    return meeting.settling((drag * inner[0] * speeds[0], drag * inner[1] * speeds[1]))


def unknown_in_water(pair: Encounter) -> str:
    """Why what water does to two spheres cannot be said of a pair; "" where it can."""
    if thermal_in(pair.system.forces):
        return "with thermal kicks: leave [forces.thermal] out"
    if any(body.fixed for body in pair.system.bodies):
        return "with a fixed receiver: choose scene.receiver = 'free'"
    if pair.meeting == SETTLING and any(pair.system.fluid.flow):
        return "when they settle in a flow: leave fluid.velocity and fluid.gradient out"
    return ""


def condition_lines(config, flocs):
    """A line for every collision type: sizes, zone, settling of the equivalent spheres."""
    facts = settling_facts(config, flocs)
    found = pairings_of(config, flocs)
    if classes := class_words(class_facts(found)):
        yield f"  {classes}"
    thermal = {each["type"]: each for each in sphere_facts(config, flocs)}
    for pairing, (name, pair) in zip(found, sphere_pairs(config, flocs), strict=True):
        radius_i, radius_j = (shape.equivalent_radius for shape in pair.shapes)
        falls = [1e3 * -velocity[1] for velocity, _ in pair.settling]
        sizes = (
            f"  {name}: r_i = {1e6 * radius_i:.4g} um, r_j = {1e6 * radius_j:.4g} um, "
            f"D_0 = {1e6 * pair.zone_distance:.4g} um"
        )
        if name in thermal:
            yield from (sizes, f"    {sphere_words(thermal[name])}")
        else:
            settling = f"settling {falls[0]:.4g} and {falls[1]:.4g} mm/s"
            yield f"{sizes}; {settling}, turn time {pair.turn_time:.3g} s"
        if config.shapes.size == "own":
            (low_i, high_i), (low_j, high_j) = (np.array(each) * 1e6 for each in pairing.spans)
            yield (
                f"    measured sizes, r_i {low_i:.4g} to {high_i:.4g} um, r_j {low_j:.4g} to "
                f"{high_j:.4g} um; delta_max and D_0 are those of each pair"
            )
        numbers = [
            f"body {each['body']} Re = {each['reynolds']:.2g}, St = {each['stokes']:.2g}"
            for each in facts
            if each["type"] == name
        ]
        largest = "the largest " if config.shapes.size == "own" else ""
        if numbers:
            yield f"    {largest}at terminal speed: {'; '.join(numbers)}"


def code_lines(config, flocs):
    """What is compiled in and what is left out, for polygons and for spheres."""
    _, pair = next(sphere_pairs(config, flocs))
    systems = [placed_system(config, pair.system, shapes) for shapes in kinds(config, pair.shapes)]
    lines = [*force_lines(systems[0]), *machinery_lines(systems[0])]
    for system in systems[1:]:
        more = [line for line in machinery_lines(system) if line not in lines]
        lines += [f"{line} (where N = 1)" for line in more]
    return [f"  {line}" for line in lines]


def checked_words(config):
    """How many replicates are run again, and by what."""
    method, share = config.integrator.method, config.integrator.check_share
    exact = exact_method(method)
    count = count_checks(config.seed, config.replicates, share)
    if exact is None:
        return f"none, {config.integrator.label} has no tolerance or step to reduce"
    elif not count:
        return "none, so the numerical error stays unknown (integrator.check_share)"
    elif exact.tolerance < math.inf:
        how = f"a tolerance of {exact.tolerance:g} m"
    else:
        how = f"a step of {exact.first_step:g} s"
    more = f" {EASILY} times as many of those that flip easily," if share == "auto" else ""
    return (
        f"{count} of the {config.replicates} replicates of each condition "
        f"({100.0 * count / config.replicates:.2g} %),{more} at {how}; one in {THIRD_OF} of these "
        "a third time, at a still tighter tolerance"
    )


def go_on():
    """StopRequested where a signal has come."""
    if stop_requested():
        raise StopRequested(f"stopped by {INTERRUPTION.name}")


def forecast_study(config: Config, ranks: int) -> tuple[Study, Forecast, float]:
    """Run a pilot; return (Study, its Forecast for so many ranks, seconds that compiling or loading
    took)."""
    began = time.process_time()
    study = study_of(config)
    grown = time.process_time() - began
    compiled = -time.monotonic()
    study.compile(study.kinds)
    compiled += time.monotonic()
    runs = time_replicates(study, in_turn(config), go_on)
    return study, forecast_of(study, runs, ranks, grown), compiled


def pilot_lines(config: Config, ranks: int) -> list[str]:
    """What a pilot of the study says: what it takes, and what of its physics changed no outcome."""
    study, found, compiled = forecast_study(config, ranks)
    return [
        *forecast_lines(config, found, ranks, compiled),
        *(
            f"without {finding_words(each, found.runs)}"
            for each in findings(study, found.runs, go_on)
        ),
        "nothing is left out beyond what the config leaves out",
    ]


def forecast_lines(config: Config, found: Forecast, ranks: int, compiled: float) -> list[str]:
    """A Forecast for people."""
    ended = Counter(OUTCOMES[run.first.outcome] for run in found.runs)
    words = ", ".join(f"{ended[name]} {name}" for name in OUTCOMES if ended[name])
    conditions = len(config.scene.names) * len(config.shapes.vertices) * len(config.scene.delta)
    again = [run for run in found.runs if run.second is not None]
    flips = sum(run.flipped for run in again)
    hours, size = found.hours, found.size
    most = f" at {found.replicates} replicates" if found.replicates < config.replicates else ""
    return [
        f"ran {len(found.runs)} replicates of {found.conditions} of the {conditions} conditions, "
        f"{len(again)} of them again ({flips} outcomes flipped); they ended {words}",
        f"core-hours{most}: {hours.value:.2g} ({hours.low:.2g} to {hours.high:.2g}), "
        f"{100.0 * found.again:.0f} % of them for second runs; on {ranks} rank{'s' * (ranks != 1)} "
        f"{duration(3600.0 * hours.value / ranks)} ({duration(3600.0 * hours.low / ranks)} to "
        f"{duration(3600.0 * hours.high / ranks)})",
        f"  not counting compilation, once for each machine: {compiled:.0f} s here",
        f"results file{most}: {megabytes(size.value)} ({megabytes(size.low)} to "
        f"{megabytes(size.high)}), {size.value / (conditions * found.replicates):.0f} B for each "
        "replicate; its journal takes as much again until the study is done",
    ]


def megabytes(size):
    """Bytes for people: 812 kB, 26 MB, 3.1 GB."""
    for unit, factor in (("kB", 1e3), ("MB", 1e6)):
        if size < 999.5 * factor:
            return f"{size / factor:.3g} {unit}"
    return f"{size / 1e9:.3g} GB"


def piloted(config, ranks):
    """The lines of the pilot; why there are none, in one line, where it cannot be run."""
    try:
        return pilot_lines(config, ranks)
    except (StopRequested, MemoryError):
        raise
    except FlocsimError as error:
        return [f"none could be run: {error}"]
    except Exception as error:  # of a class of the user's own
        words = " ".join(str(error).split())
        return [f"none could be run: {type(error).__name__}: {words}"]


BAND_WORDS = {
    BAND: "every replicate run three times, with outlines as cut, cut closer and cut wider",
    "closer": "outlines cut closer",
    "wider": "outlines cut wider",
}
"""What `[shapes] outlines` means, where it is not as they were cut."""


def coarse_lines(config, measured):
    """What to say where the largest N of a study is too small for the flocs of its library."""
    if config.shapes.source != "library":
        return []
    flocs = measured or read_flocs(config.shapes)
    line = coarse_line({floc.name: floc.errors for floc in flocs})
    return [f"warning: {line}"] if line else []


def way_words(scene):
    """How the bodies of a scene meet, in words."""
    if scene.meeting == BROWNIAN:
        return f"brownian: from {scene.release:g} to {scene.escape:g} (r_i + r_j) apart"
    return (
        f"delta {list(scene.delta)} of the {scene.delta_max} delta_max, receiver {scene.receiver}"
    )


def dry_run(config: Config, ranks: int, pilot: bool = False) -> str:
    """All that is known of a study before it is run; with a ``pilot``, what some of its replicates
    say as well."""
    scene, shapes, method = config.scene, config.shapes, config.integrator.method
    flocs = f"{shapes.label}{f' {shapes.file}' if shapes.file else ''}"
    measured = measured_flocs(config)
    if shapes.size == "own":
        flocs += ", at their measured sizes and spheroradii"
        flocs += f", drawn by {scene.weight}" if scene.is_measured else ""
    elif shapes.own is None:
        flocs += f", spheroradius {1e6 * shapes.radius:.4g} um"
    if shapes.outlines in BAND_WORDS:
        flocs += f", {BAND_WORDS[shapes.outlines]}"
    if shapes.pairs_alike_in == "error":
        flocs += ", the receiver with the N whose RE is nearest to that of the approaching floc"
    accuracy = f"tolerance {method.tolerance:g} m" if method.tolerance < math.inf else "fixed step"
    count = len(scene.names) * len(shapes.vertices) * len(scene.delta)
    lines = [
        f"{count} conditions x {config.replicates} replicates = {count * config.replicates}, "
        f"seed {config.seed}, on {ranks} rank{'s' * (ranks != 1)}, results in {config.output.file}",
        f"  vertices {list(shapes.vertices)}, {way_words(scene)}",
        f"  flocs: {flocs}",
        *([f"  {words}"] if (words := config.fluid.words) else []),
        f"  integrator: {config.integrator.label}, {accuracy}",
        f"  run again: {checked_words(config)}",
        "collisions:",
        *condition_lines(config, measured),
        "forces and code:",
        *code_lines(config, measured),
        "  out: trajectories: an ensemble records none (see `flocsim trajectory`)",
        "  out: plots: none are drawn (see `flocsim plot`)",
        *(["  out: MPI: not needed for one rank"] if ranks == 1 else []),
        "stiffness:",
        *(
            f"  {name}: {line}"
            for name, pair in sphere_pairs(config, measured)
            for line in scale_lines(pair.system)
        ),
        *coarse_lines(config, measured),
        *([f"note: {IMPLIED}"] if paper_weight(config) else []),
        *(f"warning: {line}" for line in said_doubts(config, study_doubts(config, measured))),
        *(["pilot:", *(f"  {line}" for line in piloted(config, ranks))] if pilot else []),
        "only the pilot was run (--dry-run)" if pilot else NOTHING_RUN,
    ]
    return "\n".join(lines)
