"""Generate the laws of a scene: functions that add up the kernels of its force objects.

The generated source is short and contains no numbers. Parameter values are stored in one flat
array, so new values never recompile a law. Only functions that the scene needs are generated:
absent forces, forces out of reach, and derivatives with respect to fields that no kernel reads are
left out.

Derivatives of kernels are finite differences with respect to the fields of a view. The laws compute
these differences themselves, because one call of a law (through its address) costs less than one
call per shifted view.
"""

import functools
from collections.abc import Callable, Iterable, Sequence

import attrs

from flocsim.body import NO_LAYER, NO_OUTLINES, Fluid
from flocsim.errors import KernelError, UsageError
from flocsim.forces.base import Force, force_names
from flocsim.forces.check import (
    RESULTS,
    check_kernel,
    event_count,
    fields_read,
    kernel_arguments,
    reach_of,
)
from flocsim.forces.outline import (
    charge_layer,
    layer_parameters,
    outline_parameters,
    pressures_of,
    smoothness,
)
from flocsim.forces.pair_resistance import PairResistance, lubrication_stand_in
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
    """Return the increment [m, rad, m/s, rad/s] for axis 0–2 (x, y, angle) or 3–5 (vx, vy,
    spin)."""
    if axis < 3:
        return 1e-6 if axis == 2 else 1e-6 * view.radius
    floor = 1e-9 / view.radius if axis == 5 else 1e-9
    # 1e-3 of the velocity, with a floor for a body at rest.
    return 1e-3 * abs((view.vx, view.vy, view.spin)[axis - 3]) + floor


