"""The one loop around every integrator: the driver, and how it chooses the size of a step.

May import ``events`` and ``rhs``; integrators do not import it.
"""
