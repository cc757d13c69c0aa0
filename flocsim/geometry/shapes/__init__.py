"""What a body looks like: a sphere or a polygon swept by a disk, its area, centroid and moments.

Objects with NumPy, made before a run, and kernels on pieces of outlines.  Imports nothing of
flocsim but arrays, constants, errors and fields.
"""
