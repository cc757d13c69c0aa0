"""Outlines as what acts: pieces of them, and what they do to each other all along.

Kernels on scalars and arrays.  May import ``geometry.shapes``.
"""
