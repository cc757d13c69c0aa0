"""What is implausible in a study, and how its bodies settle: for the terminal and for the file.

Of flocs of measured sizes it looks at the largest of each collision type, which settle fastest.
``flocs`` are those of the study, where they have been read.
"""

from collections.abc import Sequence

from flocsim.ensembles.collision.flocs import Floc
from flocsim.ensembles.config.pair_scene import BROWNIAN
from flocsim.ensembles.config.presets import PRESETS
from flocsim.ensembles.config.schema import Config
from flocsim.ensembles.preflight import pairings, sphere_pairs
from flocsim.forces import Force
from flocsim.plausibility.doubts import Names, doubts_of
from flocsim.plausibility.ranges import ROUNDING
from flocsim.plausibility.reynolds import settled


def names_in(config: Config, acting: Sequence[Force]) -> Names:
    """What a config calls the fluid, the bodies, and those of its forces that are acting."""
    known = [id(force) for force in acting]
    forces = zip(config.force_names, config.forces, strict=True)
    return Names(
        fluid="fluid", body="bodies", buoyancy="fluid.buoyancy = true", drop="give {} = false",
        forces=tuple(f"forces.{name}" for name, force in forces if id(force) in known),
    )  # fmt: skip


IMPLIED = (
    "preset tang2014 gives flocs the paper's 2 kg/m2 of projected area, 65 to 325 times as much "
    "as water at its sizes: they settle faster than Stokes's drag holds for, and shape decides. At "
    'real weight (preset = "si") whatever touches stays together: docs/presets.md'
)


def paper_weight(config: Config) -> bool:
    """Whether bodies have the weight of the paper's preset, which implies what is doubtful of their
    settling."""
    given = PRESETS.get(config.preset or "", {}).get("bodies", {}).get("surface_density")
    return given is not None and given == config.bodies.surface_density


def said_doubts(config: Config, doubts: Sequence[str]) -> list[str]:
    """Those of the doubts that every run says: not that the drag falls short, where the preset
    implies it. The dry run says IMPLIED once in its place; the results file keeps all."""
    if not paper_weight(config):
        return list(doubts)
    return [line for line in doubts if "settles at" not in line or "Re = " not in line]


def study_doubts(config: Config, flocs: Sequence[Floc] | None = None) -> list[str]:
    """Lines on a study, by the equivalent spheres of its collision types; none where all is
    usual."""
    systems = [pair.system for _, pair in sphere_pairs(config, flocs, "largest")]
    # In a flow bodies meet without their weight.
    lines = doubts_of(systems, names_in(config, systems[0].forces))
    options = config.shapes
    if options.own is None and options.size == "scene" and max(options.vertices) > 1:
        least = min(min(each.radii) for each in pairings(config, flocs))
        share = options.radius / least
        lines.append(ROUNDING.doubt("shapes.radius over the smallest equivalent radius", share))
    return [line for line in lines if line]


def settling_facts(config: Config, flocs: Sequence[Floc] | None = None) -> list[dict]:
    """[{type, body, radius [m], speed [m/s], reynolds, stokes}] of every free equivalent sphere.

    It is the same at every N: a floc settles as the sphere of its area. Nothing where bodies meet
    by thermal motion alone, without their weight.
    """
    found = []
    for name, pair in sphere_pairs(config, flocs, "largest"):
        if pair.meeting == BROWNIAN:
            continue
        for letter, body in zip("ij", pair.system.bodies, strict=True):
            if (each := settled(pair.system, body)) is not None:
                found.append({"type": name, "body": letter, **each._asdict()})
    return found
