"""The right-hand side: views for kernels, the sum of all forces, their derivatives, and error
norms. The lowest room of the integrators: it imports geometry and state only."""
