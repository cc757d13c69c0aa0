"""From force objects to the scene's laws: generated source that adds up their kernels.

The text is short and has no numbers in it: a force's values travel in one flat array, so that new
values never recompile. What a scene does not need (absent forces, forces out of reach,
derivatives of what no kernel reads) is not written, and is no law of the scene.

Derivatives of kernels are differences, of views that are shifted. The laws take the differences
themselves: one call of a law costs less than one for every shift.
"""

import functools
from collections.abc import Callable, Iterable, Sequence

import attrs

from flocsim.arrays import NUMBERS_OF_SHAPES, BodyView, ContactView, PairView, PlainBodyView
from flocsim.body import NO_LAYER, NO_OUTLINES, Fluid
from flocsim.errors import KernelError, UsageError
from flocsim.forces.base import BodyForce, ContactForce, Force, PairForce, names_of
from flocsim.forces.check import (
    SAMPLE_BODIES,
    check_kernel,
    event_count,
    fields_read,
    kernel_arguments,
    reach_of,
    sample_pairs,
)
from flocsim.forces.outline import (
    layer_along,
    layer_numbers,
    outlines_of_forces,
    pressures_of,
)
from flocsim.forces.pair_resistance import PairResistance, stand_in
from flocsim.forces.smoothing import smoothness
from flocsim.geometry.shapes.shape import Shape
from flocsim.laws import LAWS


def body_change(view, axis):
    """How much to change x, y, angle (axis 0–2) or vx, vy, spin (3–5) by [m, rad, m/s, rad/s]."""
    if axis < 3:
        return 1e-6 if axis == 2 else 1e-6 * view.radius
    floor = 1e-9 / view.radius if axis == 5 else 1e-9
    return 1e-3 * abs((view.vx, view.vy, view.spin)[axis - 3]) + floor


def changed_body(view, axis, by):
    """A BodyView with one of x, y, angle (axis 0–2) or vx, vy, spin (3–5) changed."""
    return BodyView(
        view.time,
        view.x + by * (axis == 0), view.y + by * (axis == 1), view.angle + by * (axis == 2),
        view.vx + by * (axis == 3), view.vy + by * (axis == 4), view.spin + by * (axis == 5),
        view.mass, view.buoyant_mass, view.inertia, view.radius,
        view.elongation, view.long_axis, view.kick_x, view.kick_y, view.kick_turn,
        view.resistance_xx, view.resistance_xy, view.resistance_yy,
        view.resistance_xs, view.resistance_ys, view.resistance_ss,
        view.strain_xx_x, view.strain_xx_y, view.strain_xx_s,
        view.strain_xy_x, view.strain_xy_y, view.strain_xy_s,
        view.shielding_xx, view.shielding_xy, view.shielding_yy,
    )  # fmt: skip


def changed_plain_body(view, axis, by):
    """The same of a PlainBodyView."""
    return PlainBodyView(
        view.time,
        view.x + by * (axis == 0), view.y + by * (axis == 1), view.angle + by * (axis == 2),
        view.vx + by * (axis == 3), view.vy + by * (axis == 4), view.spin + by * (axis == 5),
        view.mass, view.buoyant_mass, view.inertia, view.radius,
        view.elongation, view.long_axis, view.kick_x, view.kick_y, view.kick_turn,
    )  # fmt: skip


def contact_change(view, axis):
    """How much to change an overlap, its rate, a slip or its rate (axis 0–3) by [m or m/s]."""
    value = (view.overlap, view.overlap_rate, view.slip, view.slip_rate)[axis]
    floor = 1e-13 if axis % 2 == 0 else 1e-9
    return 1e-3 * abs(value) + floor


def changed_contact(view, axis, by):
    """A ContactView with its overlap, overlap rate, slip or slip rate (axis 0–3) changed."""
    return ContactView(
        view.overlap + by * (axis == 0), view.overlap_rate + by * (axis == 1),
        view.slip + by * (axis == 2), view.slip_rate + by * (axis == 3),
        view.effective_mass, view.radius_i, view.radius_j,
    )  # fmt: skip


def pressed_contact(view):
    """A ContactView without what is no overlap, as an own law of contact sees it.

    Steps are tried beyond the end of a contact, where the two surfaces are apart.
    """
    return ContactView(
        max(view.overlap, 0.0), view.overlap_rate, view.slip, view.slip_rate,
        view.effective_mass, view.radius_i, view.radius_j,
    )  # fmt: skip


