"""Clones of functions, with others in the place of hooks: what a scene's driver reaches, as one."""

import builtins
import types
from collections.abc import Callable
from typing import Any

from flocsim.compiler.reads import is_users_module, module_reads, reached, refuse_closure


def apart(function: Callable) -> Callable:
    """Mark a function that is compiled by itself (flocsim.compiler.units), and called by what
    reaches it as one C file calls another: one that reaches much, takes much longer than a call,
    and is called from several places or by several engines. It returns numbers."""
    function.apart = f"{function.__module__}.{function.__qualname__}"  # type: ignore[attr-defined]
    return function


def loops_apart(function: Callable) -> Callable:
    """Mark a function that is compiled by itself, and is a loop over many numbers without a branch:
    it takes several of them at once, to the same bits."""
    function.loops = True  # type: ignore[attr-defined]
    return apart(function)


def postponed(stand_in: Callable) -> Callable:
    """Mark a function that few runs reach, and that fills a hook which is compiled apart: until it
    is reached, ``stand_in`` is called, which tells so (flocsim.arrays: NOT_COMPILED)."""

    def mark(function: Callable) -> Callable:
        function.stand_in = stand_in  # type: ignore[attr-defined]
        return function

    return mark


class Linker:
    """Clones functions, with others in the place of hooks."""

    def __init__(
        self,
        fillings: dict[Callable, Callable],
        transform: Callable[[Any], Any] = lambda clone: clone,
        made: Callable[[Any], Any] = lambda value: value,
        called: Callable[[Any], Any] | None = None,
    ) -> None:
        """``fillings`` {hook: function}; ``transform(clone)`` compiles or not; ``made(value)``:
        what stands for what is no function; ``called(function)``: what stands for one that is
        compiled apart and called by another."""
        self.fillings = fillings
        self.transform = transform
        self.made = made
        self.called = called
        self.clones: dict[Callable, Any] = {}

    def link(self, function: Callable) -> Any:
        """The clone of a function, all that it calls linked as well."""
        filled = self.fillings.get(function, function)
        if filled not in self.clones:
            refuse_closure(filled)
            if self.called and hasattr(filled, "apart"):
                self.clones[filled] = self.called(filled)
            else:
                clone = self.clone(filled)
                if hasattr(function, "apart"):  # what fills a hook goes by its name
                    clone.apart = function.apart
                self.clones[filled] = self.transform(clone)
        return self.clones[filled]

    def first(self, function: Callable) -> Any:
        """The clone of the function that a unit begins with, though others call it by its name."""
        refuse_closure(function)
        return self.transform(self.clone(function))

    def linked_value(self, value):
        """A function linked, anything else as it is, or as numba is to see it."""
        return self.link(value) if isinstance(value, types.FunctionType) else self.made(value)

    def put(self, names, chain, value):
        """Put ``module.name`` among a clone's globals: in a module that has what is read alone.

        What the user's module is given later, or has compiled before, is not seen then.
        """
        *modules, name = chain
        for each in modules:
            known = names.get(each)
            if not isinstance(known, types.ModuleType):
                names[each] = known = types.ModuleType(each)
            names = vars(known)
        names[name] = value

    def clone(self, function):
        """A copy of the function whose globals are its own, linked."""
        linked = {"__builtins__": builtins, "__name__": function.__module__}
        for name, value in reached(function).items():
            if not is_users_module(value):
                linked[name] = self.linked_value(value)
        for chain, value in module_reads(function).items():
            self.put(linked, chain, self.linked_value(value))
        copy = types.FunctionType(
            function.__code__, linked, function.__name__, function.__defaults__
        )
        copy.__qualname__ = function.__qualname__
        copy.__module__ = function.__module__
        copy.__dict__.update(function.__dict__)
        return copy
