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

from flocsim.body import NO_LAYER, NO_OUTLINES, Fluid
from flocsim.errors import KernelError, UsageError
from flocsim.forces.base import BodyForce, ContactForce, Force, PairForce, names_of
from flocsim.forces.check import (
    check_kernel,
    event_count,
    fields_read,
    kernel_arguments,
    reach_of,
)
from flocsim.forces.outline import (
    layer_along,
    layer_numbers,
    outlines_of_forces,
    pressures_of,
    smoothness,
)
from flocsim.forces.pair_resistance import PairResistance, stand_in
from flocsim.geometry.shapes.shape import Shape
from flocsim.hooks import LAWS
from flocsim.state.views import (
    NUMBERS_OF_SHAPES,
    BodyView,
    ContactView,
    PairView,
    PlainBodyView,
    moved_contact,
)


def body_change(view, axis):
    """How much to change x, y, angle (axis 0–2) or vx, vy, spin (3–5) by [m, rad, m/s, rad/s]."""
    if axis < 3:
        return 1e-6 if axis == 2 else 1e-6 * view.radius
    floor = 1e-9 / view.radius if axis == 5 else 1e-9
    return 1e-3 * abs((view.vx, view.vy, view.spin)[axis - 3]) + floor


def contact_change(view, axis):
    """How much to change an overlap, its rate, a slip or its rate (axis 0–3) by [m or m/s]."""
    value = (view.overlap, view.overlap_rate, view.slip, view.slip_rate)[axis]
    floor = 1e-13 if axis % 2 == 0 else 1e-9
    return 1e-3 * abs(value) + floor


def pressed_contact(view):
    """A ContactView without what is no overlap, as an own law of contact sees it.

    Steps are tried beyond the end of a contact, where the two surfaces are apart.
    """
    return moved_contact(view, max(view.overlap, 0.0), view.overlap_rate, view.slip, view.slip_rate)


VIEWS = BodyView, PlainBodyView, ContactView, PairView
VELOCITIES = {"vx", "vy", "spin"}
PLACES = {"x", "y", "angle", "time"}
PLACES_OF_PAIRS = {
    "centres": "centre", "surfaces": "surface", "outlines": "outline", "orientations": "oriented",
}  # fmt: skip
ROOM = 64
"""Numbers of one kind of force stand at a multiple of so many places, so that more numbers of
another kind leave the text of a law as it is."""


@attrs.define
class Pieces:
    """What forces make of a scene: its laws {name of flocsim.hooks.LAWS: plain function}, their
    numbers, the gaps up to which surface and centre forces reach (−1: there are none) and how the
    gap of outlines is smoothed, how far those all along them look and what acts
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
        if hasattr(value, "_fields"):
            self.kernels[type(value).__name__] = type(value)
            return f"{type(value).__name__}({', '.join(map(self.value, value))})"
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
    known = (*VIEWS, body_change, contact_change, pressed_contact)
    namespace = {"BASE": base, "max": max, "min": min, "abs": abs, **dict(kernels)}
    namespace |= {each.__name__: each for each in known}
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


def change_text(kind, changed):
    """Source of a function that gives a view of a kind with one of its fields ``changed``, that of
    an axis, by so much."""
    fields = [
        f"view.{name} + by * (axis == {changed.index(name)})" if name in changed else f"view.{name}"
        for name in kind._fields
    ]
    return f"def changed(view, axis, by):\n    return {kind.__name__}({', '.join(fields)})\n"


def differences_text(name, force, view, parts, axes, keep):
    """Source of a function with the one-sided differences of a sum of forces by some axes.

    It returns the ``parts`` of the force first where ``keep``, then their changes by each axis.
    """
    lines = [f"def {name}({view}, parameters):", f"    now = {force}({view}, parameters)"]
    found = [f"now[{part}]" for part in range(parts)] if keep else []
    for axis in axes:
        lines += [
            f"    size_{axis} = {view}_change({view}, {axis})",
            f"    new_{axis} = {force}(changed({view}, {axis}, size_{axis}), parameters)",
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
        reads = fields_read(force, source.fluid, kernel)
        plain = plain and not reads & NUMBERS_OF_SHAPES
        terms["body_force"].append(("", call))
        if reads & VELOCITIES:
            terms["velocity_force"].append(("", call))
        if reads & PLACES:
            terms["position_force"].append(("", call))
    source.functions += [
        sum_function(name, "body", some, 3) for name, some in terms.items() if some
    ]
    fields = ("x", "y", "angle", "vx", "vy", "spin")
    source.functions.append(change_text(PlainBodyView if plain else BodyView, fields))
    for name, axes in (("position", range(3)), ("velocity", range(3, 6))):
        if terms[f"{name}_force"]:
            law = f"{name}_derivatives", f"{name}_force"
            source.functions.append(differences_text(*law, "body", 3, axes, keep=False))
    return plain


def write_pair_laws(source, forces, kind):
    """The sum of pair forces, and its derivatives by the gap and, negative, by the gap's rate."""
    sums, derivatives = [], []
    for force in forces:
        kernel = force.kernel_in(source.fluid)
        condition = f"pair.gap < {source.value(reach_of(force))}"
        call = source.call(force, kernel, "pair")
        sums.append((condition, call))
        if force.slope is None:
            slope = difference_text(call, "gap", "(1e-4 * abs(pair.gap) + 1e-13)")
        else:
            slope = source.call(force, force.slope, "pair")
        damping = "0.0"
        if "gap_rate" in fields_read(force, source.fluid, kernel):
            change = difference_text(call, "gap_rate", "(1e-3 * abs(pair.gap_rate) + 1e-9)")
            damping = f"-({change})"
        derivatives.append((condition, f"{slope}, {damping}"))
    if forces:
        source.functions += [
            sum_function(f"{kind}_force", "pair", sums, 1),
            sum_function(f"{kind}_derivatives", "pair", derivatives, 2),
        ]


