"""What a trajectory file holds, for the commands."""

from typing import Any

import numpy as np

from flocsim.ensembles.contents import Contents, Figures, Summary
from flocsim.io.trajectory import StoredTrajectory, centre_distance, read_trajectory

STRIP_FRAMES = 7


def summary(found: StoredTrajectory) -> Summary:
    """What a trajectory file holds."""
    moved = np.hypot(*np.moveaxis(np.diff(found.position[:, :, :2], axis=0), 2, 0)).sum(axis=0)
    facts = [
        ("time", f"{found.t[0]:.6g} to {found.t[-1]:.6g} s, {len(found.t)} states"),
        *((f"body {number}", f"N = {len(shape.vertices)}, r_eq {1e6 * shape.equivalent_radius:.4g} "
           f"µm, moved {1e6 * way:.4g} µm")
          for number, (shape, way) in enumerate(zip(found.shapes, moved, strict=True))),
    ]  # fmt: skip
    if len(found.shapes) == 2:
        apart = 1e6 * centre_distance(found.position)
        facts.append(
            ("centre distance", f"{apart[0]:.4g} µm at first, {apart.min():.4g} at least, "
             f"{apart[-1]:.4g} at last")
        )  # fmt: skip
    for name, value in found.facts.items():
        if name != "config":
            told = f"{value:.6g}" if isinstance(value, float) else str(value)
            facts.append((name.replace("_", " "), told))
    return Summary(facts)


def strip(trajectory: Any) -> Any:
    """Frames of the motion, evenly along the way of the bodies against each other."""
    from flocsim.trajectories.figures import drawn

    return drawn(trajectory, "strip", STRIP_FRAMES)


def distance(trajectory: Any) -> Any:
    """Distance of the two centres against time."""
    from flocsim.trajectories.figures import drawn

    return drawn(trajectory, "distance", STRIP_FRAMES)


FIGURES: Figures = {"strip": strip, "distance": distance}

CONTENTS = Contents(
    title="a trajectory",
    read=read_trajectory,
    summary=summary,
    table=lambda found: "",
    figures=lambda found: FIGURES if len(found.shapes) == 2 else {"strip": strip},
    drawn={"a trajectory file (flocsim trajectory --save, Trajectory.save)": FIGURES},
    motion=lambda found: (found.t, found.position, found.velocity, found.shapes),
)