VELOCITIES = {"vx", "vy", "spin"}
PLACES = {"x", "y", "angle", "time"}
PLACES_OF_PAIRS = {
    "centres": "centre", "surfaces": "surface", "outlines": "outline", "orientations": "oriented",
}  # fmt: skip
CHANGES = (
    body_change, changed_body, changed_plain_body, contact_change, changed_contact, pressed_contact,
)  # fmt: skip

ROOM = 64
"""Numbers of one kind of force stand at a multiple of so many places, so that more numbers of
another kind leave the text of a law as it is."""


@attrs.define
class Pieces:
    """What forces make of a scene: its laws {name of flocsim.laws.LAWS: plain function}, their
    numbers, the gaps up to which surface and centre forces reach (−1: there are none) and how the
    gap of outlines is smoothed (smoothing.py), how far those all along them look and what acts
    between their charges (outline.py), how many events its contact forces have, whether its body
    forces are given PlainBodyViews, and which forces are used and left out, {name: force} and
    {name: why}, each by a name of its own (base.names_of)."""

    laws: dict[str, Callable] = attrs.Factory(dict)
    parameters: list[float] = attrs.Factory(list)
    surface_reach: float = -1.0
    centre_reach: float = -1.0
    smoothness: tuple[float, float, float] = (1.0, 0.0, 1.0)
    outlines: tuple[float, float, float, float] = NO_OUTLINES
    layer: tuple[float, float, float] = NO_LAYER
    events: int = 0
    plain_bodies: bool = True
    used: dict[str, Force] = attrs.Factory(dict)
    left_out: dict[str, str] = attrs.Factory(dict)


@attrs.define
class Source:
    """The source of the laws of one kind of force, the kernels that it names, and the numbers that
    it reads from ``parameters``, from place ``BASE`` on."""

    fluid: Fluid
    functions: list[str] = attrs.Factory(list)
    kernels: dict[str, Callable] = attrs.Factory(dict)
    numbers: list[float] = attrs.Factory(list)

    def value(self, value):
        """Keep a number or a tuple of numbers; the text that reads it back."""
        if isinstance(value, tuple):
            return "(" + "".join(self.value(each) + ", " for each in value) + ")"
        self.numbers.append(value)
        return f"parameters[BASE + {len(self.numbers) - 1}]"

    def call(self, force, kernel, view):
        """Text of a call of a kernel with its parameters read from the array."""
        name = f"{type(force).__name__}_{kernel.__name__}_{len(self.kernels)}"
        self.kernels[name] = kernel
        arguments = kernel_arguments(force, self.fluid, kernel)
        return f"{name}({', '.join([view, *map(self.value, arguments)])})"

    def laws(self, parameters):
        """{law: function}; its numbers are appended to ``parameters``."""
        base = len(parameters)
        parameters += self.numbers
        parameters += [0.0] * (-len(parameters) % ROOM or (ROOM if not self.numbers else 0))
        return made_laws("\n\n".join(self.functions), base, tuple(self.kernels.items()))


@functools.lru_cache(maxsize=256)
def made_laws(text, base, kernels):
    """{law: function} of a source text; the same functions for the same text and kernels."""
    namespace = {"PairView": PairView, "BASE": base, "max": max, "min": min, "abs": abs}
    namespace |= {each.__name__: each for each in CHANGES}
    namespace |= dict(kernels)
    exec(compile(text, "<scene>", "exec"), namespace)
    return {name: namespace[name] for name in LAWS if name in namespace}


def sum_function(name, view, terms, zeros):
    """Source of a function that adds up the given terms (tuples of as many parts as zeros)."""
    lines = [f"def {name}({view}, parameters):"]
    totals = [f"total_{k}" for k in range(zeros)]
    parts = [f"part_{k}" for k in range(zeros)]
    lines += [f"    {total} = 0.0" for total in totals]
    for condition, term in terms:
        indent = "    "
        if condition:
            lines.append(f"    if {condition}:")
            indent = "        "
        lines.append(f"{indent}{', '.join(parts)} = {term}")
        lines += [f"{indent}{t} += {p}" for t, p in zip(totals, parts, strict=True)]
    lines.append(f"    return {', '.join(totals)}")
    return "\n".join(lines) + "\n"


