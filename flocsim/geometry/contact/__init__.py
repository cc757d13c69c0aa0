"""Where two bodies touch: candidates, their contact points, and how slip passes between them; and
what two outlines do to each other all along.

Kernels on scalars and on the arrays of a run.  May import ``geometry.shapes``.
"""
