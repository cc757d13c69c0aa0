"""Shapes of bodies: a sphere or a polygon swept by a disk, its area, centroid and moments.

NumPy objects, made before a run, and kernels on pieces of outlines. May import only arrays,
constants, errors and fields of flocsim.
"""
