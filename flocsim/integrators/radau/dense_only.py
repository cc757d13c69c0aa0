"""What replaces the sparse systems in a scene of few bodies, which would only take time to compile:
its systems are dense."""

from collections.abc import Callable

from flocsim.integrators.radau import elimination


def no_factors(scene, work, step):
    """Never called."""
    return False


def no_solution(work, both):
    """Never called."""


FILLINGS: dict[Callable, Callable] = {
    elimination.factorise_sparse: no_factors,
    elimination.solve_sparse: no_solution,
}
"""The replacements, for flocsim.compiler.composer.compose."""
