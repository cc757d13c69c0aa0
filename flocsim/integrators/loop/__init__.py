"""The one loop around every integrator: the driver, how it chooses the size of a step, the stated
error of a run, and thermal kicks.

May import all rooms of steps: ``backward_euler``, ``events``, ``exponential``, ``radau`` and
``rhs``.
"""
