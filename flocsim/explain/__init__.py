"""What a scene is made of: compiled in, left out, and why; and how stiff it is."""

from flocsim.explain.parts import force_lines, machinery_lines, plain_run_lines
from flocsim.explain.time_scales import scale_lines

__all__ = ["explain", "force_lines", "machinery_lines", "scale_lines"]


def explain(system):
    """The report of System.explain() as text: forces, machinery, time scales."""
    return "\n".join(
        [
            heading(system),
            *force_lines(system),
            *machinery_lines(system),
            *plain_run_lines(system),
            *scale_lines(system),
        ]
    )


def heading(system):
    """One line on bodies, core points and method."""
    bodies = system.bodies
    sizes = sorted({len(body.shape.vertices) for body in bodies})
    kind = "spheres only" if system.spheres_only else "polygons"
    noun = "body" if len(bodies) == 1 else "bodies"
    points = " to ".join(map(str, sizes[:: max(len(sizes) - 1, 1)]))
    fixed = sum(body.fixed for body in bodies)
    held = f", {fixed} of them fixed" if fixed else ""
    method = f"method {system.integrator}"
    return f"{len(bodies)} {noun}, {kind} (core points: {points}){held}; {method}"
