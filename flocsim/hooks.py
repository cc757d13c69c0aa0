"""In what the engines of scenes differ: hooks, which are replaced in code, and laws, which are
called through pointers.

``@hook`` marks a function that a method, a family of shapes or an observer may replace, where it is
defined, and HOOKS lists them all. A driver calls it by name; for a scene the composer puts the
scene's own function in its place in a clone of everything that the driver reaches, before that is
compiled.

Laws are the few functions that a scene's forces add up to, at most one of each kind, the sum of all
its forces of that kind (codegen.py). The engine around them is compiled once for all scenes; a law
is compiled by itself, in a tenth of a second, and the engine calls it by its address. What a scene
has no forces for it has no law for, and ``has`` tells: that is the one way in which physics is left
out.

``scene.laws`` is an array of addresses (0: none) where the engine is compiled, and a tuple of plain
functions (None: none) where it runs uncompiled, for debugging and as a reference.
"""

import functools
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from flocsim.compiler.composer import compile_law
from flocsim.compiler.fingerprint import Intrinsic
from flocsim.compiler.linker import apart
from flocsim.state.views import (
    BodyView,
    ContactView,
    OrientedView,
    OutlineView,
    PairView,
    PlainBodyView,
)

Function = TypeVar("Function", bound=Callable)

HOOKS: dict[str, Callable] = {}
"""{"module.name": function}: what may be replaced."""

LAWS = (
    "body_force", "velocity_derivatives", "position_derivatives",
    "centre_force", "centre_derivatives", "surface_force", "surface_derivatives",
    "contact_force", "contact_derivatives", "slip_limit", "contact_event",
    "outline_pressure", "oriented_energy",
)  # fmt: skip
"""Names of the laws, in the order of ``scene.laws``."""

(
    BODY_FORCE, VELOCITY_DERIVATIVES, POSITION_DERIVATIVES,
    CENTRE_FORCE, CENTRE_DERIVATIVES, SURFACE_FORCE, SURFACE_DERIVATIVES,
    CONTACT_FORCE, CONTACT_DERIVATIVES, SLIP_LIMIT, CONTACT_EVENT,
    OUTLINE_PRESSURE, ORIENTED_ENERGY,
) = range(len(LAWS))  # fmt: skip


def hook(function: Function) -> Function:
    """Mark a function that a scene may replace; it stays what it is."""
    HOOKS[f"{function.__module__}.{function.__qualname__}"] = function
    return function


@hook
@apart
def attempt(scene, work, clock, step):
    """One step of the integrator: the local error over the tolerance, or −1 where it failed.

    What it is given and what it has to fill: flocsim.integrators.base.Integrator.
    """
    return 0.0


@hook
def next_step(clock, step, ratio):
    """The size of the next step after one whose error was ``ratio`` times the tolerance."""
    return step


@hook
def end_within(scene, work, step, ratio, share):
    """Make the motion at a share of a step, whose error is ``ratio`` times what is allowed, the
    new state, as good as a shorter step's; False where it would not be, and nothing changes."""
    return False


@hook
def step_to_switch(scene, work, step, share):
    """The step to be tried behind one that was seen to pass a switch at a share of it, and could
    not be ended there."""
    return share * step


SHARE_OF_TOUCH = 0.1
"""The error of the first step behind a touch is taken to be that which it leads to times (h ω0)⁴
over this share."""


def resolving_step(clock, frequency, later):
    """The step behind a touch at a speed by which bodies would go so far later [m], that resolves
    how contacts of a frequency [1/s] take it up, as far as the tolerance asks for it."""
    return (SHARE_OF_TOUCH * clock.tolerance / later) ** 0.25 / frequency


@hook
def first_step(work, clock, frequency, speed, later):
    """The step behind a touch at a speed [m/s]: see resolving_step."""
    return resolving_step(clock, frequency, later)


@hook
def cut(scene, work, clock, step, resolution, depth):
    """End a step that is a series where something has switched in it that its ends do not show, in
    NEW; the share of it that is left. What touches by less than the depth [m] has not."""
    return 1.0


@hook
def choose_method(scene, work, clock, counts):
    """Whether the next steps end at switches or go on across them, into ACROSS of the clock, where
    a method may do both."""


@hook
@apart
def step_across(scene, work, clock, step):
    """One step of a method that may do both, across switches: what ``attempt`` returns."""
    return -1.0


@hook
@apart
def leave_out_cycles(scene, work, clock, counts, until):
    """Go on by many equal cycles of switches at once, where they are, to before a time [s]."""


@hook
def note_step(scene, work, clock, step):
    """Write down what a method of steps across switches has to know of one that is accepted."""


@hook
def awaits_touch(observed):
    """Whether a method of fixed steps, too, is to end a step where the first pair touches."""
    return False


@hook
def observe(scene, work, observed, time):
    """Watches every accepted step; a code other than 0 stops the run."""
    return 0


@hook
def has(scene, law):
    """Whether a scene has a law."""
    return scene.laws[law] is not None


@hook
def body_force(scene, view):
    """(fx, fy, torque) of all body forces on the body of a BodyView [N, N, N m]."""
    return scene.laws[BODY_FORCE](view, scene.parameters)


@hook
def velocity_derivatives(scene, view):
    """Derivatives of body_force by the body's velocity: (fx, fy, torque) by vx, by vy, by spin.

    None where no kernel reads it [N s/m, N s/rad, N s, N m s/rad].
    """
    return scene.laws[VELOCITY_DERIVATIVES](view, scene.parameters)


