"""What replaces the polygon code in a scene of spheres: one pair per two bodies."""

from collections.abc import Callable

from flocsim.geometry.contact import near_pairs
from flocsim.geometry.contact import points as contacts


def turn_nothing(work, state, body):
    """Spheres look the same at every angle."""


FILLINGS: dict[Callable, Callable] = {
    contacts.turn_body: turn_nothing,
    near_pairs.list_polygons: near_pairs.list_spheres,
    near_pairs.gap_between: near_pairs.sphere_gap,
    contacts.locate_polygons: contacts.locate_spheres,
}
"""The replacements, for flocsim.compiler.composer.compose."""
