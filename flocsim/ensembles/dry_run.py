"""What a study would do, without doing it."""

from flocsim.ensembles.preflight import sphere_pairs


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


def scene_lines(config):
    """What is compiled in and what is left out, for spheres and for polygons."""
    _, pair = next(sphere_pairs(config))
    pieces = pair.system.pieces
    yield from (f"  in:  {force}" for force in pieces.used.values())
    yield from (f"  out: {force}: {reason}" for force, reason in pieces.left_out.items())
    if any(n == 1 for n in config.shapes.vertices):
        yield "  out: vertex-edge pairs and turning of vertices, where both are spheres (N = 1)"
    yield "  out: trajectories: an ensemble records none (see `flocsim trajectory`)"


def dry_run(config, team):
    """The report of --dry-run as text."""
    scene, shapes = config.scene, config.shapes
    count = len(scene.conditions) * len(shapes.vertices) * len(scene.delta)
    lines = [
        f"{count} conditions x {config.replicates} replicates = {count * config.replicates}, "
        f"seed {config.seed}, {team.size} rank(s), results in {config.output.file}",
        f"  vertices {list(shapes.vertices)}, delta {list(scene.delta)} of the {scene.delta_max} "
        f"delta_max, receiver {scene.receiver}",
        f"  flocs: {shapes.source}{f' {shapes.file}' if shapes.file else ''}, spheroradius "
        f"{1e6 * shapes.radius:.4g} um",
        f"  integrator: {config.integrator.name}, tolerance {config.integrator.tolerance:g} m",
        "collisions:",
        *condition_lines(config),
        "forces and code:",
        *scene_lines(config),
        "nothing was run (--dry-run)",
    ]
    return "\n".join(lines)