def difference_text(call, field, size):
    """Source of a central difference of a pair kernel by one field of its view."""
    index = PairView._fields.index(field)
    shifted = []
    for sign in "+-":
        fields = [f"pair.{each}" for each in PairView._fields]
        fields[index] = f"pair.{field} {sign} {size}"
        shifted.append(call.replace("(pair", f"(PairView({', '.join(fields)})", 1))
    return f"({shifted[0]} - {shifted[1]}) / (2.0 * {size})"


def differences_text(name, force, view, parts, axes, keep, changed=None):
    """Source of a function with the one-sided differences of a sum of forces by some axes.

    It returns the ``parts`` of the force first where ``keep``, then their changes by each axis;
    ``changed``: what changes a view, as `changed_contact`, where its name does not tell.
    """
    changed = changed or f"changed_{view}"
    lines = [f"def {name}({view}, parameters):", f"    now = {force}({view}, parameters)"]
    found = [f"now[{part}]" for part in range(parts)] if keep else []
    for axis in axes:
        lines += [
            f"    size_{axis} = {view}_change({view}, {axis})",
            f"    new_{axis} = {force}({changed}({view}, {axis}, size_{axis}), parameters)",
        ]
        found += [f"(new_{axis}[{part}] - now[{part}]) / size_{axis}" for part in range(parts)]
    return "\n".join([*lines, f"    return {', '.join(found)}"]) + "\n"


def write_body_laws(source, forces):
    """Body forces, and derivatives of those parts of them that depend on velocity or place; whether
    they are given PlainBodyViews."""
    plain = True
    terms = {"body_force": [], "velocity_force": [], "position_force": []}
    for force in forces:
        kernel = force.kernel_in(source.fluid)
        call = source.call(force, kernel, "body")
        reads = fields_read(force, source.fluid, kernel, SAMPLE_BODIES)
        plain = plain and not reads & NUMBERS_OF_SHAPES
        terms["body_force"].append(("", call))
        if reads & VELOCITIES:
            terms["velocity_force"].append(("", call))
        if reads & PLACES:
            terms["position_force"].append(("", call))
    source.functions += [
        sum_function(name, "body", some, 3) for name, some in terms.items() if some
    ]
    for name, axes in (("position", range(3)), ("velocity", range(3, 6))):
        if terms[f"{name}_force"]:
            law = f"{name}_derivatives", f"{name}_force"
            changed = "changed_plain_body" if plain else "changed_body"
            text = differences_text(*law, "body", 3, axes, keep=False, changed=changed)
            source.functions.append(text)
    return plain


def write_pair_laws(source, forces, kind):
    force_terms, slope_terms, damping_terms = [], [], []
    for force in forces:
        condition = f"pair.gap < {source.value(reach_of(force))}"
        call = source.call(force, force.kernel, "pair")
        force_terms.append((condition, call))
        if force.slope is None:
            slope = difference_text(call, "gap", "(1e-4 * abs(pair.gap) + 1e-13)")
        else:
            slope = source.call(force, force.slope, "pair")
        slope_terms.append((condition, slope))
        samples = sample_pairs(reach_of(force))
        if "gap_rate" in fields_read(force, source.fluid, force.kernel, samples):
            change = difference_text(call, "gap_rate", "(1e-3 * abs(pair.gap_rate) + 1e-9)")
            damping_terms.append((condition, f"-({change})"))
    if forces:
        source.functions += [
            sum_function(f"{kind}_force", "pair", force_terms, 1),
            sum_function(f"{kind}_slope", "pair", slope_terms, 1),
            sum_function(f"{kind}_damping", "pair", damping_terms, 1),
            f"def {kind}_derivatives(pair, parameters):\n"
            f"    return {kind}_slope(pair, parameters), {kind}_damping(pair, parameters)\n",
        ]


def write_outline_law(source, forces):
    """The pressure between two outlines at a point of one."""
    terms = []
    for force in forces:
        call = source.call(force, force.kernel_in(source.fluid), "point")
        terms.append((f"point.gap < {source.value(reach_of(force))}", call))
    if terms:
        source.functions.append(sum_function("outline_pressure", "point", terms, 1))


def write_oriented_law(source, forces):
    """The energy of two bodies as they are turned."""
    terms = []
    for force in forces:
        call = source.call(force, force.kernel, "pair")
        terms.append((f"pair.gap < {source.value(reach_of(force))}", call))
    if terms:
        source.functions.append(sum_function("oriented_energy", "pair", terms, 1))


