"""The two ways in which engines of different scenes differ: hooks and laws.

Hooks are functions that are replaced in code. ``@hook`` marks, where it is defined, a function that
a method, a family of shapes or an observer may replace; HOOKS lists them all. A driver calls it by
name. For a scene, the composer puts the scene's own function in its place in a copy of everything
that the driver reaches, before that is compiled.

Laws are the few functions that a scene's forces add up to, at most one of each kind, each the sum
of all forces of that kind (codegen.py). The engine around them is compiled once for all scenes. A
law is compiled by itself, in a tenth of a second, and called by its address, so a new force does
not compile the engine anew. A scene without forces of a kind has no law for it, and ``has`` says
so: its part of the work is left out.

``scene.laws`` is an array of addresses (0: none) in the compiled engine, and a tuple of plain
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
"""{"module.name": function}: all functions that may be replaced."""

LAWS: dict[str, tuple[Any, int]] = {
    # Forces and derivatives are separate laws, as most evaluations need forces alone.
    "body_force": (BodyView, 3),
    "velocity_derivatives": (BodyView, 9),
    "position_derivatives": (BodyView, 9),
    "centre_force": (PairView, 1),
    "centre_derivatives": (PairView, 2),
    "surface_force": (PairView, 1),
    "surface_derivatives": (PairView, 2),
    "contact_force": (ContactView, 2),
    "contact_derivatives": (ContactView, 10),
    "slip_limit": (ContactView, 1),
    "contact_event": (ContactView, 1),
    "outline_pressure": (OutlineView, 1),
    "oriented_energy": (OrientedView, 1),
}
"""{name of a law: (its argument besides the parameters, how many values it returns)}, in the order
of ``scene.laws``. For bodies the argument may be a PlainBodyView."""

# The index of each law in ``scene.laws``.
(
    BODY_FORCE, VELOCITY_DERIVATIVES, POSITION_DERIVATIVES,
    CENTRE_FORCE, CENTRE_DERIVATIVES, SURFACE_FORCE, SURFACE_DERIVATIVES,
    CONTACT_FORCE, CONTACT_DERIVATIVES, SLIP_LIMIT, CONTACT_EVENT,
    OUTLINE_PRESSURE, ORIENTED_ENERGY,
) = range(len(LAWS))  # fmt: skip


def hook(function: Function) -> Function:
    """Mark a function that a scene may replace; return it unchanged."""
    HOOKS[f"{function.__module__}.{function.__qualname__}"] = function
    return function


# These defaults do nothing: without an observer, for example, no run is stopped.
@hook
@apart
def attempt(scene, work, clock, step):
    """Try one step; return its error over the tolerance, or −1 if it failed.

    Its arguments and results: flocsim.integrators.base.Integrator.
    """
    return 0.0


@hook
def next_step(clock, step, ratio):
    """Return the size of the step after one whose error was ``ratio`` times the tolerance."""
    return step


@hook
def awaits_touch(observed):
    """Return True if methods of fixed steps, too, must end a step where the first pair touches."""
    return False


@hook
def observe(scene, work, observed, time):
    """Watch an accepted step; return a code other than 0 to stop the run."""
    return 0


# Uncompiled, these hooks call the functions in scene.laws; compiled_calls replaces all of them.
@hook
def has(scene, law):
    """Return True if the scene has a law."""
    return scene.laws[law] is not None


@hook
def body_force(scene, view):
    """Return (fx, fy, torque) of all body forces on the body of a BodyView [N, N, N m]."""
    return scene.laws[BODY_FORCE](view, scene.parameters)


@hook
def velocity_derivatives(scene, view):
    """Return the derivatives of body_force by the body's velocity: (fx, fy, torque) by vx, by vy,
    by spin [N s/m, N s/rad, N s, N m s/rad]."""
    return scene.laws[VELOCITY_DERIVATIVES](view, scene.parameters)


@hook
def position_derivatives(scene, view):
    """Return the derivatives of body_force by the body's position: (fx, fy, torque) by x, by y, by
    the angle [N/m, N/rad, N, N m/rad]."""
    return scene.laws[POSITION_DERIVATIVES](view, scene.parameters)


@hook
def centre_force(scene, view):
    """Return the repulsion along the line of centres of a PairView [N], the sum of all centre
    forces."""
    return scene.laws[CENTRE_FORCE](view, scene.parameters)


@hook
def centre_derivatives(scene, view):
    """Return (∂F/∂gap, −∂F/∂(gap rate)) of centre_force [N/m, N s/m]."""
    return scene.laws[CENTRE_DERIVATIVES](view, scene.parameters)


@hook
def surface_force(scene, view):
    """Return the repulsion between the outlines of a PairView [N], the sum of all surface
    forces."""
    return scene.laws[SURFACE_FORCE](view, scene.parameters)


@hook
def surface_derivatives(scene, view):
    """Return (∂F/∂gap, −∂F/∂(gap rate)) of surface_force [N/m, N s/m]."""
    return scene.laws[SURFACE_DERIVATIVES](view, scene.parameters)


@hook
def contact_force(scene, view):
    """Return (normal, tangential) of all contact forces at the contact point of a ContactView
    [N]."""
    return scene.laws[CONTACT_FORCE](view, scene.parameters)


@hook
def contact_derivatives(scene, view):
    """Return (normal, tangential) of contact_force [N], then both by overlap, by its rate, by slip
    and by its rate [N/m, N s/m]."""
    return scene.laws[CONTACT_DERIVATIVES](view, scene.parameters)


@hook
def slip_limit(scene, view):
    """Return the largest elastic tangential displacement that a contact holds [m]."""
    return scene.laws[SLIP_LIMIT](view, scene.parameters)


@hook
def contact_event(scene, view, which):
    """Return event function ``which`` of the contact forces: it changes sign where a force has a
    kink."""
    return scene.laws[CONTACT_EVENT](view, scene.parameters, which)


@hook
def oriented_energy(scene, view):
    """Return the energy of the two bodies of an OrientedView [J], the sum of all oriented
    forces."""
    return scene.laws[ORIENTED_ENERGY](view, scene.parameters)


@hook
def outline_pressure(scene, view):
    """Return the pressure that pushes two outlines apart at the point of an OutlineView [Pa]."""
    return scene.laws[OUTLINE_PRESSURE](view, scene.parameters)


def view_of(law: str, plain: bool) -> Any:
    """Return the view that a law receives; ``plain`` if no kernel reads the numbers of shapes."""
    view, _ = LAWS[law]
    return PlainBodyView if plain and view is BodyView else view


@functools.cache
def argument_types(law: str, plain: bool) -> Any:
    """Return the numba types of a law's arguments."""
    from numba import types

    from flocsim.compiler.table_types import Elements

    number, view = types.float64, view_of(law, plain)
    more = (types.int64,) if law == "contact_event" else ()
    given = types.NamedUniTuple(number, len(view._fields), view)
    # The array of parameters has any length: new values and more forces recompile no engine.
    return given, Elements(number, (0,)), *more


