"""Error against run time of every integrator, on every scene of scenes.py.

    python -m benchmarks.accuracy.work_precision [--quick] [--markdown] [--figure FILE]

The error of a run is how far any point of an outline ends from where the reference puts it.
"""

import sys

import numpy as np

from benchmarks.reporting import Table, begin
from benchmarks.speed.measure import distance, measure, reference
from benchmarks.speed.scenes import all_scenes
from flocsim.integrators import DormandPrince54, Implicit, Overdamped, VelocityVerlet

TOLERANCES = np.logspace(-6, -12, 7)
"""[m], six decades."""

STEP_COUNTS = np.logspace(1.5, 6.5, 11)
"""Fixed steps that a run is divided into."""

MARKERS = {"Implicit": "o", "DormandPrince54": "^", "VelocityVerlet": "s", "Overdamped": "D"}

SHOWN = 4
"""Settings of each method in the table: the loosest, the tightest, and some between."""


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


def judged(scene, run, exact):
    """(error [m], how it ended): a run that ends further off than a body's size is no solution."""
    if not run.finished:
        return float("nan"), run.status
    error = distance(scene, run.motion, exact)
    size = min(body.shape.bounding_radius for body in scene.bodies)
    return (error, "FINISHED") if error < size else (float("nan"), "WRONG")


def measure_scene(scene, table, quick):
    """Add a row for each method to the table; {method: [(error, CPU)]} for the figure."""
    exact, disagreement, _ = reference(scene)
    points, cells = {}, {}
    for method, text, integrator in settings(scene, quick):
        run = measure(scene, integrator, budget=3.0 if quick else 10.0)
        error, end = judged(scene, run, exact)
        shown = f"{error:.0e}" if error == error else end
        points.setdefault(method, []).append((error, run.cpu))
        cells.setdefault(method, []).append(f"{shown} in {1e3 * run.cpu:.2g} ms")
        print(scene.name, method, text, cells[method][-1], file=sys.stderr, flush=True)
    for method, each in cells.items():
        few = np.linspace(0, len(each) - 1, SHOWN).round().astype(int)
        table.add(scene.name, f"{disagreement:.0e}", method, *(each[k] for k in few))
    return points, disagreement


def draw_panel(axes, name, points, disagreement):
    """One scene: lines of runs with an error, crosses at the top for those that failed."""
    for method, marker in MARKERS.items():
        errors, cpu = np.array(points.get(method, [(np.nan, np.nan)])).T
        (line,) = axes.loglog(1e3 * cpu, errors, marker=marker, markersize=5, label=method)
        failed = 1e3 * cpu[np.isnan(errors)]
        axes.plot(
            failed, np.full(len(failed), 0.97), "x", color=line.get_color(),
            transform=axes.get_xaxis_transform(),
        )  # fmt: skip
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
    note = "× failed; dotted: how far the two references differ"
    panels[-1].legend(handles, labels, title=note, loc="center", title_fontsize="small")
    figure.savefig(path, dpi=110)


def main():
    """Print the table, draw the figure."""
    arguments = begin(__doc__, figure="")
    columns = ("scene", "references differ by [m]", "method", "loosest", "", "", "tightest")
    table = Table("Error [m], and CPU time, from 1e-6 to 1e-12 m or 32 to 3e6 steps", columns)
    scenes = {s.name: measure_scene(s, table, arguments.quick) for s in all_scenes()}
    table.print()
    if arguments.figure:
        draw(scenes, arguments.figure)
        print(f"drawn: {arguments.figure}")


if __name__ == "__main__":
    main()