def write_sum(source, forces, law, view):
    """The pressure between two outlines at a point of one, or the energy of two bodies as they are
    turned."""
    terms = []
    for force in forces:
        call = source.call(force, force.kernel_in(source.fluid), view)
        terms.append((f"{view}.gap < {source.value(reach_of(force))}", call))
    if terms:
        source.functions.append(sum_function(law, view, terms, 1))


def write_contact_laws(source, forces):
    """Contact forces, the limit of their tangential displacement, and their events; how many."""
    terms, limits, events = [], [], []
    for force in forces:
        view = "contact" if force.goes_on_apart else "pressed_contact(contact)"
        terms.append(("", source.call(force, force.kernel_in(source.fluid), view)))
        if force.slides:
            limits.append(source.call(force, force.slip_limit, view))
        if force.has_events:
            call = source.call(force, force.events, view)
            events += [f"{call}[{k}]" for k in range(event_count(force, source.fluid))]
    if terms:
        source.functions.append(sum_function("contact_force", "contact", terms, 2))
        fields = ("overlap", "overlap_rate", "slip", "slip_rate")
        source.functions.append(change_text(ContactView, fields))
        law = "contact_derivatives", "contact_force"
        source.functions.append(differences_text(*law, "contact", 2, range(4), keep=True))
    if limits:
        least = f"min({', '.join(limits)})" if len(limits) > 1 else limits[0]
        source.functions.append(f"def slip_limit(contact, parameters):\n    return {least}\n")
    if events:
        lines = ["def contact_event(contact, parameters, which):"]
        for number, event in enumerate(events):
            lines += [f"    if which == {number}:", f"        return {event}"]
        source.functions.append("\n".join([*lines, "    return 1.0"]) + "\n")
    return len(events)


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
        pieces.used[name] = force
        if isinstance(force, PairResistance):
            continue
        try:
            check_kernel(force, fluid)
        except KernelError as error:  # which knows it by its class alone
            raise KernelError(str(error).replace(type(force).__name__, name, 1)) from None
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
    write_sum(sources["oriented"], kinds["oriented"], "oriented_energy", "pair")
    if of_centres := [*kinds["centre"], *kinds["oriented"]]:
        pieces.centre_reach = max(map(reach_of, of_centres))
    if kinds["surface"]:
        pieces.surface_reach = max(map(reach_of, kinds["surface"]))
    water = [stand_in(each) for each in pieces.used.values() if isinstance(each, PairResistance)]
    if kinds["surface"] or water:
        pieces.smoothness = smoothness([*kinds["surface"], *water], fluid)
    layer = layer_along(kinds["outline"], shapes)
    pressures = pressures_of(kinds["outline"], layer)
    write_sum(sources["outline"], pressures, "outline_pressure", "point")
    pieces.outlines = outlines_of_forces(kinds["outline"], pressures, fluid)
    pieces.layer = layer_numbers(layer)
    for source in sources.values():
        pieces.laws |= source.laws(pieces.parameters)
    return pieces
