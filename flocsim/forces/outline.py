"""What forces between outlines make of a scene beside their law: how far to look, and how deep."""

from collections.abc import Iterable, Sequence

from flocsim.body import NO_OUTLINES, Fluid
from flocsim.constants import MINIMUM_GAP
from flocsim.errors import UsageError
from flocsim.forces.base import Force, PairForce
from flocsim.forces.check import fields_read, reach_of, sample_points


def act_along_outlines(forces: Iterable[Force]) -> bool:
    """Whether any of some forces acts all along two outlines."""
    return any(
        isinstance(force, PairForce) and force.acts_on == "outlines" and not force.absent
        for force in forces
    )


def refuse_outlines(forces: Iterable[Force], what: str) -> None:
    """UsageError where a force acts all along two outlines, of ``what`` cannot have such."""
    for force in forces:
        if act_along_outlines([force]):
            raise UsageError(
                f"{type(force).__name__} acts along outlines, and {what} has forces between "
                'spheres or nearest points alone: give gap = "surface" in the place of '
                'law = "outline"'
            )


def outlines_of_forces(
    forces: Sequence[PairForce], fluid: Fluid
) -> tuple[float, float, float, float]:
    """``Scene.outlines`` of some forces between outlines [m]: the gap up to which any of them acts;
    the least gap at which attraction is asked for, outlines that are nearer counting as so far
    apart; the depth of the bodies, 0 where it follows from their sizes; and the gap up to which all
    points count, however near the outlines are.

    UsageError for forces of several depths.
    """
    if not forces:
        return NO_OUTLINES
    depths = {getattr(force, "depth", "sphere") for force in forces}
    if len(depths) > 1:
        found = ", ".join(str(each) for each in sorted(depths, key=str))
        raise UsageError(
            f"forces between outlines act along one depth, found {found}: give them the same depth"
        )
    [depth] = depths
    floor = max((getattr(force, "d_min", 0.0) for force in forces), default=0.0)
    steady = [
        reach_of(force)
        for force in forces
        if "gap" in fields_read(force, fluid, force.kernel_in(fluid), sample_points(force))
    ]
    return (
        max(map(reach_of, forces)), floor or MINIMUM_GAP,
        0.0 if isinstance(depth, str) else depth, max(steady, default=0.0),
    )  # fmt: skip
