"""Shapes, contact geometry of placed shapes, and fits of shapes to pixels.

``shapes``: core points swept by a disk, areas and moments, outlines in pieces. ``contact``: near
vertices and edges of two placed shapes, their contact points, and forces between outlines. ``fit``:
from a mask to a shape. May import constants, errors, arrays and hooks.
"""
