"""What replaces the polygon code in a scene of spheres: one pair per two bodies."""

from flocsim.geometry import candidates, contacts


def turn_nothing(work, state):
    """Spheres look the same at every angle."""


def place_nothing(scene, work):
    """A sphere's core point stays at its centroid."""


FILLINGS = {
    contacts.turn_bodies: turn_nothing,
    candidates.place_vertices: place_nothing,
    candidates.list_polygons: candidates.list_spheres,
    contacts.locate_polygons: contacts.locate_spheres,
}
"""The replacements, for flocsim.composer.compose."""
