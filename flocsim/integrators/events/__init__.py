"""Events that end a step early: a pair touches, parts or becomes the deepest contact, a law has a
kink.

May import ``rhs``.
"""
