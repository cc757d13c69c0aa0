"""The right-hand side: views for kernels, the sum of all forces, their derivatives, and what an
error in it amounts to.  The lowest room of the integrators: imports geometry and arrays only.
"""
