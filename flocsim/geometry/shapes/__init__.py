"""What a body looks like: a sphere or a polygon swept by a disk, its area, centroid and moments.

Objects with NumPy, made before a run.  Imports nothing of flocsim but constants, errors and fields.
"""