def contact_change(view, axis):
    """Return the increment [m or m/s] for axis 0–3: overlap, its rate, slip, its rate."""
    # Rates: 1e-3 of the value, with a floor for a value of zero.
    if axis % 2 == 1:
        return 1e-3 * abs((view.overlap_rate, view.slip_rate)[axis // 2]) + 1e-9
    # Lengths: 1e-3 of those of the contact, as a limit of friction may be far below a picometre.
    # Less slip, rather than more, does not exceed that limit.
    size = 1e-3 * (abs(view.overlap) + abs(view.slip)) + 1e-18
    return -size if axis == 2 and view.slip > 0.0 else size


def pressed_contact(view):
    """Return a ContactView with its overlap clipped at 0, for laws that do not extend to a gap.

    Trial steps lead beyond the end of a contact, where the two surfaces are apart.
    """
    return moved_contact(view, max(view.overlap, 0.0), view.overlap_rate, view.slip, view.slip_rate)


VIEWS = BodyView, PlainBodyView, ContactView, PairView
VELOCITIES = {"vx", "vy", "spin"}
PLACES = {"x", "y", "angle", "time"}
BLOCK_LENGTH = 64
"""Parameters of each kind of force start at a multiple of this index, so that more parameters of
one kind do not change the source of another kind's laws."""


@attrs.define
class Pieces:
    """Contributions of the forces to a scene.

    Attributes
    ----------
    laws : dict
        {name in flocsim.hooks.LAWS: plain function}.
    parameters : list of float
        Parameters of all kernels, read by the laws.
    surface_reach, centre_reach : float
        Largest gaps of surface and centre forces [m]; −1 without any.
    smoothness : (float, float, float)
        See forces/outline.smoothness.
    outlines, layer : tuple
        Scene.outlines and Scene.layer (forces/outline.py).
    events : int
        Number of event functions of contact forces.
    plain_bodies : bool
        Whether body forces receive PlainBodyViews.
    used, left_out : dict
        {unique name: force} and {unique name: reason}.
    """

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
    """Source text of the laws of one kind of force, its kernels and its parameters.

    The text reads the parameters from the array ``parameters``, from index ``BASE`` on.
    """

    fluid: Fluid
    functions: list[str] = attrs.Factory(list)
    kernels: dict[str, Callable] = attrs.Factory(dict)
    numbers: list[float] = attrs.Factory(list)

    def value(self, value):
        """Store a number or a (named) tuple of numbers; return the text that reads it back."""
        if hasattr(value, "_fields"):
            self.kernels[type(value).__name__] = type(value)
            return f"{type(value).__name__}({', '.join(map(self.value, value))})"
        if isinstance(value, tuple):
            return "(" + "".join(self.value(each) + ", " for each in value) + ")"
        self.numbers.append(value)
        return f"parameters[BASE + {len(self.numbers) - 1}]"

    def call(self, force, kernel, view):
        """Return the text of a call of a kernel with its parameters read from the array."""
        # Numbered: two forces of one class have different parameters and may have different
        # kernels.
        name = f"{type(force).__name__}_{kernel.__name__}_{len(self.kernels)}"
        self.kernels[name] = kernel
        arguments = kernel_arguments(force, self.fluid, kernel)
        return f"{name}({', '.join([view, *map(self.value, arguments)])})"

    def laws(self, parameters):
        """Append the parameters of this kind to ``parameters`` and return {law: function}."""
        base = len(parameters)
        parameters += self.numbers
        # Pad to the next multiple of BLOCK_LENGTH; a kind without parameters still occupies one
        # block.
        parameters += [0.0] * (
            -len(parameters) % BLOCK_LENGTH or (BLOCK_LENGTH if not self.numbers else 0)
        )
        return made_laws("\n\n".join(self.functions), base, tuple(self.kernels.items()))


@functools.lru_cache(maxsize=256)
def made_laws(text, base, kernels):
    """Compile a source text to {law: function}, cached so that equal text yields the same
    functions."""
    known = (*VIEWS, body_change, contact_change, pressed_contact)
    namespace = {"BASE": base, "max": max, "min": min, "abs": abs, **dict(kernels)}
    namespace |= {each.__name__: each for each in known}
    exec(compile(text, "<scene>", "exec"), namespace)
    return {name: namespace[name] for name in LAWS if name in namespace}


def sum_function(name, view, terms, zeros):
    """Return the source of a function that adds up terms, each a tuple of as many parts as
    ``zeros``.

    ``terms`` are (condition, call); the condition is "" or an expression such as a reach test.
    """
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


def difference_text(call, axis, size):
    """Return the source of a central difference of a pair kernel by the gap (axis 0) or its rate
    (axis 1)."""
    ahead, behind = (
        call.replace("(pair", f"(changed(pair, {axis}, {sign}{size})", 1) for sign in "+-"
    )
    return f"({ahead} - {behind}) / (2.0 * {size})"


def change_text(kind, changed):
    """Return the source of ``changed(view, axis, by)``, a copy with one field incremented.

    ``changed``: the names of the fields, in the order of the axes.
    """
    # Branch-free: (axis == k) is 0 or 1.
    fields = [
        f"view.{name} + by * (axis == {changed.index(name)})" if name in changed else f"view.{name}"
        for name in kind._fields
    ]
    return f"def changed(view, axis, by):\n    return {kind.__name__}({', '.join(fields)})\n"


def differences_text(name, force, view, parts, axes, keep):
    """Return the source of a function with one-sided differences of a sum of forces.

    It returns the ``parts`` of the force first if ``keep``, then their derivatives along each axis.
    """
    lines = [f"def {name}({view}, parameters):", f"    now = {force}({view}, parameters)"]
    found = [f"now[{part}]" for part in range(parts)] if keep else []
    for axis in axes:
        # size: increment; new: force of the changed view.
        lines += [
            f"    size_{axis} = {view}_change({view}, {axis})",
            f"    new_{axis} = {force}(changed({view}, {axis}, size_{axis}), parameters)",
        ]
        found += [f"(new_{axis}[{part}] - now[{part}]) / size_{axis}" for part in range(parts)]
    return "\n".join([*lines, f"    return {', '.join(found)}"]) + "\n"


def write_body_laws(source, forces):
    """Write the body forces and their derivatives; return True if PlainBodyViews suffice."""
    plain = True
    terms = {"body_force": [], "velocity_force": [], "position_force": []}
    for force in forces:
        kernel = force.kernel_in(source.fluid)
        call = source.call(force, kernel, "body")
        reads = fields_read(force, source.fluid, kernel)
        plain = plain and not reads & NUMBERS_OF_SHAPES
        terms["body_force"].append(("", call))
        # Only forces that read a velocity (a position) enter the damping (stiffness) differences.
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


def write_sum(source, forces, law, view):
    """Write the sum of forces between pairs (pressures, energies); return its terms."""
    terms = []
    for force in forces:
        # Beyond its reach a force is not called at all.
        condition = f"{view}.gap < {source.value(reach_of(force))}"
        terms.append((condition, source.call(force, force.kernel_in(source.fluid), view)))
    if terms:
        source.functions.append(sum_function(law, view, terms, 1))
    return terms


def write_pair_laws(source, forces, kind):
    """Write the sum of pair forces and its derivatives: ∂F/∂gap and −∂F/∂(gap rate)."""
    terms, derivatives = write_sum(source, forces, f"{kind}_force", "pair"), []
    for force, (condition, call) in zip(forces, terms, strict=True):
        if force.slope is None:
            # 1e-4 of the gap: power laws of the gap are resolved to 1e-8.
            slope = difference_text(call, 0, "(1e-4 * abs(pair.gap) + 1e-13)")
        else:
            slope = source.call(force, force.slope, "pair")
        damping = "0.0"
        # Only a force that reads the rate of the gap has a damping.
        if "gap_rate" in fields_read(force, source.fluid, force.kernel_in(source.fluid)):
            change = difference_text(call, 1, "(1e-3 * abs(pair.gap_rate) + 1e-9)")
            damping = f"-({change})"
        derivatives.append((condition, f"{slope}, {damping}"))
    if forces:
        source.functions.append(change_text(PairView, ("gap", "gap_rate")))
        source.functions.append(sum_function(f"{kind}_derivatives", "pair", derivatives, 2))


def write_contact_laws(source, forces):
    """Write contact forces, slip limit and events; return the number of event functions."""
    terms, limits, events = [], [], []
    for force in forces:
        # Laws that do not extend to a gap see an overlap of 0 there.
        view = "contact" if force.goes_on_apart else "pressed_contact(contact)"
        terms.append(("", source.call(force, force.kernel_in(source.fluid), view)))
        if force.slides:
            limits.append(f"float({source.call(force, force.slip_limit, view)})")
        if force.has_events:
            call = source.call(force, force.events, view)
            events += [f"float({call}[{k}])" for k in range(event_count(force, source.fluid))]
    if terms:
        source.functions.append(sum_function("contact_force", "contact", terms, 2))
        fields = ("overlap", "overlap_rate", "slip", "slip_rate")
        source.functions.append(change_text(ContactView, fields))
        law = "contact_derivatives", "contact_force"
        source.functions.append(differences_text(*law, "contact", 2, range(4), keep=True))
    if limits:
        # Several contact forces share one displacement ξ: the smallest limit holds.
        least = f"min({', '.join(limits)})" if len(limits) > 1 else limits[0]
        source.functions.append(f"def slip_limit(contact, parameters):\n    return {least}\n")
    if events:
        lines = ["def contact_event(contact, parameters, which):"]
        for number, event in enumerate(events):
            lines += [f"    if which == {number}:", f"        return {event}"]
        # An index beyond the last event: never zero.
        source.functions.append("\n".join([*lines, "    return 1.0"]) + "\n")
    return len(events)


def sort_forces(pieces, forces, fluid):
    """Return the forces by kind; note absent ones in ``pieces.left_out``.

    Raises UsageError for an object that is no force, KernelError for an unusable kernel.
    """
    kinds = {kind: [] for kind in RESULTS}
    forces = list(forces)
    for name, force in zip(force_names(forces), forces, strict=True):
        if not isinstance(force, Force):
            raise UsageError(f"a force must be a flocsim Force object, found {force!r}")
        # A force of zero strength: no code is generated for it.
        if force.absent:
            pieces.left_out[name] = force.absent
            continue
        pieces.used[name] = force
        # It has no kernel: the engine evaluates it from tables
        # (integrators/rhs/pair_resistance.py).
        if isinstance(force, PairResistance):
            continue
        if force.acts_on not in kinds:
            raise UsageError(
                f"{name} must subclass BodyForce, CentreForce, SurfaceForce, OutlineForce, "
                "OrientedForce or ContactForce"
            )
        try:
            check_kernel(force, fluid)
        except KernelError as error:  # the error names the class; put the unique name instead
            raise KernelError(str(error).replace(type(force).__name__, name, 1)) from None
        kinds[force.acts_on].append(force)
    return kinds


def laws_of(forces: Iterable[Force], fluid: Fluid, shapes: Sequence[Shape] = ()) -> Pieces:
    """Return the Pieces of these forces in this fluid, for bodies of these shapes.

    Without ``shapes`` double layers along outlines are taken as thin, as between plates.
    """
    pieces = Pieces()
    kinds = sort_forces(pieces, forces, fluid)
    sources = {kind: Source(fluid) for kind in kinds}
    pieces.plain_bodies = write_body_laws(sources["bodies"], kinds["bodies"])
    write_pair_laws(sources["centres"], kinds["centres"], "centre")
    write_pair_laws(sources["surfaces"], kinds["surfaces"], "surface")
    pieces.events = write_contact_laws(sources["contacts"], kinds["contacts"])
    write_sum(sources["orientations"], kinds["orientations"], "oriented_energy", "pair")
    of_centres = [*kinds["centres"], *kinds["orientations"]]
    pieces.centre_reach = max(map(reach_of, of_centres), default=-1.0)
    pieces.surface_reach = max(map(reach_of, kinds["surfaces"]), default=-1.0)
    # A pair resistance follows the smooth gap, too: lubrication stands in for it there.
    lubrication = [
        lubrication_stand_in(each)
        for each in pieces.used.values()
        if isinstance(each, PairResistance)
    ]
    if followers := [*kinds["surfaces"], *lubrication]:
        pieces.smoothness = smoothness(followers, fluid)
    # A double layer thicker than corners are round acts between charges, not as a pressure.
    layer = charge_layer(kinds["outlines"], shapes)
    pressures = pressures_of(kinds["outlines"], layer)
    write_sum(sources["outlines"], pressures, "outline_pressure", "point")
    pieces.outlines = outline_parameters(kinds["outlines"], pressures, fluid)
    pieces.layer = layer_parameters(layer)
    for source in sources.values():
        pieces.laws |= source.laws(pieces.parameters)
    return pieces
