"""Shapes, where two of them touch, and how shapes are fitted to pixels.

``shapes``: points swept by a radius, their areas and moments, their outlines in pieces.
``contact``: which vertices and edges of two placed shapes are near, the contact points between
them, and what outlines do to each other.  ``fit``: from a mask to a shape.
May import constants, errors, arrays and hooks; nothing above them.
"""
