"""The integrator that a config names."""

import difflib

from flocsim.errors import ConfigError
from flocsim.integrators import DormandPrince54, Implicit, Overdamped, VelocityVerlet


def make_implicit(options):
    """Implicit at the config's tolerance."""
    return Implicit(tolerance=options.tolerance)


def make_dormand_prince(options):
    """DormandPrince54 at the config's tolerance."""
    return DormandPrince54(tolerance=options.tolerance)


def make_overdamped(options):
    """Overdamped at the config's tolerance."""
    return Overdamped(tolerance=options.tolerance)


def make_velocity_verlet(options):
    """VelocityVerlet with the config's step."""
    if options.step is None:
        raise ConfigError(
            'integrator.name = "velocity_verlet" needs integrator.step, the fixed step in seconds'
        )
    return VelocityVerlet(step=options.step)


METHODS = {
    "implicit": make_implicit,
    "dormand_prince54": make_dormand_prince,
    "overdamped": make_overdamped,
    "velocity_verlet": make_velocity_verlet,
}
"""Makers of integrators by their name in a config."""


def make_integrator(config):
    """The Integrator of a config; ConfigError for an unknown name."""
    options = config.integrator
    if options.name not in METHODS:
        near = difflib.get_close_matches(options.name, METHODS, 1)
        hint = f" (did you mean {near[0]!r}?)" if near else ""
        raise ConfigError(
            f"integrator.name must be {' or '.join(map(repr, METHODS))}, found "
            f"{options.name!r}{hint}"
        )
    return METHODS[options.name](options)
