"""Shapes, where two of them touch, and how shapes are fitted to pixels.

``shapes``: points swept by a radius, their areas and moments.  ``contact``: which vertices and
edges of two placed shapes are near, and the contact points between them.  ``fit``: from a mask to a
shape.  May import constants, errors, arrays and hooks; nothing above them.
"""
