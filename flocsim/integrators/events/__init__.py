"""Events that end a step early: a pair touches, parts or becomes the deepest contact, a law has a
kink; and the motion inside a step, by which they are located.

May import ``exponential``, ``radau`` and ``rhs``.
"""
