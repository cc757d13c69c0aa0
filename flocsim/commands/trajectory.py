"""`flocsim trajectory cfg.toml --replicate 17`: one collision as a strip of frames (Fig. 7); and
what commands show of a file of motion."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

import numpy as np

from flocsim.commands import add_overwrite, add_settings
from flocsim.ensembles.config.loader import load_config, settings_in
from flocsim.ensembles.contents import Contents, Figures, Summary
from flocsim.ensembles.diagnose.preflight import check_study, inputs_of
from flocsim.ensembles.pairs.opened import one_count_study, place_of, replicate_of
from flocsim.io.arguments import number
from flocsim.io.outputs import check_ending, check_outputs
from flocsim.io.plots.style import FIGURE_ENDINGS, save
from flocsim.io.results.run_group import SOURCE, source_line
from flocsim.io.trajectory import (
    Motion,
    StoredTrajectory,
    centre_distance,
    read_trajectory,
    write_trajectory,
)
from flocsim.trajectories.figures import MOST_FRAMES, animated, drawn

ANIMATION_FRAMES = 60
STRIP_FRAMES = 7


def add_arguments(parser: ArgumentParser) -> None:
    """Run one replicate of a config and draw it as a strip of frames.

    config: config file (TOML)
    --replicate K: default: 0
    --type NAME: collision type (default: the first)
    --vertices N: vertices of the bodies (default: the last)
    --delta F: default: the first
    --frames K: default: %(default)s
    --output FILE: strip of frames: .png, .pdf or .svg (default: a .png named after the config and
        the replicate)
    --distance FILE: also draw the centre distance against time
    --forces FILE: also draw the forces against time
    --animation FILE.gif: also write an animation
    --save FILE.h5: also write the motion to HDF5
    """
    add = parser.add_argument
    add("config")
    add("--replicate", type=int, default=0)
    add("--type")
    add("--vertices", type=int)
    add("--delta", type=float)
    add("--frames", type=lambda text: int(number("2 to 500", 2, MOST_FRAMES)(text)), default=6)
    add("-o", "--output")
    for name in ("--distance", "--forces", "--animation", "--save"):
        add(name)
    add_settings(parser)
    add_overwrite(parser)


def outcome_line(name: str, vertices: int, share: float, replicate: int, row: dict) -> str:
    """Return what became of a replicate of a collision type, of N vertices at a share of δ_max."""
    reason = f" ({row['failure']})" if row["failure"] != "none" else ""
    touch = ""
    if row["inside"] != "not_applicable":
        touch = f"collision at {1e3 * row['t_collision']:.4g} ms, "
        touch += f"d_c = {1e6 * row['d_c_collision']:.4g} um; "
    return (
        f"type {name}, N = {vertices}, delta = {share:g}, replicate {replicate}: "
        f"{row['outcome']}{reason}; {touch}end at {1e3 * row['t_end']:.4g} ms, {row['steps']} steps"
    )


def run(args: Namespace) -> int:
    """Run the replicate, draw it, print what happened; the exit code."""
    config = load_config(args.config, settings_in(args.settings))
    place = place_of(config, args.type, args.vertices, args.delta, "--")
    check_study(config)
    name, vertices, share = config.scene.names[place[0]], *place[1:]
    shows = f"{name}-{vertices}-{share:g}-{args.replicate}"  # as in study-I-64-0.5-17.png
    named = args.output or f"{Path(args.config).stem}-{shows}.png"
    asked = {"strip": named, "distance": args.distance, "forces": args.forces}
    figures = {figure: path for figure, path in asked.items() if path}
    rule = args.overwrite
    # What could not be written is reported now, not after the run.
    for path in figures.values():
        check_ending(path, FIGURE_ENDINGS)
    if args.animation:
        check_ending(args.animation, (".gif",))
    outputs = [*figures.values(), *filter(None, [args.animation, args.save])]
    check_outputs(outputs, rule, inputs_of(config, args.config))
    study = one_count_study(config, place[1])
    found = replicate_of(args.replicate, place, study)
    assert found.row is not None, "a replicate of a study"
    title = outcome_line(name, vertices, share, args.replicate, found.row)
    source, head = source_line(study.source), title.split(";")[0]
    print(title)
    print(source)
    for figure, path in figures.items():
        save(drawn(found, figure, args.frames, head), path, rule, source)
    if args.animation:
        animated(found, Path(args.animation), ANIMATION_FRAMES, head, rule)
    if args.save:
        facts = {"config": config.text, "replicate": args.replicate} | study.source
        facts["zone_distance"] = found.row["D_0"]
        motion = found.t, found.position, found.velocity, found.shapes
        write_trajectory(args.save, motion, facts, rule)
    print("\n".join(map(str, outputs)))
    return 0


def strip(trajectory: Any, figure: str = "strip") -> Any:
    """Frames of the motion, evenly along the way of the bodies against each other."""
    return drawn(trajectory, figure, STRIP_FRAMES)


def distance(trajectory: Any) -> Any:
    """Distance of the two centres against time."""
    return strip(trajectory, "distance")


MOTION_FIGURES: Figures = {"strip": strip, "distance": distance}


class TrajectoryFiles(Contents):
    """What commands show of a stored motion."""

    title = "a trajectory"
    read = staticmethod(read_trajectory)

    def summary(self, found: StoredTrajectory) -> Summary:
        """Return what a trajectory file holds."""
        moved = np.hypot(*np.moveaxis(np.diff(found.position[:, :, :2], axis=0), 2, 0)).sum(axis=0)
        facts = [
            ("time", f"{found.t[0]:.6g} to {found.t[-1]:.6g} s, {len(found.t)} states"),
            *((f"body {number}", f"N = {len(shape.vertices)}, r_eq "
               f"{1e6 * shape.equivalent_radius:.4g} µm, moved {1e6 * way:.4g} µm")
              for number, (shape, way) in enumerate(zip(found.shapes, moved, strict=True))),
        ]  # fmt: skip
        if len(found.shapes) == 2:
            apart = 1e6 * centre_distance(found.position)
            facts.append(
                ("centre distance", f"{apart[0]:.4g} µm at the start, at least {apart.min():.4g}, "
                 f"{apart[-1]:.4g} at the end")
            )  # fmt: skip
        for name, value in found.facts.items():
            if name not in ("config", *SOURCE):
                told = f"{value:.6g}" if isinstance(value, float) else str(value)
                facts.append((name.replace("_", " "), told))
        return Summary(facts)

    def figures(self, found: StoredTrajectory) -> Figures:
        """Return the figures of a motion: distances are those of two bodies."""
        return MOTION_FIGURES if len(found.shapes) == 2 else {"strip": strip}

    def source(self, found: StoredTrajectory) -> str:
        """Return of which flocs, preset and version it is."""
        return source_line(found.facts)

    def motion(self, found: StoredTrajectory) -> Motion:
        """Return (times, positions, velocities, shapes)."""
        return found.t, found.position, found.velocity, found.shapes


TRAJECTORY = TrajectoryFiles()