def signature_text(law: str, plain: bool) -> str:
    """Return the signature of a law as text, which is part of its cache key."""
    # The names of fields belong to it: a view of other fields needs other machine code.
    return f"{law} {view_of(law, plain)._fields} {LAWS[law][1]}"


def has_address(scene, law):
    """Return True if the scene has a law: ``has`` in the compiled engine."""
    return scene.laws[law] != 0


@functools.cache
def compiled_calls(plain: bool) -> dict[Callable, Callable]:
    """Return {hook: function} by which the compiled engine calls laws by their addresses.

    ``plain`` is True if laws of bodies receive PlainBodyViews.
    """
    calls: dict[Callable, Callable] = {has: has_address}
    # Numba needs a function of fixed arity for each law, so they are generated.
    for index, law in enumerate(LAWS):
        more = ", which" if law == "contact_event" else ""
        call = Intrinsic(signature_text(law, plain), functools.partial(call_of_law, law, plain))
        names: dict[str, Any] = {"call": call, "__name__": __name__}
        exec(
            f"def {law}(scene, view{more}):\n"
            f"    return call(scene.laws[{index}], view, scene.parameters{more})\n",
            names,
        )
        calls[globals()[law]] = names[law]
    return calls


def call_of_law(law, plain):
    """Return the function by which compiled code calls a law by its address."""
    from flocsim.compiler.table_types import call_of

    def target(given):
        # Nothing checks the types behind an address: a mismatch would read wrong memory.
        expected = argument_types(law, plain)
        assert tuple(given[1:]) == expected, f"{law} is given {given}"
        return "", "d" * LAWS[law][1]

    return call_of(target)


def law_table(functions: dict[str, Callable], *, jit: bool, plain: bool = False) -> Any:
    """Return the laws {name: plain function} as ``scene.laws``: addresses, or the functions
    themselves.

    ``plain`` as in compiled_calls. Raises KernelError for a law that cannot be compiled.
    """
    if not jit:
        # Uncompiled scenes call the functions themselves; None stands for no law.
        return tuple(functions.get(name) for name in LAWS)
    # Addresses of compiled laws; 0 where the scene has none.
    addresses = [0] * len(LAWS)
    for index, name in enumerate(LAWS):
        if name in functions:
            given = functools.partial(argument_types, name, plain)
            addresses[index] = compile_law(functions[name], signature_text(name, plain), given)
    return np.array(addresses, dtype=np.int64)
