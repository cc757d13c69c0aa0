"""Outlines: the cores of some bodies as arrays, with their trees of circles."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from flocsim.geometry.contact.circle_tree import tree_of
from flocsim.geometry.contact.compounds import compound_tree, point_columns
from flocsim.geometry.shapes.shape import Shape


class Outlines(NamedTuple):
    """The cores of some bodies, as the kernels here read them; a Scene has the same fields.

    Core points of body b are rows ``first[b]`` to ``first[b + 1]`` of ``vertices``, its circles the
    rows from ``2 * first[b]`` on of ``tree``. Where a body has a core of several rings, every row
    of ``vertices`` has the columns of compounds.py behind x and y.
    """

    first: np.ndarray
    vertices: np.ndarray
    tree: np.ndarray


@lru_cache(maxsize=256)
def tree_of_shape(shape):
    return compound_tree(shape) if shape.is_compound else tree_of(shape.vertices)


def outlines_of(shapes: Sequence[Shape]) -> Outlines:
    """The Outlines of some shapes, one body each."""
    sizes = [len(shape.vertices) for shape in shapes]
    compound = any(shape.is_compound for shape in shapes)
    rows = [point_columns(shape) if compound else shape.vertices for shape in shapes]
    return Outlines(
        first=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        # C order whatever the shapes have: another order would be compiled anew.
        vertices=np.ascontiguousarray(np.concatenate(rows)),
        tree=np.concatenate([tree_of_shape(shape) for shape in shapes]),
    )
