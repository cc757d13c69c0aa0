"""What forces between outlines make of a scene beside their law: how far to look, and how deep."""

from collections.abc import Iterable, Sequence

from flocsim.body import NO_LAYER, NO_OUTLINES, Fluid
from flocsim.constants import MINIMUM_GAP
from flocsim.errors import UsageError
from flocsim.forces.base import Force, PairForce
from flocsim.forces.check import fields_read, reach_of, sample_points
from flocsim.forces.double_layer import DoubleLayer
from flocsim.geometry.shapes.shape import Shape
from flocsim.geometry.surfaces.charges import THIN, is_thin
from flocsim.geometry.surfaces.field import FADED

TOUCHING = 0.005
"""Of a Debye length: where outlines are nearer, and no attraction says how near they count, the
pressure of double layers grows no more."""


ASK_FOR_BOTH = {
    "outlines": ("acts along outlines", 'give gap = "surface" in the place of law = "outline"'),
    "orientations": ("asks how bodies are turned", "leave it out"),
}
"""{what a PairForce acts on: what to say of it, what to do}, where that takes both bodies as they
are and not their distance alone."""


def asks_for_both(force: Force) -> bool:
    """Whether a force goes by both outlines, or by how both bodies are turned."""
    return isinstance(force, PairForce) and force.acts_on in ASK_FOR_BOTH and not force.absent


def refuse_outlines(forces: Iterable[Force], what: str) -> None:
    """UsageError where a force asks for both bodies as they are, of ``what`` cannot have such."""
    for force in filter(asks_for_both, forces):
        assert isinstance(force, PairForce)
        words, advice = ASK_FOR_BOTH[force.acts_on]
        raise UsageError(
            f"{type(force).__name__} {words}, and {what} has forces between spheres or nearest "
            f"points alone: {advice}"
        )


def layer_along(forces: Iterable[PairForce], shapes: Sequence[Shape]) -> DoubleLayer | None:
    """The double layer among forces between outlines that acts between charges, as it is too thick
    beside what is round in these shapes for a sum of plates; None without.

    UsageError for several.
    """
    layers = [force for force in forces if isinstance(force, DoubleLayer)]
    if len(layers) > 1:
        raise UsageError("one double layer acts along outlines, found several: leave all but one")
    if not layers or not shapes or not layers[0].first or is_thin(shapes, layers[0].kappa):
        return None
    if layers[0].cut is not None:
        raise UsageError(
            f"a double layer of {layers[0].debye_length:.3g} m between bodies rounded by less than "
            f"{THIN:g} times as much ends {FADED:g} Debye lengths from an outline, found a cut of "
            f"{layers[0].cut:.3g} m: leave it out"
        )
    return layers[0]


def pressures_of(forces: Sequence[PairForce], layer: DoubleLayer | None) -> list[PairForce]:
    """The forces between outlines that are pressures of plates, or have a part that is; ``layer``:
    of `layer_along`."""
    found: list[PairForce] = []
    for force in forces:
        if force is not layer:
            found.append(force)
        elif layer.boundary != "superposition":
            found.append(layer.without_charges())
    return found


def layer_numbers(layer: DoubleLayer | None) -> tuple[float, float, float]:
    """``Scene.layer`` of what `layer_along` found: κ [1/m]; 2πε φ_a φ_b [N]; and the gap up to
    which charges act [m], −1 without any."""
    if layer is None:
        return NO_LAYER
    return layer.kappa, layer.between_charges, FADED * layer.debye_length


def outlines_of_forces(
    forces: Sequence[PairForce], pressures: Sequence[PairForce], fluid: Fluid
) -> tuple[float, float, float, float]:
    """``Scene.outlines`` of some forces between outlines, of which some are ``pressures`` [m]: the
    gap up to which any of these acts, −1 without; the least gap at which attraction is asked for,
    outlines that are nearer counting as so far apart; the depth of the bodies, 0 where it follows
    from their sizes; and the gap up to which all points count, however near the outlines are.

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
    read = [
        fields_read(force, fluid, force.kernel_in(fluid), sample_points(force))
        for force in pressures
    ]
    known = list(zip(pressures, read, strict=True))
    floor = max((getattr(f, "d_min", 0.0) for f, r in known if "plate_gap" in r), default=0.0)
    layers = [force for force in pressures if isinstance(force, DoubleLayer)]
    floor = floor or max((f.d_min or TOUCHING * f.debye_length for f in layers), default=0.0)
    steady = [reach_of(force) for force, fields in known if fields & {"gap", "parted_gap"}]
    return (
        max(map(reach_of, pressures), default=-1.0), floor or MINIMUM_GAP,
        0.0 if isinstance(depth, str) else depth, max(steady, default=0.0),
    )  # fmt: skip
