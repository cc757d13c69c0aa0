"""Error against run time of every integrator, on every scene of scenes.py.

    python benchmarks/work_precision.py [--quick] [--markdown] [--figure FILE]

The error of a run is how far any point of an outline ends from where the reference puts it.
"""

import numpy as np
from measure import distance, measure, reference
from reporting import Table, parse_arguments, print_heading
from scenes import all_scenes

from flocsim.integrators import DormandPrince54, Implicit, Overdamped, VelocityVerlet

TOLERANCES = np.logspace(-6, -12, 7)
"""[m], six decades."""

STEP_COUNTS = np.logspace(1.5, 6.5, 11)
"""Fixed steps that a run is divided into."""

COLUMNS = ("scene", "method", "setting", "error [m]", "CPU [ms]", "steps", "evaluations", "end")


def settings(scene, quick):
    """(method's name, text of the setting, integrator) of every run of a scene."""
    every = 2 if quick else 1
    for tolerance in TOLERANCES[::every]:
        text = f"{tolerance:.0e} m"
        yield "Implicit", text, Implicit(tolerance)
        yield "DormandPrince54", text, DormandPrince54(tolerance)
        if scene.light:
            yield "Overdamped", text, Overdamped(tolerance)
    for count in STEP_COUNTS[:: 2 * every]:
        step = scene.until / count
        yield "VelocityVerlet", f"{step:.1e} s", VelocityVerlet(step)


def measure_scene(scene, table, quick):
    """Add the runs of a scene to the table; {method: [(error, CPU, finished)]} for the figure."""
    exact, disagreement, other = reference(scene)
    table.add(scene.name, "reference", f"against {other}", disagreement, "", "", "", "agree")
    points = {}
    for method, text, integrator in settings(scene, quick):
        run = measure(scene, integrator, budget=3.0 if quick else 10.0)
        error = distance(scene, run.motion, exact) if run.finished else float("nan")
        shown = f"{error:.1e}" if run.finished else "-"
        table.add(
            scene.name, method, text, shown, 1e3 * run.cpu, run.steps, run.evaluations, run.status
        )
        points.setdefault(method, []).append((error, run.cpu, run.finished))
    return points, disagreement


def draw_panel(axes, name, points, disagreement):
    """One scene: lines of runs that finished, crosses at the top for those that did not."""
    markers = dict(
        zip(("Implicit", "DormandPrince54", "VelocityVerlet", "Overdamped"), "o^sD", strict=True)
    )
    for method, marker in markers.items():
        runs = np.array(points.get(method, np.zeros((0, 3))), dtype=float)
        done = runs[:, 2] == 1.0
        (line,) = axes.loglog(1e3 * runs[done, 1], runs[done, 0], marker=marker, label=method)
        height = np.full(np.count_nonzero(~done), 0.97)
        transform = axes.get_xaxis_transform()
        axes.plot(1e3 * runs[~done, 1], height, "x", color=line.get_color(), transform=transform)
    axes.axhline(max(disagreement, 1e-17), color="0.7", linestyle=":")
    axes.set(title=name, xlabel="CPU [ms]", ylabel="error [m]")


def draw(scenes, path):
    """All panels: {scene's name: (points, disagreement)}."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 6.5), layout="constrained")
    panels = figure.subplots(2, (len(scenes) + 1) // 2, squeeze=False).ravel()
    for axes, (name, (points, disagreement)) in zip(panels, scenes.items(), strict=False):
        draw_panel(axes, name, points, disagreement)
    for axes in panels[len(scenes) :]:
        axes.set_axis_off()
    handles, labels = panels[0].get_legend_handles_labels()
    note = "× did not finish; dotted: how far the two references differ"
    panels[-1].legend(handles, labels, title=note, loc="center", title_fontsize="small")
    figure.savefig(path, dpi=110)


def main():
    """Print the table, draw the figure."""
    figure = {"help": "where to draw, e.g. docs/figures/work_precision.png"}
    arguments = parse_arguments(__doc__, figure=figure)
    print_heading()
    table = Table("Error against run time", COLUMNS)
    scenes = {s.name: measure_scene(s, table, arguments.quick) for s in all_scenes()}
    table.print(arguments.markdown)
    if arguments.figure:
        draw(scenes, arguments.figure)
        print(f"drawn: {arguments.figure}")


if __name__ == "__main__":
    main()
