"""Contact geometry: candidate lists, contact points, the transfer of tangential displacements, and
interactions of whole outlines.

Kernels on scalars and on the arrays of a run. May import ``geometry.shapes``.
"""
