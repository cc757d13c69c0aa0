"""Which functions the driver of a scene reaches: the report says what is really compiled."""

import types

from flocsim.fingerprint import reached
from flocsim.integrators.driver import advance
from flocsim.integrators.jacobian import assemble_jacobian


def functions_of(system):
    """All plain functions that the system's driver reaches, its slots filled."""
    fillings, found, pending = system.fillings(), set(), [advance]
    while pending:
        function = pending.pop()
        function = fillings.get(function, function)
        if function not in found:
            found.add(function)
            values = reached(function).values()
            pending += [value for value in values if isinstance(value, types.FunctionType)]
    return found


def differentiates(system):
    """Whether the method needs the Jacobian of the forces."""
    return assemble_jacobian in functions_of(system)