@hook
def position_derivatives(scene, view):
    """The same by its place: (fx, fy, torque) by x, by y, by the angle [N/m, N/rad, N, N m/rad]."""
    return scene.laws[POSITION_DERIVATIVES](view, scene.parameters)


@hook
def centre_force(scene, view):
    """Repulsion along the line of centres of a PairView [N], all centre forces together."""
    return scene.laws[CENTRE_FORCE](view, scene.parameters)


@hook
def centre_derivatives(scene, view):
    """(derivative of centre_force by the gap, minus that by the gap's rate) [N/m, N s/m]."""
    return scene.laws[CENTRE_DERIVATIVES](view, scene.parameters)


@hook
def surface_force(scene, view):
    """Repulsion between the outlines of a PairView [N], all surface forces together."""
    return scene.laws[SURFACE_FORCE](view, scene.parameters)


@hook
def surface_derivatives(scene, view):
    """(derivative of surface_force by the gap, minus that by the gap's rate) [N/m, N s/m]."""
    return scene.laws[SURFACE_DERIVATIVES](view, scene.parameters)


@hook
def contact_force(scene, view):
    """(normal, tangential) of all contact forces at the contact point of a ContactView [N]."""
    return scene.laws[CONTACT_FORCE](view, scene.parameters)


@hook
def contact_derivatives(scene, view):
    """(normal, tangential) of contact_force, then both by overlap, by its rate, by slip, by its
    rate [N, N/m, N s/m]."""
    return scene.laws[CONTACT_DERIVATIVES](view, scene.parameters)


@hook
def slip_limit(scene, view):
    """The largest elastic tangential displacement that a contact holds [m]."""
    return scene.laws[SLIP_LIMIT](view, scene.parameters)


@hook
def contact_event(scene, view, which):
    """Event ``which`` of the contact forces: it changes its sign where a force has a kink."""
    return scene.laws[CONTACT_EVENT](view, scene.parameters, which)


@hook
def oriented_energy(scene, view):
    """The energy of the two bodies of an OrientedView [J], of all oriented forces together."""
    return scene.laws[ORIENTED_ENERGY](view, scene.parameters)


@hook
def outline_pressure(scene, view):
    """What pushes the outlines of two bodies apart at the point of an OutlineView [Pa]."""
    return scene.laws[OUTLINE_PRESSURE](view, scene.parameters)


VIEWS = (
    *(BodyView,) * 3,
    *(PairView,) * 4,
    *(ContactView,) * 4,
    OutlineView,
    OrientedView,
)
"""What each law is given, beside the parameters; those of bodies may be PlainBodyViews."""

NUMBERS = 3, 9, 9, 1, 2, 1, 2, 2, 10, 1, 1, 1, 1
"""How many numbers each law returns."""


def view_of(index: int, plain: bool) -> Any:
    """What a law is given; ``plain``: whether no kernel reads the numbers of shapes."""
    return PlainBodyView if plain and VIEWS[index] is BodyView else VIEWS[index]


@functools.cache
def given_to(index: int, plain: bool) -> Any:
    """The numba types of a law's arguments."""
    from numba import types

    number, view = types.float64, view_of(index, plain)
    more = (types.int64,) if index == CONTACT_EVENT else ()
    given = types.NamedUniTuple(number, len(view._fields), view)
    return given, types.CPointer(number), *more


def signature_text(index: int, plain: bool) -> str:
    """The same in words, for what is kept of it."""
    return f"{LAWS[index]} {view_of(index, plain)._fields} {NUMBERS[index]}"


def has_address(scene, law):
    """``has`` in the compiled engine."""
    return scene.laws[law] != 0


@functools.cache
def compiled_calls(plain: bool) -> dict[Callable, Callable]:
    """{hook: function} that let the compiled engine call laws by their addresses; ``plain``:
    whether those of bodies are given PlainBodyViews."""
    calls: dict[Callable, Callable] = {has: has_address}
    for index, law in enumerate(LAWS):
        more = ", which" if index == CONTACT_EVENT else ""
        call = Intrinsic(signature_text(index, plain), functools.partial(call_of_law, index, plain))
        names: dict[str, Any] = {"call": call, "__name__": __name__}
        exec(
            f"def {law}(scene, view{more}):\n"
            f"    return call(scene.laws[{index}], view, scene.parameters{more})\n",
            names,
        )
        calls[globals()[law]] = names[law]
    return calls


def call_of_law(index, plain):
    """Return what calls a law by its address, for numba."""
    from flocsim.compiler.table_types import call_of

    view, _, *more = given_to(index, plain)

    def target(given):
        assert given[1] == view and list(given[3:]) == more, f"{LAWS[index]} is given {given}"
        return "", "d" * NUMBERS[index]

    return call_of(("address", "view", "parameters", "which")[: 3 + len(more)], target)


def law_table(functions: dict[str, Callable], *, jit: bool, plain: bool = False) -> Any:
    """The laws {name: plain function} as ``scene.laws``: addresses, or the functions themselves;
    ``plain``: as for compiled_calls.

    KernelError for a law that cannot be compiled.
    """
    if not jit:
        return tuple(functions.get(name) for name in LAWS)
    addresses = [
        compile_law(
            functions[name], signature_text(index, plain), NUMBERS[index],
            functools.partial(given_to, index, plain),
        )
        if name in functions
        else 0
        for index, name in enumerate(LAWS)
    ]  # fmt: skip
    return np.array(addresses, dtype=np.int64)