def write_contact_laws(source, forces):
    """Contact forces, the limit of their tangential displacement, and their events; how many."""
    terms, limits, events = [], [], []
    for force in forces:
        view = "contact" if force.goes_on_apart else "pressed_contact(contact)"
        terms.append(("", source.call(force, force.kernel, view)))
        if force.slides:
            limits.append(source.call(force, force.slip_limit, view))
        if force.has_events:
            call = source.call(force, force.events, view)
            events.append((event_count(force, source.fluid), call))
    if terms:
        source.functions.append(sum_function("contact_force", "contact", terms, 2))
        law = "contact_derivatives", "contact_force"
        source.functions.append(differences_text(*law, "contact", 2, range(4), keep=True))
    if limits:
        least = f"min({', '.join(limits)})" if len(limits) > 1 else limits[0]
        source.functions.append(f"def slip_limit(contact, parameters):\n    return {least}\n")
    if events:
        source.functions.append(event_text(events))
    return sum(count for count, _ in events)


def event_text(events):
    """Source of the function that gives the event of a number, those of all forces in a row."""
    lines, first = ["def contact_event(contact, parameters, which):"], 0
    for count, call in events:
        for each in range(count):
            lines += [f"    if which == {first + each}:", f"        return {call}[{each}]"]
        first += count
    return "\n".join([*lines, "    return 1.0"]) + "\n"


def sort_forces(pieces, forces, fluid):
    """Forces by kind, absent ones noted as left out.

    UsageError for what is no force, KernelError for a force whose kernel cannot be used.
    """
    kinds = {"body": [], "centre": [], "surface": [], "contact": [], "outline": [], "oriented": []}
    forces = list(forces)
    for name, force in zip(names_of(forces), forces, strict=True):
        if not isinstance(force, Force):
            raise UsageError(f"a force must be a flocsim Force object, found {force!r}")
        if force.absent:
            pieces.left_out[name] = force.absent
            continue
        if isinstance(force, PairResistance):
            pieces.used[name] = force
            continue
        check_named(force, fluid, name)
        pieces.used[name] = force
        if isinstance(force, BodyForce):
            kinds["body"].append(force)
        elif isinstance(force, ContactForce):
            kinds["contact"].append(force)
        elif isinstance(force, PairForce):
            kinds[PLACES_OF_PAIRS[force.acts_on]].append(force)
        else:
            raise UsageError(
                f"{name} must subclass BodyForce, CentreForce, SurfaceForce, OutlineForce, "
                "OrientedForce or ContactForce"
            )
    return kinds


def check_named(force, fluid, name):
    """KernelError, which names the force, where its kernel cannot be used."""
    try:
        check_kernel(force, fluid)
    except KernelError as error:
        raise KernelError(str(error).replace(type(force).__name__, name, 1)) from None


def laws_of(forces: Iterable[Force], fluid: Fluid, shapes: Sequence[Shape] = ()) -> Pieces:
    """The Pieces of a scene with these forces in this fluid, between bodies of these shapes:
    without any, double layers along outlines are as thin as between plates."""
    pieces = Pieces()
    kinds = sort_forces(pieces, forces, fluid)
    sources = {kind: Source(fluid) for kind in kinds}
    pieces.plain_bodies = write_body_laws(sources["body"], kinds["body"])
    write_pair_laws(sources["centre"], kinds["centre"], "centre")
    write_pair_laws(sources["surface"], kinds["surface"], "surface")
    pieces.events = write_contact_laws(sources["contact"], kinds["contact"])
    write_oriented_law(sources["oriented"], kinds["oriented"])
    if of_centres := [*kinds["centre"], *kinds["oriented"]]:
        pieces.centre_reach = max(map(reach_of, of_centres))
    if kinds["surface"]:
        pieces.surface_reach = max(map(reach_of, kinds["surface"]))
    water = [stand_in(each) for each in pieces.used.values() if isinstance(each, PairResistance)]
    if kinds["surface"] or water:
        pieces.smoothness = smoothness([*kinds["surface"], *water], fluid)
    layer = layer_along(kinds["outline"], shapes)
    pressures = pressures_of(kinds["outline"], layer)
    write_outline_law(sources["outline"], pressures)
    pieces.outlines = outlines_of_forces(kinds["outline"], pressures, fluid)
    pieces.layer = layer_numbers(layer)
    for source in sources.values():
        pieces.laws |= source.laws(pieces.parameters)
    return pieces
