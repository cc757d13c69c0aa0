"""What a study would do, without doing it."""

from math import inf

from flocsim.ensembles.collision.checking import count_checks, exact_method
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.pilot.sample import pilot_size
from flocsim.ensembles.preflight import kinds, placed_system, sphere_pairs
from flocsim.explain import force_lines, machinery_lines, scale_lines


def condition_lines(config):
    """A line for every collision type: sizes, zone, settling of the equivalent spheres."""
    for name, pair in sphere_pairs(config):
        radius_i, radius_j = (shape.equivalent_radius for shape in pair.shapes)
        falls = [1e3 * -velocity[1] for velocity, _ in pair.settling]
        yield (
            f"  {name}: r_i = {1e6 * radius_i:.4g} um, r_j = {1e6 * radius_j:.4g} um, "
            f"D_0 = {1e6 * pair.zone_distance:.4g} um; "
            f"settling {falls[0]:.4g} and {falls[1]:.4g} mm/s, turn time {pair.turn_time:.3g} s"
        )


def code_lines(config):
    """What is compiled in and what is left out, for polygons and for spheres."""
    _, pair = next(sphere_pairs(config))
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
    if config.integrator.is_chosen and count:
        return checks_of(config, count, "a hundredth of the tolerance that the pilot chooses")
    if exact is None:
        return f"none, {config.integrator.label} has no tolerance or step to be made smaller"
    if not count:
        return "none, the numerical error stays unknown (integrator.check_share)"
    how = (
        f"a tolerance of {exact.tolerance:g} m"
        if exact.tolerance < inf
        else f"a step of {exact.first_step:g} s"
    )
    return checks_of(config, count, how)


def checks_of(config, count, how):
    return (
        f"{count} of the {config.replicates} replicates of each condition "
        f"({100.0 * count / config.replicates:.2g} %), at {how}"
    )


def chosen_words(config):
    """How a pilot chooses the method; "" where the config names one."""
    if not config.integrator.is_chosen:
        return ""
    size = pilot_size(config)
    return 'accuracy = "auto", ' + (
        f"a pilot of {size} replicates of each type chooses method and tolerance"
        if size
        else "too few replicates for a pilot: as in studies at large"
    )


def dry_run(config: Config, ranks: int) -> str:
    scene, shapes, method = config.scene, config.shapes, config.integrator.method
    flocs = f"{shapes.label}{f' {shapes.file}' if shapes.file else ''}"
    if shapes.size == "own":
        flocs += ", at the sizes and spheroradii that were measured"
    elif shapes.own is None:
        flocs += f", spheroradius {1e6 * shapes.radius:.4g} um"
    if shapes.pairs_alike_in == "error":
        flocs += ", the receiver with the N whose RE is nearest to that of the approaching floc"
    accuracy = f"tolerance {method.tolerance:g} m" if method.tolerance < inf else "fixed step"
    count = len(scene.conditions) * len(shapes.vertices) * len(scene.delta)
    lines = [
        f"{count} conditions x {config.replicates} replicates = {count * config.replicates}, "
        f"seed {config.seed}, {ranks} rank(s), results in {config.output.file}",
        f"  vertices {list(shapes.vertices)}, delta {list(scene.delta)} of the {scene.delta_max} "
        f"delta_max, receiver {scene.receiver}",
        f"  flocs: {flocs}",
        f"  integrator: {chosen_words(config) or f'{config.integrator.label}, {accuracy}'}",
        f"  run again: {checked_words(config)}",
        "collisions:",
        *condition_lines(config),
        "forces and code:",
        *code_lines(config),
        "  out: trajectories: an ensemble records none (see `flocsim trajectory`)",
        "  out: plots: none is drawn (see `flocsim plot`)",
        *(["  out: MPI: one rank needs none"] if ranks == 1 else []),
        "stiffness:",
        *(
            f"  {name}: {line}"
            for name, pair in sphere_pairs(config)
            for line in scale_lines(pair.system)
        ),
        "nothing was run (--dry-run)",
    ]
    return "\n".join(lines)
