"""What ends a step early: a pair that touches, parts or becomes the closest, a law with a kink.

May import ``rhs``.
"""
